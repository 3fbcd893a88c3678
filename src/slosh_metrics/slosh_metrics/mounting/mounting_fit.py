"""How a sensor is mounted, scaled and delayed, by a motion that another source tells.

    s(t + lag) = M (k (a + L p) + h u) + noise

with the sensor's reading s, the container's acceleration a and gravity's reaction u in the
container's axes, the place p of the sensor with L = [ω̇]× + [ω]×², an orthogonal M (sensor ←
container), the gain k and gravity's gain h. A sensor of specific force has k = h = 1; one of
accelerations without gravity k = 1, h = 0. M is found by the singular values of the correlation
of both sides (Kabsch 1976, Wahba 1965), k and h by least squares, in turns from each hypothesis:
gravity in, out or of the other sign, right-handed axes or mirrored ones. The first that explains
the sensor no worse than others is believed: each has a prior, and what the motion does not show
stays as it was told.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array, BoolArray
from slosh_metrics.mounting.columns import ACCELERATION, ARM, RATE, UP, Aligned, crosses
from slosh_metrics.mounting.rotations import nearest, rotation_vector
from slosh_metrics.mounting.tuning import TUNING

_GRAVITIES = (1.0, 0.0, -1.0)
_TURNS = 30
_RATIO = TUNING.independent / TUNING.step
"""Rows of which one is independent."""
_FEWEST = 20


class TurnFit(NamedTuple):
    """What a gyroscope's rates say.

    Attributes:
        gain: its unit in rad/s.
        agrees: whether its axes are those of the forces.
        rotation: (3, 3) sensor ← container by the rates alone.
    """

    gain: float
    agrees: bool
    rotation: Array


class MountingFit(NamedTuple):
    """How a sensor is mounted.

    Attributes:
        rotation: (3, 3) sensor ← container; determinant -1: an axis is mirrored.
        covariance: (3, 3) of the small turn by which it may be off, in the container's axes [rad²].
        gain, gravity: k and h.
        gain_error, gravity_error: their standard errors.
        lag, lag_error: by which the sensor is late [s].
        arm, arm_error: (3,) place of the sensor in the container [m]; NaN: not seen.
        explained: part of the motion that the fit explains, of the accelerations.
        turn: of the angular velocities; None: there are none, or the container hardly turned.
        seconds: of both sides [s].
    """

    rotation: Array
    covariance: Array
    gain: float
    gravity: float
    gain_error: float
    gravity_error: float
    lag: float
    lag_error: float
    arm: Array
    arm_error: Array
    explained: float
    turn: TurnFit | None
    seconds: float


class _Side(NamedTuple):
    """Rows of both sides: sensor, acceleration, gravity's reaction, all (N, 3)."""

    s: Array
    a: Array
    u: Array


class _Answer(NamedTuple):
    """A hypothesis.

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


def fit_mounting(both: Aligned, told: Array, arm: Array) -> MountingFit | None:
    """Compares a sensor with a motion.

    Args:
        both: sides.
        told: (3, 3) sensor ← container, as it was told.
        arm: (3,) place of the sensor in the container, as it was told [m].

    Returns:
        None: too little of both is known.
    """
    found = _lag(both)
    if found is None:
        return None
    lag, bend = found
    rows, s, w = _shifted(both, lag)
    motion = both.motion[rows]
    a, place, place_error = motion[:, ACCELERATION] + _at(motion, arm), arm, np.full(3, np.nan)
    best = _best(_Side(s, a, motion[:, UP]), told)
    turns = math.sqrt(float(np.mean(np.sum(motion[:, RATE] ** 2, axis=1)))) > TUNING.least_turn
    if turns and best.gain > 0.0 and motion[:, ARM].any():
        for _ in range(4):
            place, place_error = _place(motion, s, best, arm)
            a = motion[:, ACCELERATION] + _at(motion, place)
            best = _best(_Side(s, a, motion[:, UP]), told)
    side = _Side(s, a, motion[:, UP])
    turn, joint = _turn(side, best, told, w, motion[:, RATE]) if turns else (None, best)
    rates = motion[:, RATE] if turn is not None and turn.agrees and turn.gain > 0.0 else None
    covariance = _covariance(side, joint, w, rates, turn)
    gains = _gain_errors(side, joint)
    size = float(np.sum((s - np.mean(s, axis=0)) ** 2))
    moved = float(np.sum((s - joint.gravity * side.u @ joint.rotation.T) ** 2))
    moved = min(size, moved) if size > 0.0 else moved
    explained = 1.0 - joint.error * len(s) / moved if moved > 0.0 else 0.0
    variance = joint.error / 3.0
    lag_error = math.sqrt(2.0 * variance * _RATIO / (len(s) * bend)) if bend > 0.0 else math.inf
    return MountingFit(
        joint.rotation, covariance, joint.gain, joint.gravity, *gains, lag, lag_error, place,
        place_error, explained, turn, len(s) * TUNING.step,
    )  # fmt: skip


def _at(motion: Array, place: Array) -> Array:
    """The acceleration (N, 3) of a place in the container, beyond its origin's [m/s²]."""
    moved: Array = motion[:, ARM].reshape(-1, 3, 3) @ place
    return moved


