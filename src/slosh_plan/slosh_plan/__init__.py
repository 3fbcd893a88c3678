"""Predicts sloshing heights before the robot moves, and plans motions within limits.

Pure outside `nodes` and `tables`: no ROS, no files, no clock. SI units throughout.
"""

from typing import TYPE_CHECKING

from slosh_base.files.lazy_names import lazy_names

if TYPE_CHECKING:
    from slosh_plan.errors import SloshPlanError
    from slosh_plan.limits import HeightLimits
    from slosh_plan.prediction import ModelError, Prediction, predict
    from slosh_plan.scaling import SafeScales, safe_scales
    from slosh_plan.start import LiquidState
    from slosh_plan.trajectory import Trajectory

__all__ = [
    "HeightLimits",
    "LiquidState",
    "ModelError",
    "Prediction",
    "SafeScales",
    "SloshPlanError",
    "Trajectory",
    "predict",
    "safe_scales",
]

__getattr__ = lazy_names(
    __name__,
    {
        "HeightLimits": "limits",
        "LiquidState": "start",
        "ModelError": "prediction",
        "Prediction": "prediction",
        "SafeScales": "scaling",
        "SloshPlanError": "errors",
        "Trajectory": "trajectory",
        "predict": "prediction",
        "safe_scales": "scaling",
    },
)
