"""Mechanical models of liquid sloshing in a moving container.

Pure physics: no ROS, no files, no clock. SI units throughout.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from slosh_model import self_test as self_test  # its checks belong to the compiled functions
from slosh_model.batch import wall_heights
from slosh_model.containers import Cylinder, Rectangle
from slosh_model.errors import SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.liquid import Liquid
from slosh_model.measure import measured_heights, predicted_heights
from slosh_model.model import EffectUse, Model
from slosh_model.simulate import Inputs, Response, Simulator, State, simulate

if TYPE_CHECKING:
    from slosh_model.model_text import format_model, parse_model

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


def __getattr__(name: str) -> Any:
    # They read YAML by slosh_files, which a model that is made in Python does without.
    if name not in ("format_model", "parse_model"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("slosh_model.model_text"), name)
