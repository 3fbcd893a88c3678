"""Finds an initial natural frequency for a fit.

A wave of a slightly wrong frequency falls out of step within a long record, and the sum of squares
has a valley at each step. So frequencies around the model's are tried before the fit, each with
dampings like the model's and larger ones, as that of a formula may be far too small.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from slosh_base.types import Array
from slosh_discovery.identify.problem import Problem
from slosh_discovery.identify.trials import Trial
from slosh_discovery.identify.tuning import TUNING
from slosh_model.parameters import DAMPING, FREQUENCY

DAMPINGS = (1.0, 3.0, 8.0)
"""In units of the model's."""


def scanned_start(problem: Problem) -> Array:
    """Returns initial parameters (P,) with the best natural frequency and damping of a grid."""
    starts = problem.starts
    names = [parameter.name for parameter in problem.parameters]
    if FREQUENCY not in names:
        return starts
    place = names.index(FREQUENCY)
    reduced = replace(problem, trials=_distinct(problem))
    values = []
    for factor in DAMPINGS if DAMPING in names else (1.0,):
        for frequency in _grid(reduced, starts[place]):
            value = starts.copy()
            value[place] = frequency
            if DAMPING in names:
                value[names.index(DAMPING)] *= factor
            values.append(value)
    residuals = reduced.residuals([reduced.start(value) for value in values])
    # By sizes, not squares: outliers must not choose.
    costs = np.sum(np.abs(residuals), axis=0)
    best = int(np.argmin(costs))
    own = reduced.residuals([reduced.start(starts)])[:, 0]
    if costs[best] > TUNING.scan_better * float(np.sum(np.abs(own))):
        return starts
    found: Array = values[best]
    return found


def _distinct(problem: Problem) -> tuple[Trial, ...]:
    """Returns the longest motions, at most one for each operating point."""
    firsts = {trial.point: trial for trial in reversed(problem.trials)}
    longest = sorted(firsts.values(), key=lambda trial: -float(np.ptp(trial.prepared.t)))
    return tuple(longest[: TUNING.scan_trials])


def _grid(problem: Problem, middle: float) -> Array:
    model = problem.model
    damping = model.mode_constants()[0].damping_ratio
    record = max(float(np.ptp(trial.prepared.t)) for trial in problem.trials)
    remembered = min(record, 1.0 / max(damping * middle, 1e-6))
    count = math.ceil(math.log(TUNING.scan_span**2) * middle * remembered / TUNING.scan_phase)
    half = min(max(count, TUNING.scan_fewest), TUNING.scan_most) // 2
    grid: Array = middle * TUNING.scan_span ** (np.arange(-half, half + 1) / half)
    return grid
