"""Time series of a motion's inputs: acceleration, jerk, tilt and angular velocity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_discovery.discover.tuning import TUNING
from slosh_model.interpolation import columns_at
from slosh_model.simulate import Inputs
from slosh_motion.signals.motion_spans import motion_spans


@dataclass(frozen=True, slots=True, eq=False)
class InputSeries:
    """Acceleration, jerk, tilt and angular velocity of a motion at given times.

    Attributes:
        t: (M,) on the inputs' clock [s].
        span: when the first motion starts and the last one ends [s].
        acceleration: (M, 3) [m/s²].
        jerk: (M, 3) [m/s³].
        tilt: (M,) angle between the container's axis and the vertical [rad].
        rate: (M, 3) angular velocity in the container's frame [rad/s].
    """

    t: Array
    span: tuple[float, float]
    acceleration: Array
    jerk: Array
    tilt: Array
    rate: Array

    @classmethod
    def at(cls, inputs: Inputs, times: Array) -> InputSeries:
        """Interpolates the inputs at times [s]; beyond the ends they are constant."""
        acceleration = inputs.acceleration
        jerk = (
            np.gradient(acceleration, inputs.t, axis=0)
            if len(inputs.t) > 1
            else np.zeros_like(acceleration)
        )
        return cls(
            times,
            motion_span(inputs),
            columns_at(times, inputs.t, acceleration),
            columns_at(times, inputs.t, jerk),
            np.interp(times, inputs.t, _tilt(inputs)),
            columns_at(times, inputs.t, angular_velocity(inputs)),
        )

    def quantities(self) -> dict[str, Array]:
        """Returns the magnitudes (M,) of acceleration, jerk, tilt and rates by name."""
        return {
            "‖a‖": np.linalg.norm(self.acceleration, axis=1),
            "z̈₀": np.abs(self.acceleration[:, 2]),
            "jerk": np.linalg.norm(self.jerk, axis=1),
            "tilt": np.abs(self.tilt),
            "tilt rate": np.hypot(self.rate[:, 0], self.rate[:, 1]),
            "yaw rate": np.abs(self.rate[:, 2]),
        }


def motion_span(inputs: Inputs) -> tuple[float, float]:
    """Returns when the container first starts to move and when it last stops [s].

    Of a container that never moves both are the inputs' end.
    """
    stamps = np.rint(inputs.t * SECOND).astype(np.int64)
    spans = motion_spans(stamps, inputs.acceleration, angular_velocity(inputs))
    if not spans:
        return float(inputs.t[-1]), float(inputs.t[-1])
    start, end = spans[0].start_ns / SECOND, spans[-1].end_ns / SECOND
    return max(start, float(inputs.t[0])), min(end, float(inputs.t[-1]))


def still_until(inputs: Inputs) -> float:
    """Returns the time [s] until which nothing excites the liquid.

    That is before the first motion starts: an acceleration that is no motion yet raises the
    liquid by a millimetre, which is no noise. With a sensor's noise on the inputs nobody knows,
    and the answer is their start.
    """
    size = np.linalg.norm(inputs.acceleration, axis=1)
    driven = size > TUNING.still_input * float(size.max(initial=0.0))
    driven |= np.linalg.norm(angular_velocity(inputs), axis=1) > TUNING.still_rate
    rows = np.flatnonzero(driven)
    return float(inputs.t[max(int(rows[0]) - 1, 0)] if len(rows) else inputs.t[-1])


def angular_velocity(inputs: Inputs) -> Array:
    """Returns the angular velocity (N, 3) [rad/s] in the container's frame; 0 if unknown."""
    return inputs.poses[:, 4:7] if len(inputs.poses) else np.zeros((len(inputs.t), 3))


def _tilt(inputs: Inputs) -> Array:
    if not len(inputs.poses):
        return np.zeros(len(inputs.t))
    axis = Rotation.from_quat(inputs.poses[:, :4]).as_matrix()[:, :, 2]
    return np.asarray(np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2]))
