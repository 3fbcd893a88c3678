"""Finds the mounting, gravity sign and handedness that best explain a sensor."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_motion.mounting.rotations import nearest, rotation_vector
from slosh_motion.mounting.tuning import TUNING

RATIO = TUNING.independent / TUNING.step
"""Rows of which one is independent."""
_GRAVITIES = (1.0, 0.0, -1.0)
_TURNS = 30


class Side(NamedTuple):
    """Sensor readings s, container accelerations a, reactions u to gravity, (N, 3) [m/s²]."""

    s: Array
    a: Array
    u: Array


class Answer(NamedTuple):
    """A tested hypothesis on the mounting of a sensor, with its error and prior odds.

    Attributes:
        rotation, gain, gravity: M, k and h.
        error: mean square of a row's error, a constant one left out.
        bias: square of that constant error.
        odds: logarithm of what speaks for it before a motion.
    """

    rotation: Array
    gain: float
    gravity: float
    error: float
    bias: float
    odds: float


def best_hypothesis(side: Side, told: Array) -> Answer:
    """Returns the most probable hypothesis on the mounting."""
    found = [_solved(side, told, start, handed) for handed in (1.0, -1.0) for start in _GRAVITIES]
    best = min(found, key=lambda answer: answer.error)
    variance = variance_of(side, best)
    independent = len(side.s) / RATIO
    of_bias = (TUNING.bias * size_of(best)) ** 2 + variance / independent

    def odds(answer: Answer) -> float:
        error = independent * answer.error / variance + answer.bias / of_bias
        return answer.odds - 0.5 * error

    return max(found, key=odds)


def size_of(answer: Answer) -> float:
    """Returns the sensor's reading per 1 m/s², from the motion or else from gravity."""
    return max(answer.gain, abs(answer.gravity), 1e-9)


def variance_of(side: Side, answer: Answer) -> float:
    """Returns the variance of one component of the sensor's error [its unit squared]."""
    return answer.error / 3.0 + least_variance(side, answer)


def least_variance(side: Side, answer: Answer) -> float:
    """Returns the smallest variance that is assumed for the sensor's error [its unit squared]."""
    a = side.a - side.a.mean(axis=0)
    floor = TUNING.noise + TUNING.share * math.sqrt(float(np.mean(np.sum(a * a, axis=1))))
    return (floor * size_of(answer)) ** 2


def _solved(side: Side, told: Array, start: float, handed: float) -> Answer:
    """Fits mounting and gains, starting from a hypothesis."""
    s, a, u = side
    with_a, with_u, size = s.T @ a, s.T @ u, float(np.sum(s * s))
    own = np.array(
        [[np.sum(a * a), np.sum(a * u)], [np.sum(a * u), np.sum(u * u)]], dtype=np.float64
    )
    ridge = own + 1e-9 * np.trace(own) * np.eye(2)
    length = math.sqrt(size / max(own[0, 0] + abs(start) * own[1, 1], 1e-12))
    gains = np.array([length, start * length])
    floor = TUNING.noise + TUNING.share * math.sqrt(float(own[0, 0]) / len(s))
    rotation, whole, missed = told, 0.0, 0.0
    for _ in range(2):  # as if all were explained, then by what is not
        for _ in range(_TURNS):
            scale = max(float(np.abs(gains).max()), 1e-9)
            trust = (missed / 3.0 + (floor * scale) ** 2) * RATIO / TUNING.doubt**2
            rotation = nearest(gains[0] * with_a + gains[1] * with_u + trust * told, handed)
            right = np.array([np.sum(rotation * with_a), np.sum(rotation * with_u)])
            before, gains = gains, np.linalg.solve(ridge, right)
            if gains[0] < 0.0:
                gains = np.array([0.0, right[1] / ridge[1, 1]])
            if float(np.abs(gains - before).max()) <= 1e-9 * scale:
                break
        whole = max(size - float(gains @ (2.0 * right - own @ gains)), 0.0) / len(s)
        missed = whole
    constant = s.mean(axis=0) - rotation @ (gains[0] * a.mean(axis=0) + gains[1] * u.mean(axis=0))
    bias = float(constant @ constant)
    away = rotation_vector(told.T @ (rotation if handed > 0 else unmirrored(rotation, told)))
    odds = -0.5 * float(away @ away) / TUNING.doubt**2
    odds -= (handed < 0) * TUNING.handed + (gains[1] < -0.5 * gains[0]) * TUNING.reversed_gravity
    return Answer(
        rotation, float(gains[0]), float(gains[1]), max(whole - bias, 0.0), bias, odds
    )  # fmt: skip


def unmirrored(rotation: Array, told: Array) -> Array:
    """Reverses that axis of a mirrored mounting which leaves the smallest rotation.

    Args:
        rotation: (3, 3) of determinant -1, sensor ← container.
        told: (3, 3) as it was told.
    """
    flips = [np.diag([-1.0 if axis == one else 1.0 for axis in range(3)]) for one in range(3)]
    return max((flip @ rotation for flip in flips), key=lambda m: float(np.sum(m * told)))
