"""Finds the mounting that best explains a sensor, and refines all unknowns by Gauss-Newton.

In the container's axes the reading is y = Mᵀ s; a turn of M by a small θ changes it by y × θ.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_motion.mounting.columns import (
    ACCELERATION,
    ARM,
    UP,
    crosses,
    exponential,
    nearest,
    rotation_vector,
)
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


TURN, GAIN, GRAVITY_GAIN, PLACE, BIAS = slice(0, 3), 3, 4, slice(5, 8), slice(8, 11)
LAG, DRIFT, UNKNOWNS = 11, slice(12, 15), 15
"""Places of the unknowns."""
_STEPS = 12


class Rates(NamedTuple):
    """Measured and true angular velocities (N, 3); derivative and unit of the measured ones."""

    heard: Array
    slope: Array
    true: Array
    gain: float

    @classmethod
    def of(cls, heard: Array, slope: Array, true: Array) -> Rates:
        """Estimates the gyroscope's unit by the magnitudes, which no rotation changes."""
        gain = math.sqrt(float(np.sum(heard * heard)) / float(np.sum(true * true)))
        scale = 1.0 / gain if gain > 0.0 else 1.0
        return cls(heard * scale, slope * scale, true, gain)


class Problem(NamedTuple):
    """Data and prior knowledge from which a mounting is fitted.

    Attributes:
        s: (N, 3) readings.
        slope: (N, 3) by which they change in time.
        motion: (N, COLUMNS).
        arm: place of the sensor as it was told [m].
    """

    s: Array
    slope: Array
    motion: Array
    arm: Array
    variance: float
    least: float


class Unknowns(NamedTuple):
    """Unknowns of the mounting fit: rotation, gains, position, biases and delay [s]."""

    rotation: Array
    gain: float
    gravity: float
    place: Array
    bias: Array
    lag: float
    drift: Array

    def moved(self, step: Array) -> Unknowns:
        """Returns the unknowns plus an increment (UNKNOWNS,); keeps |delay| ≤ one sample step."""
        lag = min(max(self.lag + float(step[LAG]), -TUNING.step), TUNING.step)
        return Unknowns(
            self.rotation @ exponential(step[TURN]), self.gain + float(step[GAIN]),
            self.gravity + float(step[GRAVITY_GAIN]), self.place + step[PLACE],
            self.bias + step[BIAS], lag, self.drift + step[DRIFT],
        )  # fmt: skip


class Solution(NamedTuple):
    """The fitted unknowns with their covariance.

    Attributes:
        covariance: (UNKNOWNS, UNKNOWNS).
        error: mean square of a reading's error.
        left: part of the angular velocities that is not explained.
    """

    at: Unknowns
    covariance: Array
    error: float
    left: float


def refined(problem: Problem, start: Answer, rates: Rates | None) -> Solution:
    """Returns the solution of the mounting fit near a hypothesis.

    Args:
        rates: that are fitted, too; None: none.
    """
    at = Unknowns(
        start.rotation, start.gain, start.gravity, problem.arm, np.zeros(3), 0.0, np.zeros(3)
    )
    prior = _prior(size_of(start))
    for _ in range(_STEPS):
        rows = [_forces(problem, at), *([_turns(rates, at)] if rates is not None else [])]
        data = sum((slope.T @ slope for _, slope in rows), np.zeros((UNKNOWNS, UNKNOWNS)))
        gradient = sum((slope.T @ left for left, slope in rows), np.zeros(UNKNOWNS))
        matrix = data + np.diag(prior + 1e-12 * np.trace(data))
        away = np.concatenate([np.zeros(5), at.place - problem.arm, at.bias, [0.0], at.drift])
        step = np.linalg.solve(matrix, gradient - prior * away)
        at = at.moved(step)
        if float(np.abs(step).max()) < 1e-7:
            break
    # Errors of readings are not independent: their own spread tells, and the least one.
    spread = sum((_spread(left, slope) for left, slope in rows), np.diag(prior))
    forces = rows[0][1]
    inverse = np.linalg.inv(matrix)
    least = problem.least / problem.variance * forces.T @ forces
    covariance = inverse @ (spread + least) @ inverse
    left = [float(np.sum(one * one)) for one, _ in rows]
    missed = 0.0
    if rates is not None:
        missed = left[1] * _turn_variance() / float(np.sum(rates.heard * rates.heard))
    return Solution(at, covariance, left[0] * problem.variance / len(problem.s), missed)


def _turn_variance() -> float:
    return TUNING.turn_noise**2 * RATIO


def _prior(size: float) -> Array:
    """Returns the inverse of each unknown's prior variance (UNKNOWNS,)."""
    prior = np.zeros(UNKNOWNS)
    prior[TURN], prior[PLACE] = 1.0 / TUNING.doubt**2, 1.0 / TUNING.arm**2
    prior[BIAS], prior[DRIFT] = 1.0 / (TUNING.bias * size) ** 2, 1.0 / TUNING.drift**2
    return prior


def _forces(problem: Problem, at: Unknowns) -> tuple[Array, Array]:
    """Returns the normalised errors (3 N,) of the readings and their derivatives."""
    lever = problem.motion[:, ARM].reshape(-1, 3, 3)
    y = (problem.s + at.lag * problem.slope) @ at.rotation
    a, u = problem.motion[:, ACCELERATION] + lever @ at.place, problem.motion[:, UP]
    slope = np.zeros((len(y), 3, UNKNOWNS))
    slope[:, :, TURN], slope[:, :, GAIN], slope[:, :, GRAVITY_GAIN] = -crosses(y), a, u
    slope[:, :, PLACE], slope[:, :, BIAS] = at.gain * lever, np.eye(3)
    slope[:, :, LAG] = -problem.slope @ at.rotation
    left = y - at.gain * a - at.gravity * u - at.bias
    weight = 1.0 / math.sqrt(problem.variance)
    return weight * left.reshape(-1), weight * slope.reshape(-1, UNKNOWNS)


def _turns(rates: Rates, at: Unknowns) -> tuple[Array, Array]:
    """Returns the normalised errors (3 N,) of the angular velocities and their derivatives."""
    z = (rates.heard + at.lag * rates.slope) @ at.rotation
    slope = np.zeros((len(z), 3, UNKNOWNS))
    slope[:, :, TURN], slope[:, :, DRIFT] = -crosses(z), np.eye(3)
    slope[:, :, LAG] = -rates.slope @ at.rotation
    weight = 1.0 / math.sqrt(_turn_variance())
    left = z - at.drift - rates.true
    return weight * left.reshape(-1), weight * slope.reshape(-1, UNKNOWNS)


def _spread(left: Array, slope: Array) -> Array:
    """Returns the gradient's covariance from its sums over blocks of readings."""
    size = 3 * max(round(TUNING.block / TUNING.step), 1)
    sums = np.add.reduceat(left[:, None] * slope, np.arange(0, len(left), size), axis=0)
    factor = len(sums) / max(len(sums) - 3, 1)
    found: Array = factor * sums.T @ sums
    return found
