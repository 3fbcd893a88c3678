"""What moves the container, as series at any times: sizes of acceleration, jerk, tilt, rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from slosh_model.interpolation import columns_at
from slosh_model.simulate import Inputs

Array = NDArray[np.float64]

REST = 1e-3
"""The container rests where its acceleration is below this share of the motion's peak,"""
REST_RATE = 1e-4
"""and where it turns more slowly than this [rad/s]."""


@dataclass(frozen=True, slots=True, eq=False)
class InputSeries:
    """A motion's inputs at given times.

    Attributes:
        t: (M,) on the inputs' clock [s].
        span: when the motion starts and ends [s].
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
        """The series at these times [s]; outside the inputs, as at their ends."""
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
        """(M,) sizes by name, with the unit, in a fixed order."""
        return {
            "‖a‖": np.linalg.norm(self.acceleration, axis=1),
            "z̈₀": np.abs(self.acceleration[:, 2]),
            "jerk": np.linalg.norm(self.jerk, axis=1),
            "tilt": np.abs(self.tilt),
            "tilt rate": np.hypot(self.rate[:, 0], self.rate[:, 1]),
            "yaw rate": np.abs(self.rate[:, 2]),
        }


def motion_span(inputs: Inputs) -> tuple[float, float]:
    """When the container starts to move and when it has come to rest [s].

    A motion that never moves starts and ends at the inputs' end.
    """
    size = np.linalg.norm(inputs.acceleration, axis=1)
    moving = size > REST * float(size.max(initial=0.0))
    moving |= np.linalg.norm(angular_velocity(inputs), axis=1) > REST_RATE
    rows = np.flatnonzero(moving)
    if len(rows) == 0:
        return float(inputs.t[-1]), float(inputs.t[-1])
    last = min(int(rows[-1]) + 1, len(inputs.t) - 1)
    return float(inputs.t[max(int(rows[0]) - 1, 0)]), float(inputs.t[last])


def angular_velocity(inputs: Inputs) -> Array:
    """(N, 3) in the container's frame [rad/s]: as given, or from the attitude; at rest: 0."""
    return inputs.poses[:, 4:7] if len(inputs.poses) else np.zeros((len(inputs.t), 3))


def _tilt(inputs: Inputs) -> Array:
    if not len(inputs.poses):
        return np.zeros(len(inputs.t))
    axis = Rotation.from_quat(inputs.poses[:, :4]).as_matrix()[:, :, 2]
    return np.asarray(np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2]))