def _shifted(both: Aligned, lag: float) -> tuple[BoolArray, Array, Array]:
    """Rows of the motion, and force and rate of a sensor that is late by a lag [s]."""
    shift = lag / TUNING.step + both.lags
    first = min(max(math.floor(shift), 0), 2 * both.lags - 1)
    share, count = shift - first, len(both.used)
    rows = both.used & both.known[first : first + count] & both.known[first + 1 :][:count]
    found = [
        (1.0 - share) * values[first : first + count][rows]
        + share * values[first + 1 : first + 1 + count][rows]
        for values in (both.force, both.rate)
    ]
    return rows, found[0], found[1]


def _lag(both: Aligned) -> tuple[float, float] | None:
    """By how much the sensor is late [s], and the curvature of the mean square error there.

    Without the mounting: the singular values of the correlation say how much of the sensor any
    rotation could explain, with gravity and without.
    """
    count = len(both.used)
    shifts = range(2 * both.lags + 1)
    errors = np.full(len(shifts), np.inf)
    for shift in shifts:
        rows = both.used & both.known[shift : shift + count]
        if np.count_nonzero(rows) < _FEWEST:
            continue
        s = both.force[shift : shift + count][rows]
        errors[shift] = min(
            _unexplained(s, both.motion[rows, ACCELERATION] + g * both.motion[rows, UP])
            for g in (0.0, 1.0)
        )
    best = int(np.argmin(errors))
    if not math.isfinite(errors[best]):
        return None
    around = errors[max(best - 1, 0) : best + 2]
    if len(around) < 3 or not np.isfinite(around).all():
        return (best - both.lags) * TUNING.step, 0.0
    left, middle, right = around.tolist()
    bend = left - 2.0 * middle + right
    offset = 0.5 * (left - right) / bend if bend > 0.0 else 0.0
    return (best - both.lags + offset) * TUNING.step, bend / TUNING.step**2


def _unexplained(s: Array, v: Array) -> float:
    """The mean square of readings (N, 3) that no rotation and gain of vectors (N, 3) explains."""
    s, v = s - s.mean(axis=0), v - v.mean(axis=0)
    size = float(np.sum(v * v))
    whole = float(np.sum(s * s))
    if size <= 0.0:
        return whole / len(s)
    turned = float(np.linalg.svd(s.T @ v, compute_uv=False).sum())
    return (whole - turned * turned / size) / len(s)


def _best(side: _Side, told: Array) -> _Answer:
    """The hypothesis that is believed."""
    found = [
        _solved(side, told, start, handed) for handed in (1.0, -1.0) for start in _GRAVITIES
    ]
    best = min(found, key=lambda answer: answer.error)
    variance = _variance(side, best)
    independent = len(side.s) / _RATIO
    of_bias = (TUNING.bias * _scale(best)) ** 2 + variance / independent

    def odds(answer: _Answer) -> float:
        error = independent * answer.error / variance + answer.bias / of_bias
        return answer.odds - 0.5 * error

    return max(found, key=odds)


def _scale(answer: _Answer) -> float:
    """How large 1 m/s² is in the sensor's unit, by the motion or by gravity."""
    return max(answer.gain, abs(answer.gravity), 1e-9)


