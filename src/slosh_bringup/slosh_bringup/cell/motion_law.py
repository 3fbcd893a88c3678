"""The modified trapezoidal motion law: from rest to rest with a continuous acceleration.

Six segments: the acceleration rises as a quarter sine, stays, falls through zero as a cosine (two
segments), stays, and returns to zero.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PEAK = 1.0 / (0.25 / math.pi + 0.125)
"""Largest second derivative for a unit stroke in unit time, 4.888."""
_K = 4.0 * math.pi
_BREAKS = (0.125, 0.375, 0.625, 0.875)


def modified_trapezoid(u: Array) -> tuple[Array, Array, Array]:
    """The law over the relative time.

    Args:
        u: (N,) relative time; before 0 and after 1 it rests.

    Returns:
        position 0 … 1, its first and its second derivative, (N,) each.
    """
    u = np.clip(u, 0.0, 1.0)
    # The law is point symmetric about (1/2, 1/2): compute the first half, mirror the second.
    mirrored = u > 0.5
    half = np.where(mirrored, 1.0 - u, u)
    position, velocity, acceleration = _first_half(half)
    return (
        np.where(mirrored, 1.0 - position, position),
        velocity,
        np.where(mirrored, -acceleration, acceleration),
    )


def _first_half(u: Array) -> tuple[Array, Array, Array]:
    b1, b2 = _BREAKS[:2]
    rise, fall = u < b1, u >= b2
    v1 = PEAK / _K
    v2 = v1 + PEAK * (b2 - b1)
    s1 = v1 * (b1 - 1.0 / _K)
    s2 = s1 + v1 * (b2 - b1) + 0.5 * PEAK * (b2 - b1) ** 2
    x, y = u - b1, u - b2
    acceleration = np.where(
        rise, PEAK * np.sin(_K * u), np.where(fall, PEAK * np.cos(_K * y), PEAK)
    )
    velocity = np.where(
        rise,
        v1 * (1.0 - np.cos(_K * u)),
        np.where(fall, v2 + v1 * np.sin(_K * y), v1 + PEAK * x),
    )
    position = np.where(
        rise,
        v1 * (u - np.sin(_K * u) / _K),
        np.where(
            fall,
            s2 + v2 * y + v1 / _K * (1.0 - np.cos(_K * y)),
            s1 + v1 * x + 0.5 * PEAK * x**2,
        ),
    )
    return position, velocity, acceleration
