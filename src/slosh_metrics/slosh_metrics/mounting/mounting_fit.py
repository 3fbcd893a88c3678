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
from slosh_metrics.mounting.rotations import exponential, nearest, rotation_vector
from slosh_metrics.mounting.tuning import TUNING

_GRAVITIES = (1.0, 0.0, -1.0)
_TURNS = 30
_RATIO = TUNING.independent / TUNING.step
"""Rows of which one is independent."""
_FEWEST, _STEPS = 20, 12
_TURN, _PLACE, _BIAS, _LAG, _DRIFT = slice(0, 3), slice(5, 8), slice(8, 11), 11, slice(12, 15)
_UNKNOWNS = 15
"""Places of the unknowns; between them the gain and gravity's."""


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
        covariance: (3, 3) of the small turn by which it may be off, in the container's axes
            [rad²].
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
    rows = _known(both, found)
    s, w = _shifted(both, found, rows)
    before, behind = (_shifted(both, found + k * TUNING.step, rows) for k in (-1, 1))
    slopes = [0.5 * (b - a) / TUNING.step for a, b in zip(before, behind, strict=True)]
    motion = both.motion[rows]
    side = _Side(s, motion[:, ACCELERATION] + _at(motion, arm), motion[:, UP])
    best = _best(side, told)
    turns = math.sqrt(float(np.mean(np.sum(motion[:, RATE] ** 2, axis=1)))) > TUNING.least_turn
    known = np.isfinite(w).all(axis=1)
    heard = turns and np.count_nonzero(known) > max(_FEWEST, 0.5 * len(w))
    rates = _Rates.of(w[known], slopes[1][known], motion[known, RATE]) if heard else None
    problem = _Problem(s, slopes[0], motion, arm, _variance(side, best) * _RATIO)
    turn, fine = _with_rates(problem, best, rates, told)
    moved = min(
        float(np.sum((s - s.mean(axis=0)) ** 2)),
        float(np.sum((s - fine.gravity * side.u @ fine.rotation.T) ** 2)),
    )
    explained = 1.0 - fine.error * len(s) / moved if moved > 0.0 else 0.0
    errors = np.sqrt(np.maximum(np.diag(fine.covariance), 0.0))
    unseen = not turns or not motion[:, ARM].any()
    return MountingFit(
        fine.rotation, fine.covariance[_TURN, _TURN], fine.gain, fine.gravity, float(errors[3]),
        float(errors[4]), found + fine.lag, float(errors[_LAG]), fine.place,
        np.full(3, np.nan) if unseen else errors[_PLACE], explained, turn, len(s) * TUNING.step,
    )  # fmt: skip


def _at(motion: Array, place: Array) -> Array:
    """The acceleration (N, 3) of a place in the container, beyond its origin's [m/s²]."""
    moved: Array = motion[:, ARM].reshape(-1, 3, 3) @ place
    return moved


def _place_of(both: Aligned, lag: float) -> tuple[int, float]:
    """The sensor's row for the first one of the motion, and the share of the next one."""
    shift = lag / TUNING.step + both.lags
    first = min(max(math.floor(shift), 0), 2 * both.lags - 1)
    return first, shift - first


def _known(both: Aligned, lag: float) -> BoolArray:
    """Rows (N,) of the motion of which both sides are known, at a lag of the sensor [s]."""
    first, _ = _place_of(both, lag)
    count = len(both.used)
    rows: BoolArray = both.used.copy()
    for shift in range(max(first - 1, 0), min(first + 3, 2 * both.lags + 1)):
        rows &= both.known[shift : shift + count]
    return rows


def _shifted(both: Aligned, lag: float, rows: BoolArray) -> tuple[Array, Array]:
    """Force and rate of a sensor that is late by a lag [s], at some rows of the motion."""
    first, share = _place_of(both, lag)
    count = len(both.used)
    force, rate = (
        (1.0 - share) * values[first : first + count][rows]
        + share * values[first + 1 : first + 1 + count][rows]
        for values in (both.force, both.rate)
    )
    return force, rate