def _variance(side: _Side, answer: _Answer) -> float:
    """The variance of one component of the sensor's error [(its unit)²]."""
    a = side.a - side.a.mean(axis=0)
    floor = TUNING.noise + TUNING.share * math.sqrt(float(np.mean(np.sum(a * a, axis=1))))
    return answer.error / 3.0 + (floor * _scale(answer)) ** 2


def _solved(side: _Side, told: Array, start: float, handed: float) -> _Answer:
    """The best mounting and gains from a hypothesis on."""
    s, a, u = side
    with_a, with_u, size = s.T @ a, s.T @ u, float(np.sum(s * s))
    own = np.array(
        [[np.sum(a * a), np.sum(a * u)], [np.sum(a * u), np.sum(u * u)]], dtype=np.float64
    )
    ridge = own + 1e-9 * np.trace(own) * np.eye(2)
    length = math.sqrt(size / max(own[0, 0] + abs(start) * own[1, 1], 1e-12))
    gains = np.array([length, start * length])
    floor = TUNING.noise + TUNING.share * math.sqrt(float(own[0, 0]) / len(s))
    scale, rotation = 1.0, told
    for _ in range(_TURNS):
        scale = max(float(np.abs(gains).max()), 1e-9)
        # A row's error is not known yet: the floor's weight on what was told is the largest.
        trust = (floor * scale) ** 2 * _RATIO / TUNING.doubt**2
        rotation = nearest(gains[0] * with_a + gains[1] * with_u + trust * told, handed)
        right = np.array([np.sum(rotation * with_a), np.sum(rotation * with_u)])
        new = np.linalg.solve(ridge, right)
        if new[0] < 0.0:
            new = np.array([0.0, right[1] / ridge[1, 1]])
        done = float(np.abs(new - gains).max()) <= 1e-9 * scale
        gains = new
        if done:
            break
    whole = max(size - float(gains @ (2.0 * right - own @ gains)), 0.0) / len(s)
    constant = s.mean(axis=0) - rotation @ (gains[0] * a.mean(axis=0) + gains[1] * u.mean(axis=0))
    bias = float(constant @ constant)
    away = rotation_vector(told.T @ (rotation if handed > 0 else unmirrored(rotation, told)))
    odds = -0.5 * float(away @ away) / TUNING.doubt**2
    odds -= (handed < 0) * TUNING.handed + (gains[1] < -0.5 * gains[0]) * TUNING.reversed_gravity
    return _Answer(
        rotation, float(gains[0]), float(gains[1]), max(whole - bias, 0.0), bias, odds
    )  # fmt: skip


def unmirrored(rotation: Array, told: Array) -> Array:
    """A mirrored mounting with one of the sensor's axes reversed, so that little is left to turn.

    Args:
        rotation: (3, 3) of determinant -1, sensor ← container.
        told: (3, 3) as it was told.
    """
    flips = [np.diag([-1.0 if axis == one else 1.0 for axis in range(3)]) for one in range(3)]
    return max((flip @ rotation for flip in flips), key=lambda m: float(np.sum(m * told)))


def _place(motion: Array, s: Array, best: _Answer, arm: Array) -> tuple[Array, Array]:
    """Where the sensor is [m], and the standard errors; what is not seen stays as told."""
    lever = motion[:, ARM].reshape(-1, 3, 3)
    left = s @ best.rotation / best.gain - motion[:, ACCELERATION]
    left -= best.gravity / best.gain * motion[:, UP] + lever @ arm
    rows, right = lever.reshape(-1, 3), left.reshape(-1)
    noise = (TUNING.noise**2 + best.error / 3.0 / best.gain**2) * _RATIO
    inverse = np.linalg.inv(rows.T @ rows / noise + np.eye(3) / TUNING.arm**2)
    found = arm + inverse @ (rows.T @ right) / noise
    return found, np.sqrt(np.diag(inverse))


