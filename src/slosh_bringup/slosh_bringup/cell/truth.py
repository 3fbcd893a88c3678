"""Simulates the reference liquid and the sensors for a motion of the container."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_bringup.cell.motions import CellMotion
from slosh_model.constants import GRAVITY
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.simulate import Inputs, simulate

PUSHED = 0.1
"""How long a push lasts [s]."""


@dataclass(frozen=True, slots=True)
class TruthLiquid:
    """Heights of the reference liquid at the container's wall during a motion.

    Attributes:
        t: (N,) time [s].
        sh_x, sh_y: (N,) wall height at +x and +y [m]; the wall's height at an azimuth φ is
            sh_x cos φ + sh_y sin φ.
    """

    t: Array
    sh_x: Array
    sh_y: Array

    def at(self, t: float) -> tuple[float, float]:
        """Returns the interpolated liquid heights [m] at the wall at +x and +y at a time."""
        # Of two rows alone: for each moment np.interp would copy the whole of a long motion.
        start = max(min(int(np.searchsorted(self.t, t)), len(self.t) - 1) - 1, 0)
        rows = slice(start, start + 2)
        here = self.t[rows]
        return (
            float(np.interp(t, here, self.sh_x[rows])),
            float(np.interp(t, here, self.sh_y[rows])),
        )


class Push(NamedTuple):
    """A simulated push by hand that moves the liquid but that no sensor measures.

    Attributes:
        at: when it begins [s]; it lasts PUSHED.
        speed: that it gives the liquid along x [m/s].
    """

    at: float
    speed: float

    def acceleration(self, t: Array) -> Array:
        """Returns the container acceleration with the same effect as the push, (N, 3) [m/s²]."""
        part = (t - self.at) / PUSHED
        strength = 0.5 * np.pi * self.speed / PUSHED
        found = np.zeros((len(t), 3))
        inside = (part >= 0.0) & (part < 1.0)
        found[inside, 0] = -strength * np.sin(np.pi * part[inside])
        return found


def integrate_truth(model: Model, motion: CellMotion, push: Push | None = None) -> TruthLiquid:
    """Integrates the reference liquid's equations over a motion, starting at rest.

    A tilted container's liquid feels gravity from the side, a = Rᵀ(a + g ẑ) − g ẑ: the truth
    always does, whatever effects its model names.

    Args:
        model: the truth model.
        motion: the container's motion.
        push: by hand; None: there is none.
    """
    _, response = simulated(model, motion, push)
    return TruthLiquid(response.t, response.sh_x, response.sh_y)


def simulated(model: Model, motion: CellMotion, push: Push | None) -> tuple[Inputs, Response]:
    """Returns the acceleration that drives the liquid, and the liquid's simulated response."""
    felt = motion.specific_force() - np.array([0.0, 0.0, GRAVITY])
    if push is not None:
        felt = felt + push.acceleration(motion.t)
    inputs = Inputs(motion.t, felt)
    return inputs, simulate(model, inputs)[0]


@dataclass(frozen=True, slots=True)
class SensorReadings:
    """Simulated sensor measurements at the motion's samples.

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


def read_sensors(motion: CellMotion, noise: float, seed: int) -> SensorReadings:
    """Simulates the readings of all sensors during a motion.

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
    """Returns `values` (N, K), or `value` (K,) repeated `count` times if `values` is None."""
    return np.broadcast_to(value, (count, len(value))) if values is None else values
