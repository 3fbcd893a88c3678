"""What the simulated cell's sensors and robot report of a motion, with reproducible noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_bringup.cell.motions import Motion

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SensorReadings:
    """Readings at the motion's samples.

    Attributes:
        acceleration: (N, 3) in the world, gravity excluded, with noise [m/s²].
        specific_force: (N, 3) of the IMU, in the container's axes, with noise [m/s²].
        angular_velocity: (N, 3) of the IMU, in the container's axes [rad/s].
        position: (N, 3) in the world [m].
        attitude: (N, 4) quaternion x, y, z, w, world ← container.
    """

    acceleration: Array
    specific_force: Array
    angular_velocity: Array
    position: Array
    attitude: Array


def read_sensors(motion: Motion, noise: float, seed: int) -> SensorReadings:
    """The readings of a motion.

    Args:
        motion: the container's motion.
        noise: standard deviation of both accelerometers' white noise [m/s²].
        seed: of the noise.
    """
    generator = np.random.default_rng(seed)
    shape = motion.acceleration.shape
    return SensorReadings(
        motion.acceleration + noise * generator.standard_normal(shape),
        motion.specific_force() + noise * generator.standard_normal(shape),
        _or_constant(motion.angular_velocity, len(motion.t), (0.0, 0.0, 0.0)),
        motion.position,
        _or_constant(motion.attitude, len(motion.t), (0.0, 0.0, 0.0, 1.0)),
    )


def _or_constant(values: Array | None, count: int, value: tuple[float, ...]) -> Array:
    """The values, or the same one at all times where there are none."""
    return np.broadcast_to(value, (count, len(value))) if values is None else values
