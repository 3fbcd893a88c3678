"""Mechanical models of liquid sloshing in a moving container.

Pure physics: no ROS, no clock, and no files but for `read_model`. SI units throughout.
"""

from typing import TYPE_CHECKING

from slosh_base.files.lazy_names import lazy_names
from slosh_model import self_test as self_test  # its checks belong to the compiled functions
from slosh_model import shapes as shapes  # its shapes become known to model files
from slosh_model.batch import wall_heights
from slosh_model.errors import SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.liquid import Liquid
from slosh_model.measure import measured_heights, predicted_heights
from slosh_model.model import EffectUse, Model
from slosh_model.response import Response
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs, Simulator, State, simulate

if TYPE_CHECKING:
    from slosh_model.model_text import format_model, parse_model, read_model

__all__ = [
    "Cylinder",
    "EffectUse",
    "Inputs",
    "Liquid",
    "Model",
    "Rectangle",
    "Response",
    "Simulator",
    "SloshModelError",
    "State",
    "ValidityLimits",
    "format_model",
    "measured_heights",
    "parse_model",
    "predicted_heights",
    "read_model",
    "simulate",
    "wall_heights",
]

# They load PyYAML, which a model that is made in Python does without.
__getattr__ = lazy_names(
    __name__,
    {"format_model": "model_text", "parse_model": "model_text", "read_model": "model_text"},
)
