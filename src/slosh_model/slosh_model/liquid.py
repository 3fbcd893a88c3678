"""The liquid, and the damping of its sloshing where none is measured."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_model.checks import within
from slosh_model.constants import GRAVITY
from slosh_model.containers import Cylinder

# The formula's own rounding of the first root of J1'.
FIRST_ROOT = 1.84


@dataclass(frozen=True, slots=True)
class Liquid:
    """A Newtonian liquid; the defaults are water at 20 °C.

    Attributes:
        density: ρ [kg/m³].
        kinematic_viscosity: ν [m²/s].
    """

    density: float = 998.2
    kinematic_viscosity: float = 1.0e-6

    def __post_init__(self) -> None:
        within("liquid.density", self.density, "kg/m³", 1.0, 3e4)
        within("liquid.kinematic_viscosity", self.kinematic_viscosity, "m²/s", 1e-9, 1.0)


def cylinder_damping_ratio(container: Cylinder, liquid: Liquid) -> float:
    """Damping ratio ζ₁ of the first mode in a smooth cylinder, from viscosity.

    The empirical formula in Ibrahim, *Liquid Sloshing Dynamics* (2005), and Dodge, *The New
    "Dynamic Behavior of Liquids in Moving Containers"* (2000).
    """
    viscous = math.sqrt(liquid.kinematic_viscosity / math.sqrt(GRAVITY * container.radius**3))
    ratio = container.fill_height / container.radius
    # 1/sinh and 1/cosh by exp(-x): a deep container must not overflow.
    decay = math.exp(-FIRST_ROOT * ratio)
    inverse_sinh = 2.0 * decay / (1.0 - decay**2)
    inverse_cosh = 2.0 * decay / (1.0 + decay**2)
    return 0.92 * viscous * (1.0 + 0.318 * inverse_sinh * (1.0 + (1.0 - ratio) * inverse_cosh))
