"""Says when a motion leaves the range in which the models were validated."""

from __future__ import annotations

import math
from enum import IntFlag

from slosh_estimator.sample import SECONDS, Sample
from slosh_model.model import Model

JERK_FILTER = 0.02
"""Time constant of the low-pass behind the jerk [s].

The jerk is that of the low-passed acceleration, (a - ā)/τ. White noise of 0.05 m/s² then reads as
about 2.5 m/s³, against limits of 60 and more; a motion law's jerk comes 20 ms late.
"""


class EstimateFlag(IntFlag):
    """What limits an estimate; the values of SloshEstimate.msg."""

    NONE = 0
    PLANARITY_LOST = 1
    ACCELERATION_LIMIT = 2
    JERK_LIMIT = 4
    ABOVE_RIM = 8
    SETTLING = 16
    AFTER_GAP = 32
    DIVERGED = 64


class ValidityWatch:
    """Compares acceleration, jerk and height with a model's limits (DL22, §4.2)."""

    def __init__(self, model: Model) -> None:
        self._limits = model.limits
        freeboard = model.container.freeboard
        self._freeboard = math.inf if freeboard is None else freeboard
        self._slow = (0.0, 0.0, 0.0)
        self._stamp_ns = 0

    def update(self, sample: Sample, height: float) -> tuple[int, float]:
        """Flags and jerk [m/s³] of a sample.

        Args:
            sample: the input.
            height: the estimated maximum height [m].
        """
        ax, ay, az = sample.ax, sample.ay, sample.az
        if sample.restarted:
            self._slow = (ax, ay, az)
        dt = 0.0 if sample.restarted else (sample.stamp_ns - self._stamp_ns) * SECONDS
        self._stamp_ns = sample.stamp_ns
        sx, sy, sz = self._slow
        dx, dy, dz = ax - sx, ay - sy, az - sz
        inverse = 1.0 / (JERK_FILTER + dt)
        blend = dt * inverse
        self._slow = (sx + blend * dx, sy + blend * dy, sz + blend * dz)
        jerk = math.sqrt(dx * dx + dy * dy + dz * dz) * inverse
        return self._flags(math.sqrt(ax * ax + ay * ay + az * az), jerk, height), jerk

    def _flags(self, acceleration: float, jerk: float, height: float) -> int:
        # Plain integers: combining IntFlag members costs microseconds.
        limits = self._limits
        flags = 0
        if acceleration > limits.planar_acceleration or jerk > limits.planar_jerk:
            flags |= 1
        if acceleration > limits.acceleration:
            flags |= 2
        if jerk > limits.jerk:
            flags |= 4
        if height > self._freeboard:
            flags |= 8
        return flags