def _turn(
    side: _Side, best: _Answer, told: Array, w: Array, rate: Array
) -> tuple[TurnFit | None, _Answer]:
    """What the rates say, and the hypothesis with them where they agree."""
    rows = np.isfinite(w).all(axis=1)
    if np.count_nonzero(rows) < max(_FEWEST, 0.5 * len(w)):
        return None, best
    heard, true = w[rows], rate[rows]
    gain = math.sqrt(float(np.sum(heard * heard)) / float(np.sum(true * true)))
    if gain <= 0.0:
        return TurnFit(0.0, True, best.rotation), best
    noise = (gain * TUNING.turn_noise) ** 2 * _RATIO + 1e-12
    with_rate = gain * heard.T @ true / noise
    variance = _variance(side, best) * _RATIO
    with_force = (best.gain * side.s.T @ side.a + best.gravity * side.s.T @ side.u) / variance
    handed = float(np.sign(np.linalg.det(best.rotation)))
    rotation = nearest(with_force + with_rate + told / TUNING.doubt**2, handed)
    left = float(np.sum((heard - gain * true @ rotation.T) ** 2) / np.sum(heard * heard))
    predicted = best.gain * side.a + best.gravity * side.u
    missed = side.s - predicted @ rotation.T
    error, constant = float(np.mean(np.sum(missed**2, axis=1))), missed.mean(axis=0)
    bias = float(constant @ constant)
    worse = 0.5 * (error - bias - best.error) * len(side.s) / variance
    away = float(np.linalg.norm(rotation_vector(best.rotation.T @ rotation)))
    agrees = left < 1.0 - TUNING.explained and (worse < TUNING.handed or away < TUNING.turned)
    if agrees:
        return TurnFit(gain, True, rotation), best._replace(
            rotation=rotation, error=error - bias, bias=bias
        )
    alone = max(
        (nearest(with_rate + best.rotation / TUNING.doubt**2, one) for one in (1.0, -1.0)),
        key=lambda m: float(np.sum(m * with_rate)) - TUNING.handed * (np.linalg.det(m) < 0.0),
    )
    return TurnFit(gain, False, alone), best


def _covariance(
    side: _Side, best: _Answer, w: Array, rate: Array | None, turn: TurnFit | None
) -> Array:
    """Of the small turn by which the rotation may be off, in the container's axes (3, 3) [rad²].

    The errors' own spread over blocks, because they are not independent; a bias; and the prior.
    """
    predicted = best.gain * side.a + best.gravity * side.u
    variance = _variance(side, best) * _RATIO
    turned = side.s @ best.rotation
    information = _information(predicted) / variance + np.eye(3) / TUNING.doubt**2
    spread = _spread(np.cross(predicted, turned - predicted) / variance)
    scale = _scale(best)
    # A bias b in the sensor's axes: how far it turns the fit.
    lean = crosses(np.sum(predicted, axis=0)[None])[0] / variance
    spread += (TUNING.bias * scale) ** 2 * lean @ lean.T
    spread += _information(predicted) / variance * (TUNING.noise * scale) ** 2 * _RATIO / variance
    if rate is not None and turn is not None:
        rows = np.isfinite(w).all(axis=1)
        true, heard = rate[rows], w[rows] @ best.rotation / turn.gain
        noise = TUNING.turn_noise**2 * _RATIO
        information += _information(true) / noise
        spread += _spread(np.cross(true, heard - true) / noise)
    inverse = np.linalg.inv(information)
    found: Array = inverse @ (spread + np.eye(3) / TUNING.doubt**2) @ inverse
    return found


def _information(v: Array) -> Array:
    """What vectors (N, 3) say of a turn: the sum of |v|² - v vᵀ."""
    found: Array = float(np.sum(v * v)) * np.eye(3) - v.T @ v
    return found


def _spread(g: Array) -> Array:
    """The covariance of the sum of gradients (N, 3), by sums over blocks."""
    size = max(round(TUNING.block / TUNING.step), 1)
    sums = np.add.reduceat(g, np.arange(0, len(g), size), axis=0)
    factor = len(sums) / max(len(sums) - 3, 1)
    found: Array = factor * sums.T @ sums
    return found


def _gain_errors(side: _Side, best: _Answer) -> tuple[float, float]:
    """Standard errors of gain and of gravity's."""
    variance = _variance(side, best) * _RATIO
    own = np.array([
        [np.sum(side.a * side.a), np.sum(side.a * side.u)],
        [np.sum(side.a * side.u), np.sum(side.u * side.u)],
    ])  # fmt: skip
    inverse = np.linalg.inv(own + 1e-9 * np.trace(own) * np.eye(2)) * variance
    errors = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    return float(errors[0]), float(errors[1])
