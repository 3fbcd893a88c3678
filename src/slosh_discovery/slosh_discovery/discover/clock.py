"""Estimates initial values of unknown clock offsets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.fitting import Evaluator, Fit
from slosh_discovery.discover.problem import PreparedMotion
from slosh_discovery.discover.tuning import TUNING
from slosh_model.model import Model


def first_offset(one: PreparedMotion, base: Model) -> float:
    """Returns the clock offset [s] that best correlates measured and modelled heights.

    Expected are the heights of the model's three-dimensional nonlinear twin in the container's
    attitude: a motion looks much the same in every model, and most in the fullest. Alike is what
    correlates, whatever the heights' scale and zero.
    """
    if one.motion.same_clock:
        return 0.0
    full = base.spatial().nonlinear()
    full = full if one.azimuths is not None else full.with_gravity_tilt()
    answer = one.simulate(full) or one.simulate(base)
    if answer is None:
        return float(one.t[0] - one.fine.t[0])
    expected_t = np.arange(one.fine.t[0], one.fine.t[-1], TUNING.clock_step)
    measured_t = np.arange(one.t[0], one.t[-1], TUNING.clock_step)
    expected = _series(expected_t, one.fine.t, answer.at(one.fine.t, -answer.clock.offset))
    measured = _series(measured_t, one.t, one.heights)
    lag = _best_lag(measured, expected)
    return float(measured_t[0] - expected_t[0] + lag * TUNING.clock_step)


def slipped_offsets(one: Fit, motions: Sequence[PreparedMotion]) -> list[float] | None:
    """Returns clock offsets [s] that fit better than the fit's own, or None if none fit better.

    Heights that sway make many offsets look nearly right, one each half period. With the fitted
    explanation all of them are tried; None: the fit's own are the best.
    """
    found, better = list(one.clock_offsets), False
    for index, motion in enumerate(motions):
        if motion.motion.same_clock:
            continue
        answer = motion.simulate(one.model_of(motion.motion.group))
        if answer is None:
            continue
        tried = found[index] + np.arange(-TUNING.clock_slip, TUNING.clock_slip, TUNING.clock_step)
        costs = [float(np.sum(Evaluator.part(motion, answer, o) ** 2)) for o in tried.tolist()]
        here = float(np.sum(Evaluator.part(motion, answer, found[index]) ** 2))
        best = int(np.argmin(costs))
        if (
            costs[best] < TUNING.clock_better * here
            and abs(tried[best] - found[index]) > 2.0 * TUNING.clock_step
        ):
            found[index], better = float(tried[best]), True
    return found if better else None


def _series(grid: Array, t: Array, heights: Array) -> Array:
    """Resamples heights to uniformly spaced times, one column per azimuth."""
    columns = []
    for column in heights.T:
        present = np.isfinite(column)
        if not present.any():
            columns.append(np.zeros(len(grid)))
            continue
        columns.append(np.interp(grid, t[present], column[present]))
    return np.column_stack(columns)


def _best_lag(measured: Array, expected: Array) -> int:
    """Returns the lag [samples] at which two series correlate best."""
    shorter = min(len(measured), len(expected))
    least = max(int(TUNING.clock_overlap * shorter), 2)
    best, best_likeness = 0, -np.inf
    for lag in range(least - len(expected), len(measured) - least + 1):
        first = max(lag, 0)
        last = min(len(measured), lag + len(expected))
        one = measured[first:last]
        other = expected[first - lag : last - lag]
        centred = other - other.mean(axis=0)
        # The part of the measured series' power that the shifted one explains.
        size = float(np.sum(centred * centred))
        covariance = float(np.sum(centred * (one - one.mean(axis=0))))
        likeness = covariance * abs(covariance) / size if size > 0.0 else -np.inf
        if likeness > best_likeness:
            best, best_likeness = lag, likeness
    return best
