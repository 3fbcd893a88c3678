"""Finds the delay of a sensor relative to a motion, whatever its mounting is."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.types import Array, BoolArray
from slosh_metrics.mounting.columns import ACCELERATION, UP, Aligned
from slosh_metrics.mounting.tuning import TUNING

FEWEST = 20
"""Rows of both sides that say something."""
_EACH = 2


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
