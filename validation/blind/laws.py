"""Time laws of a robot's stroke from 0 to 1, at rest at both ends, in closed form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Law = Callable[[Array], tuple[Array, Array, Array]]
"""Place and its first two derivatives at stages in [0, 1]."""

RAMP = 0.12  # share of the stroke in which the trapezoid's acceleration rises


def quintic(stage: Array) -> tuple[Array, Array, Array]:
    """Evaluates 10 s³ − 15 s⁴ + 6 s⁵ and its derivatives; the acceleration is continuous."""
    s = stage
    place = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    speed = 30.0 * s**2 * (1.0 - s) ** 2
    acceleration = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
    return place, speed, acceleration


def cycloid(stage: Array) -> tuple[Array, Array, Array]:
    """Evaluates the law whose acceleration is one period of a sine, and its derivatives."""
    turn = 2.0 * np.pi * stage
    return stage - np.sin(turn) / (2.0 * np.pi), 1.0 - np.cos(turn), 2.0 * np.pi * np.sin(turn)


def trapezoid(stage: Array) -> tuple[Array, Array, Array]:
    """Evaluates a law with trapezoidal acceleration and deceleration, and its derivatives.

    Piecewise cubic: the sum of ramps of the acceleration, integrated twice.
    """
    cut = 0.38  # the stroke's share of speeding up, and of slowing down
    corners = np.array([0, RAMP, cut - RAMP, cut, 1 - cut, 1 - cut + RAMP, 1 - RAMP, 1])
    turns = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0])
    since = np.maximum(stage[..., np.newaxis] - corners, 0.0)
    acceleration = since @ turns
    speed = 0.5 * since**2 @ turns
    place = since**3 @ turns / 6.0
    whole = float(np.maximum(1.0 - corners, 0.0) ** 3 @ turns / 6.0)
    return place / whole, speed / whole, acceleration / whole


LAWS: tuple[Law, ...] = (quintic, cycloid, trapezoid)


def window(stage: Array, rise: float) -> tuple[Array, Array, Array]:
    """Evaluates a window that rises from 0 to 1 and falls again, and its derivatives."""
    total = [np.zeros_like(stage) for _ in range(3)]
    for sign, start in ((1.0, 0.0), (-1.0, 1.0 - rise)):
        part = np.clip((stage - start) / rise, 0.0, 1.0)
        for order, value in enumerate(quintic(part)):
            total[order] += sign * value / rise**order
    return total[0], total[1], total[2]


def stroke(t: Array, start: float, duration: float, law: Law) -> tuple[Array, Array, Array]:
    """Returns position, speed [1/s] and acceleration [1/s²] of a law with start and duration."""
    stage = np.clip((t - start) / duration, 0.0, 1.0)
    inside = (t > start) & (t < start + duration)
    place, speed, acceleration = law(stage)
    zero = np.zeros_like(place)
    return (
        place,
        np.where(inside, speed / duration, zero),
        np.where(inside, acceleration / duration**2, zero),
    )
