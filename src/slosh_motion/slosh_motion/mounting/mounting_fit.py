"""Fits the mounting, scale and delay of a sensor to a motion known from another source.

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
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array, BoolArray
from slosh_motion.mounting.columns import (
    ACCELERATION,
    ARM,
    RATE,
    UP,
    Aligned,
    nearest,
    rotation_vector,
)
from slosh_motion.mounting.refinement import (
    GAIN,
    GRAVITY_GAIN,
    LAG,
    PLACE,
    RATIO,
    TURN,
    Answer,
    Problem,
    Rates,
    Side,
    Solution,
    best_hypothesis,
    least_variance,
    refined,
    variance_of,
)
from slosh_motion.mounting.tuning import TUNING

FEWEST = 20
"""Rows of both sides that say something."""
_EACH = 2


class TurnFit(NamedTuple):
    """Unit and mounting that the angular velocities of a gyroscope indicate.

    Attributes:
        gain: its unit in rad/s.
        agrees: whether its axes are those of the forces.
        rotation: (3, 3) sensor ← container by the rates alone.
    """

    gain: float
    agrees: bool
    rotation: Array


class MountingFit(NamedTuple):
    """The fitted mounting of a sensor.

    Attributes:
        rotation: (3, 3) sensor ← container; determinant -1: an axis is mirrored.
        covariance: (3, 3) of the small turn by which it may be off, in the container's axes
            [rad²].
        gain_error, gravity_error: their standard errors.
        lag, lag_error: by which the sensor is late [s].
        arm, arm_error: (3,) place of the sensor in the container [m]; NaN: not seen.
        explained: part of the motion that the fit explains, of the accelerations.
        clear: part of the motion's accelerations that is no noise, at least.
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
    clear: float
    turn: TurnFit | None
    seconds: float


def fit_mounting(both: Aligned, told: Array, arm: Array) -> MountingFit | None:
    """Fits the mounting of a sensor to a motion, or returns None with too little data.

    Args:
        told: (3, 3) sensor ← container, as it was told.
        arm: (3,) place of the sensor in the container, as it was told [m].

    Returns:
        None: too little of both is known.
    """
    lag = coarse_lag(both)
    if lag is None:
        return None
    rows = known_rows(both, lag)
    s, w = shifted(both, lag, rows)
    before, behind = (shifted(both, lag + k * TUNING.step, rows) for k in (-1, 1))
    slopes = [0.5 * (b - a) / TUNING.step for a, b in zip(before, behind, strict=True)]
    motion = both.motion[rows]
    beyond = motion[:, ARM].reshape(-1, 3, 3) @ arm
    side = Side(s, motion[:, ACCELERATION] + beyond, motion[:, UP])
    best = best_hypothesis(side, told)
    turns = math.sqrt(float(np.mean(np.sum(motion[:, RATE] ** 2, axis=1)))) > TUNING.least_turn
    known = np.isfinite(w).all(axis=1)
    heard = turns and np.count_nonzero(known) > max(FEWEST, 0.5 * len(w))
    rates = Rates.of(w[known], slopes[1][known], motion[known, RATE]) if heard else None
    variances = variance_of(side, best) * RATIO, least_variance(side, best) * RATIO
    problem = Problem(s, slopes[0], motion, arm, *variances)
    turn, fine = _with_rates(problem, best, rates, told)
    at, errors = fine.at, np.sqrt(np.maximum(np.diag(fine.covariance), 0.0))
    seen = turns and bool(motion[:, ARM].any())
    explained = _explained(side, fine)
    moved = motion[:, ACCELERATION] - motion[:, ACCELERATION].mean(axis=0)
    covariance = _without_noise(fine.covariance[TURN, TURN], fine, problem)
    clear = 1.0 - both.noise / max(float(np.mean(np.sum(moved * moved, axis=1))), 1e-12)
    return MountingFit(
        at.rotation, covariance, at.gain, at.gravity, float(errors[GAIN]),
        float(errors[GRAVITY_GAIN]), lag + at.lag, float(errors[LAG]), at.place,
        errors[PLACE] if seen else np.full(3, np.nan), explained, clear, turn,
        len(s) * TUNING.step,
    )  # fmt: skip


def _without_noise(covariance: Array, fine: Solution, problem: Problem) -> Array:
    """Returns the rotation's covariance (3, 3), corrected for information that is only noise.

    Such noise looks like information about turns, in all directions alike.
    """
    none = 2.0 / 3.0 * fine.error * len(problem.s) / problem.variance
    values, axes = np.linalg.eigh(np.linalg.inv(covariance))
    left = np.maximum(values - none, 1.0 / TUNING.doubt**2)
    found: Array = (axes / left) @ axes.T
    return found


