"""Mechanical models of liquid sloshing in a moving container.

Pure physics: no ROS, no files, no clock. SI units throughout.
"""

from slosh_model import self_test as self_test  # its checks belong to the compiled functions
from slosh_model.batch import wall_heights
from slosh_model.containers import Cylinder, Rectangle
from slosh_model.errors import SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.liquid import Liquid
from slosh_model.measure import measured_heights, predicted_heights
from slosh_model.model import EffectUse, Model
from slosh_model.model_text import format_model, parse_model
from slosh_model.simulate import Inputs, Response, Simulator, State, simulate

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
    "simulate",
    "wall_heights",
]
