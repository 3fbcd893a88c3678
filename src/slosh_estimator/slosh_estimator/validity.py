"""Flags that say where an estimate is not to be trusted; values as in slosh_msgs/SloshEstimate."""

from __future__ import annotations

import math

from slosh_model.model import ValidityLimits

PLANARITY_LOST = 1
ACCELERATION_LIMIT = 2
JERK_LIMIT = 4
ABOVE_RIM = 8
SETTLING = 16
AFTER_GAP = 32
DIVERGED = 64

NAMES = {
    PLANARITY_LOST: "planarity lost",
    ACCELERATION_LIMIT: "acceleration limit",
    JERK_LIMIT: "jerk limit",
    ABOVE_RIM: "above the rim",
    SETTLING: "settling",
    AFTER_GAP: "after a gap",
    DIVERGED: "diverged",
}

JERK_TIME_CONSTANT = 0.008
"""Of each of the filter's two stages [s]."""


class JerkFilter:
    """Jerk as the derivative of the acceleration behind two equal first-order low-passes.

    White noise of standard deviation s at the rate F becomes s / √(4 F τ³) of jerk per axis: with
    τ = 8 ms, 0.05 m/s² at 1 kHz become 1.1 m/s³ (a plain difference would give 71). The answer is
    2 τ late.

    Args:
        time_constant: τ [s].
    """

    __slots__ = ("_a", "_b", "_started", "_tau")

    def __init__(self, time_constant: float = JERK_TIME_CONSTANT) -> None:
        self._tau = time_constant
        self.reset()

    def reset(self) -> None:
        """The next sample is a first one."""
        self._a = self._b = (0.0, 0.0, 0.0)
        self._started = False

    def update(self, dt: float, ax: float, ay: float, az: float) -> float:
        """Takes an acceleration [m/s²] dt [s] after the one before; ‖jerk‖ [m/s³], NaN at first."""
        if not self._started:
            self._a = self._b = (ax, ay, az)
            self._started = True
            return math.nan
        k = 1.0 - math.exp(-dt / self._tau)
        x, y, z = self._a
        x, y, z = x + k * (ax - x), y + k * (ay - y), z + k * (az - z)
        u, v, w = self._b
        # The derivative of the second stage over this step, exact for a held input.
        rate = k / dt
        dx, dy, dz = x - u, y - v, z - w
        self._a, self._b = (x, y, z), (u + k * dx, v + k * dy, w + k * dz)
        return rate * math.sqrt(dx * dx + dy * dy + dz * dz)


def regime_flags(
    limits: ValidityLimits,
    acceleration: float,
    jerk: float,
    height: float,
    freeboard: float | None,
) -> int:
    """Flags of the regime (DL22, §4.2).

    Args:
        limits: the model's limits.
        acceleration: ‖a‖ [m/s²].
        jerk: ‖jerk‖ [m/s³]; NaN: unknown, raises nothing.
        height: the higher of the models' heights [m]: a spill is told too early rather than late.
        freeboard: height of the rim above the still level [m]; None: unknown.
    """
    flags = 0
    if acceleration > limits.planar_acceleration or jerk > limits.planar_jerk:
        flags |= PLANARITY_LOST
    if acceleration > limits.acceleration:
        flags |= ACCELERATION_LIMIT
    if jerk > limits.jerk:
        flags |= JERK_LIMIT
    if freeboard is not None and height > freeboard:
        flags |= ABOVE_RIM
    return flags