def best_fit(widths: Sequence[Aligned], told: Array, arm: Array) -> MountingFit | None:
    """Returns the least smoothed fit that explains the motion, or else the fit that does best.

    Args:
        widths: both sides, by the width of the smoothing.
        told, arm: see `fit_mounting`.
    """
    best: MountingFit | None = None
    for both in widths:
        found = fit_mounting(both, told, arm)
        if found is None:
            continue
        if best is None or _worth(found) > _worth(best):
            best = found
        if found.explained >= TUNING.enough:
            break
    return best


def _worth(fit: MountingFit) -> tuple[bool, float]:
    return fit.clear >= TUNING.clear, fit.explained


def _explained(side: Side, fine: Solution) -> float:
    """Returns the fraction of the motion, without gravity, that the fit explains."""
    still = side.s - fine.at.gravity * side.u @ fine.at.rotation.T
    constant = side.s - side.s.mean(axis=0)
    moved = min(float(np.sum(constant * constant)), float(np.sum(still * still)))
    return 1.0 - fine.error * len(side.s) / moved if moved > 0.0 else 0.0


def _with_rates(
    problem: Problem, best: Answer, rates: Rates | None, told: Array
) -> tuple[TurnFit | None, Solution]:
    """Returns the solution that also uses angular velocities, if they fit the accelerations."""
    alone = refined(problem, best, None)
    if rates is None:
        return None, alone
    if rates.gain <= 0.0:
        return TurnFit(0.0, True, alone.at.rotation), alone
    with_rate = rates.heard.T @ rates.true / (TUNING.turn_noise**2 * RATIO)
    predicted = best.gain * problem.motion[:, ACCELERATION] + best.gravity * problem.motion[:, UP]
    with_force = problem.s.T @ predicted / problem.variance
    handed = float(np.sign(np.linalg.det(best.rotation)))
    start = nearest(with_force + with_rate + told / TUNING.doubt**2, handed)
    both = refined(problem, best._replace(rotation=start), rates)
    worse = 0.5 * (both.error - alone.error) * len(problem.s) / problem.variance
    away = float(np.linalg.norm(rotation_vector(alone.at.rotation.T @ both.at.rotation)))
    if both.left < 1.0 - TUNING.explained and (worse < TUNING.handed or away < TUNING.turned):
        return TurnFit(rates.gain, True, both.at.rotation), both
    own = max(
        (nearest(with_rate + alone.at.rotation / TUNING.doubt**2, one) for one in (1.0, -1.0)),
        key=lambda m: float(np.sum(m * with_rate)) - TUNING.handed * (np.linalg.det(m) < 0.0),
    )
    return TurnFit(rates.gain, False, own), alone


def _first_row(both: Aligned, lag: float) -> tuple[int, float]:
    """Returns integer and fractional index of the sensor's sample at the motion's first sample."""
    shift = lag / TUNING.step + both.lags
    first = min(max(math.floor(shift), 0), 2 * both.lags - 1)
    return first, shift - first


def known_rows(both: Aligned, lag: float) -> BoolArray:
    """Returns a mask of the times at which sensor and motion have samples, for a delay [s]."""
    first, _ = _first_row(both, lag)
    count = len(both.used)
    rows: BoolArray = both.used.copy()
    for shift in range(max(first - 1, 0), min(first + 3, 2 * both.lags + 1)):
        rows &= both.known[shift : shift + count]
    return rows


def shifted(both: Aligned, lag: float, rows: BoolArray) -> tuple[Array, Array]:
    """Returns a sensor's force and angular velocity at given samples, corrected by a delay [s]."""
    first, share = _first_row(both, lag)
    count = len(both.used)
    force, rate = (
        (1.0 - share) * values[first : first + count][rows]
        + share * values[first + 1 : first + 1 + count][rows]
        for values in (both.force, both.rate)
    )
    return force, rate


def coarse_lag(both: Aligned) -> float | None:
    """Returns the delay of the sensor [s], or None with too little data.

    Without the mounting: the singular values of the correlation say how much of the sensor any
    rotation could explain, with gravity and without.
    """
    # Neighbours say nearly the same: both sides are smoothed.
    used, motion = both.used[::_EACH], both.motion[::_EACH]
    count = len(both.used)
    errors = np.full(2 * both.lags + 1, np.inf)
    for shift in range(len(errors)):
        rows = used & both.known[shift : shift + count : _EACH]
        if np.count_nonzero(rows) < FEWEST:
            continue
        s = both.force[shift : shift + count : _EACH][rows]
        a, u = motion[rows, ACCELERATION], motion[rows, UP]
        errors[shift] = min(_unexplained(s, a), _unexplained(s, a + u))
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
    """Returns the mean square residual of s (N, 3) fitted by vectors v, rotated and scaled."""
    s, v = s - s.mean(axis=0), v - v.mean(axis=0)
    size = float(np.sum(v * v))
    whole = float(np.sum(s * s))
    if size <= 0.0:
        return whole / len(s)
    turned = float(np.linalg.svd(s.T @ v, compute_uv=False).sum())
    return (whole - turned * turned / size) / len(s)