def _lag(both: Aligned) -> float | None:
    """By how much the sensor is late [s]; None: too little of both is known.

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
        return (best - both.lags) * TUNING.step
    left, middle, right = around.tolist()
    bend = left - 2.0 * middle + right
    offset = 0.5 * (left - right) / bend if bend > 0.0 else 0.0
    return (best - both.lags + offset) * TUNING.step


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
    found = [_solved(side, told, start, handed) for handed in (1.0, -1.0) for start in _GRAVITIES]
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


class _Rates(NamedTuple):
    """Angular velocities (N, 3): as heard, in rad/s by their gain, their slope, as they are."""

    heard: Array
    slope: Array
    true: Array
    gain: float

    @classmethod
    def of(cls, heard: Array, slope: Array, true: Array) -> _Rates:
        """Their gain is that of their sizes: no rotation changes it."""
        gain = math.sqrt(float(np.sum(heard * heard)) / float(np.sum(true * true)))
        scale = 1.0 / gain if gain > 0.0 else 1.0
        return cls(heard * scale, slope * scale, true, gain)


class _Problem(NamedTuple):
    """What is fitted: readings (N, 3), the motion (N, COLUMNS), and what is known before.

    Attributes:
        slope: (N, 3) by which readings change in time.
        arm: place of the sensor as it was told [m].
        variance: of a component of an independent reading.
    """

    s: Array
    slope: Array
    motion: Array
    arm: Array
    variance: float


class _Fine(NamedTuple):
    """The solution of a problem; `left`: part of the angular velocities that it does not explain.

    The covariance is that of the unknowns: turn, gain, gravity, place, bias, lag and drift.
    """

    rotation: Array
    gain: float
    gravity: float
    place: Array
    bias: Array
    lag: float
    covariance: Array
    error: float
    left: float


def _with_rates(
    problem: _Problem, best: _Answer, rates: _Rates | None, told: Array
) -> tuple[TurnFit | None, _Fine]:
    """The solution, with the angular velocities where they agree with the accelerations."""
    alone = _refined(problem, best, None)
    if rates is None:
        return None, alone
    if rates.gain <= 0.0:
        return TurnFit(0.0, True, alone.rotation), alone
    handed = float(np.sign(np.linalg.det(best.rotation)))
    noise = TUNING.turn_noise**2 * _RATIO
    with_rate = rates.heard.T @ rates.true / noise
    side = _Side(problem.s, problem.motion[:, ACCELERATION], problem.motion[:, UP])
    with_force = best.gain * side.s.T @ side.a + best.gravity * side.s.T @ side.u
    start = nearest(
        with_force / problem.variance + with_rate + told / TUNING.doubt**2, handed
    )  # fmt: skip
    both = _refined(problem, best._replace(rotation=start), rates)
    worse = 0.5 * (both.error - alone.error) * len(problem.s) / problem.variance
    away = float(np.linalg.norm(rotation_vector(alone.rotation.T @ both.rotation)))
    if both.left < 1.0 - TUNING.explained and (worse < TUNING.handed or away < TUNING.turned):
        return TurnFit(rates.gain, True, both.rotation), both
    own = max(
        (nearest(with_rate + alone.rotation / TUNING.doubt**2, one) for one in (1.0, -1.0)),
        key=lambda m: float(np.sum(m * with_rate)) - TUNING.handed * (np.linalg.det(m) < 0.0),
    )
    return TurnFit(rates.gain, False, own), alone


def _refined(problem: _Problem, start: _Answer, rates: _Rates | None) -> _Fine:
    """All unknowns together, by Gauss and Newton's method from a hypothesis on.

    In the container's axes the reading is y = Mᵀ s; a turn of M by a small θ changes it by y × θ.
    """
    s, change, motion, arm, variance = problem
    lever, u = motion[:, ARM].reshape(-1, 3, 3), motion[:, UP]
    rotation, place, bias, drift = start.rotation, arm.copy(), np.zeros(3), np.zeros(3)
    gain, gravity, lag = start.gain, start.gravity, 0.0
    prior = np.zeros(_UNKNOWNS)
    prior[_TURN], prior[_PLACE] = 1.0 / TUNING.doubt**2, 1.0 / TUNING.arm**2
    prior[_DRIFT] = 1.0 / TUNING.drift**2
    prior[_BIAS] = 1.0 / (TUNING.bias * _scale(start)) ** 2
    noise = TUNING.turn_noise**2 * _RATIO
    for _ in range(_STEPS):
        y = (s + lag * change) @ rotation
        a = motion[:, ACCELERATION] + lever @ place
        left = y - gain * a - gravity * u - bias
        slope = np.zeros((len(s), 3, _UNKNOWNS))
        slope[:, :, _TURN], slope[:, :, 3], slope[:, :, 4] = -crosses(y), a, u
        slope[:, :, _PLACE], slope[:, :, _BIAS] = gain * lever, np.eye(3)
        slope[:, :, _LAG] = -change @ rotation
        flat = slope.reshape(-1, _UNKNOWNS)
        data = flat.T @ flat / variance
        gradient = flat.T @ left.reshape(-1) / variance
        gradients = np.einsum("nij,ni->nj", slope, left) / variance
        if rates is not None:
            z = (rates.heard + lag * rates.slope) @ rotation
            bend = np.zeros((len(z), 3, _UNKNOWNS))
            bend[:, :, _TURN], bend[:, :, _LAG] = -crosses(z), -rates.slope @ rotation
            bend[:, :, _DRIFT] = np.eye(3)
            data += np.einsum("nij,nik->jk", bend, bend) / noise
            z = z - drift
            turned = np.einsum("nij,ni->nj", bend, z - rates.true) / noise
            gradient += turned.sum(axis=0)
        away = np.concatenate([np.zeros(5), place - arm, bias, [0.0], drift])
        step = np.linalg.solve(
            data + np.diag(prior + 1e-12 * np.trace(data)), gradient - prior * away
        )
        rotation = rotation @ exponential(step[_TURN])
        gain, gravity = gain + float(step[3]), gravity + float(step[4])
        place, bias, lag = place + step[_PLACE], bias + step[_BIAS], lag + float(step[_LAG])
        drift = drift + step[_DRIFT]
        lag = min(max(lag, -TUNING.step), TUNING.step)
        if float(np.abs(step).max()) < 1e-7:
            break
    spread = _spread(gradients) + data * (TUNING.noise * _scale(start)) ** 2 * _RATIO / variance
    missed = 0.0
    if rates is not None:
        spread += _spread(turned)
        missed = float(np.sum((z - rates.true) ** 2) / np.sum(z * z))
    inverse = np.linalg.inv(data + np.diag(prior + 1e-12 * np.trace(data)))
    covariance = inverse @ (spread + np.diag(prior)) @ inverse
    error = float(np.mean(np.sum(left * left, axis=1)))
    return _Fine(rotation, gain, gravity, place, bias, lag, covariance, error, missed)


def _spread(g: Array) -> Array:
    """The covariance of the sum of gradients (N, K), by sums over blocks."""
    size = max(round(TUNING.block / TUNING.step), 1)
    sums = np.add.reduceat(g, np.arange(0, len(g), size), axis=0)
    factor = len(sums) / max(len(sums) - 3, 1)
    found: Array = factor * sums.T @ sums
    return found
