"""A motion in fewer samples, for a scan of many time scales."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from slosh_model.interpolation import columns_at
from slosh_plan.trajectory import Trajectory

Array = NDArray[np.float64]


class Averaged:
    """A motion whose accelerations are averaged about each of fewer samples.

    The averages keep what moves the liquid, the acceleration's integral, also of noise and jumps.

    Args:
        trajectory: the motion.
    """

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        t, acceleration = trajectory.t, trajectory.acceleration
        parts = 0.5 * (acceleration[1:] + acceleration[:-1]) * np.diff(t)[:, np.newaxis]
        self._speed = np.concatenate((np.zeros((1, 3)), np.cumsum(parts, axis=0)))
        self._made: dict[int, Trajectory] = {}

    def scaled(self, factor: float, spacing: float) -> Trajectory:
        """The motion run `factor` times as slowly, in samples at most `spacing` apart [s].

        As it is where it has no more samples than that. Those between two powers of two are of one
        grid.
        """
        octave = 2.0 ** math.ceil(math.log2(factor))
        count = math.ceil(self._trajectory.duration * octave / spacing)
        if self._trajectory.turns or count >= len(self._trajectory.t) - 1:
            return self._trajectory.scaled(factor)
        if count not in self._made:
            self._made[count] = self._averaged(max(count, 2))
        return self._made[count].scaled(factor)

    def _averaged(self, count: int) -> Trajectory:
        t = self._trajectory.t
        moments = np.linspace(t[0], t[-1], count + 1)
        half = 0.5 * (moments[1] - moments[0])
        change = self._speed_at(moments + half) - self._speed_at(moments - half)
        return Trajectory(moments, change / (2.0 * half), name=self._trajectory.name)

    def _speed_at(self, moments: Array) -> Array:
        """Integral of the linearly interpolated acceleration; it stays beyond the ends."""
        t, acceleration = self._trajectory.t, self._trajectory.acceleration
        inside = np.clip(moments, t[0], t[-1])
        left = np.clip(np.searchsorted(t, inside, side="right") - 1, 0, len(t) - 2)
        rest = (inside - t[left])[:, np.newaxis]
        middle = 0.5 * (acceleration[left] + columns_at(inside, t, acceleration))
        return np.asarray(self._speed[left] + rest * middle)
