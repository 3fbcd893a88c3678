"""Immutable values with the fields of the messages of slosh_msgs.

Units, frames and what stands for 'unknown' are as in the .msg files. A message's header becomes
`stamp_ns` and `frame_id`; sequences become NumPy arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

NAN = float("nan")


def _empty() -> NDArray[np.float64]:
    return np.empty(0)


@dataclass(frozen=True, slots=True)
class FreeSurface:
    """Measured heights of one image; see FreeSurface.msg."""

    stamp_ns: int
    frame_id: str = "container"
    msh: float = NAN
    msh_stddev: float = NAN
    azimuth: float = NAN
    fitted_msh: float = NAN
    fitted_msh_stddev: float = NAN
    fitted_azimuth: float = NAN
    sh_left: float = NAN
    sh_right: float = NAN
    azimuth_left: float = NAN
    azimuth_right: float = NAN
    slope_angle: float = NAN
    profile_azimuth: NDArray[np.float64] = field(default_factory=_empty)
    profile_height: NDArray[np.float64] = field(default_factory=_empty)
    peak_u: float = NAN
    peak_v: float = NAN
    peak_side: int = 0
    flags: int = 0


@dataclass(frozen=True, slots=True)
class ModelEstimate:
    """One model's answer; see ModelEstimate.msg."""

    model: str = ""
    msh: float = NAN
    azimuth: float = NAN
    sh_x: float = NAN
    sh_y: float = NAN
    modal_position: NDArray[np.float64] = field(default_factory=_empty)
    modal_velocity: NDArray[np.float64] = field(default_factory=_empty)


@dataclass(frozen=True, slots=True)
class SloshEstimate:
    """Both models' answers; see SloshEstimate.msg."""

    stamp_ns: int
    frame_id: str = "container"
    linear: ModelEstimate = field(default_factory=ModelEstimate)
    nonlinear: ModelEstimate = field(default_factory=ModelEstimate)
    acceleration: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    jerk: float = NAN
    yaw: float = 0.0
    flags: int = 0
    samples_used: int = 0
    samples_dropped: int = 0


@dataclass(frozen=True, slots=True)
class ExpectedReading:
    """What a sensor is expected to read of an estimate; see ExpectedReading.msg."""

    stamp_ns: int
    frame_id: str = "container"
    linear: float = NAN
    nonlinear: float = NAN
    delay: float = 0.0


@dataclass(frozen=True, slots=True)
class SloshComparison:
    """Measured against estimated; see SloshComparison.msg."""

    stamp_ns: int
    frame_id: str = "container"
    measured: float = NAN
    measured_stddev: float = NAN
    estimated_linear: float = NAN
    estimated_nonlinear: float = NAN
    residual_linear: float = NAN
    residual_nonlinear: float = NAN
    sigma_linear: float = NAN
    sigma_nonlinear: float = NAN
    epsilon_linear: float = NAN
    epsilon_nonlinear: float = NAN
    count: int = 0
    state: int = 0
    measured_stale: bool = False
    estimate_stale: bool = False
    measured_flags: int = 0
    estimate_flags: int = 0
    without_camera: bool = False
    sides_disagree: bool = False


@dataclass(frozen=True, slots=True)
class MotionPrediction:
    """What the liquid will do on a motion that is about to begin; see MotionPrediction.msg."""

    stamp_ns: int
    frame_id: str = "container"
    state: int = 0
    id: int = 0
    start_ns: int = 0
    from_estimate: bool = False
    duration: float = NAN
    peak: float = NAN
    peak_lower: float = NAN
    peak_upper: float = NAN
    peak_time: float = NAN
    azimuth: float = NAN
    residual: float = NAN
    limit: float = NAN
    residual_limit: float = NAN
    excess: float = NAN
    residual_excess: float = NAN
    flags: int = 0
    description: str = ""


@dataclass(frozen=True, slots=True)
class PredictionOutcome:
    """Predicted against measured peak of a motion; see PredictionOutcome.msg."""

    stamp_ns: int
    frame_id: str = "container"
    id: int = 0
    start_ns: int = 0
    predicted: float = NAN
    estimated: float = NAN
    measured: float = NAN
    error: float = NAN
    counted: bool = False
    count: int = 0
    sigma: float = NAN
    epsilon: float = NAN
    worst: float = NAN
    description: str = ""


@dataclass(frozen=True, slots=True)
class LimitEvent:
    """Start or end of an excess; see LimitEvent.msg."""

    stamp_ns: int
    frame_id: str = "container"
    id: int = 0
    kind: int = 0
    source: int = 0
    limit: float = NAN
    peak: float = NAN
    peak_stamp_ns: int = 0
    duration_ns: int = 0
    description: str = ""
