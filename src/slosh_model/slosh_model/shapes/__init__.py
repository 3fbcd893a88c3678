"""Shapes of containers, one kind of shape in each module.

Importing it makes their names known to `model.yaml`.
"""

from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.prism import Prism, Tray
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.shapes.revolution import Revolution
from slosh_model.shapes.round_cups import (
    Beaker,
    Bottle,
    Cone,
    Ellipsoid,
    Flask,
    Frustum,
    Sphere,
)
from slosh_model.shapes.trough import LyingCylinder, Trough, Wedge

__all__ = [
    "Beaker",
    "Bottle",
    "Cone",
    "Cylinder",
    "Ellipsoid",
    "Flask",
    "Frustum",
    "LyingCylinder",
    "Prism",
    "Rectangle",
    "Revolution",
    "Sphere",
    "Tray",
    "Trough",
    "Wedge",
]
