"""Computes the error of modelled heights, and the fraction of it that another model removes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slosh_discovery.discover.finding import HeightGap, MotionFinding, Role
from slosh_discovery.discover.tuning import TUNING

NAN = float("nan")


def closed_share(before: float, after: float, noise: float, samples: int) -> float:
    """Computes the removed fraction of an rms error, 1 - (after² - noise²)/(before² - noise²).

    Every output that tells a closed share has it from here.

    Args:
        before, after: root mean squares of the residual [m].
        noise: standard deviation of the measurement [m].
        samples: of the residual.

    Returns:
        0: no better than before; 1: only noise is left, and less than noise is 1, too; negative:
        the gap has grown, by any factor. NaN: there was nothing to close, because the gap before
        is within the noise as far as so few samples and such a noise can tell; or one of the
        three is not known (NaN), or there are no samples.
    """
    if samples <= 0 or not all(map(math.isfinite, (before, after, noise))):
        return NAN
    removable = before**2 - noise**2
    chance = max(TUNING.consistent * math.sqrt(2.0 / samples), TUNING.least_gap**2) * noise**2
    if removable <= chance:
        return NAN
    return min(1.0 - (after**2 - noise**2) / removable, 1.0)


def total_gap(cases: Sequence[MotionFinding]) -> HeightGap:
    """Returns rms height errors [m] before and after a discovery, for equally weighted motions."""
    fitted = [case for case in cases if case.role is Role.FIT]
    others = [case for case in cases if case.role is Role.HOLDOUT]
    fit_before, fit_after, fit_closed = _closed(fitted)
    holdout_before, holdout_after, holdout_closed = _closed(others)
    return HeightGap(
        noise=_pooled([case.noise for case in cases], cases),
        fit_before=fit_before,
        fit_after=fit_after,
        holdout_before=holdout_before,
        holdout_after=holdout_after,
        fit_closed=fit_closed,
        holdout_closed=holdout_closed,
    )


def is_worse(gap: HeightGap) -> bool:
    """Returns whether a model predicts the held-out motions clearly worse than the base model.

    Its mean square beyond the noise is more than WORSE times the base's, and a noise's besides:
    no accident of the noise, and no small effect that these motions hardly show.
    """
    noise = gap.noise**2
    before, after = gap.holdout_before**2 - noise, gap.holdout_after**2 - noise
    return after > TUNING.worse * max(before, 0.0) + noise  # without any held out: not a number


def _closed(cases: Sequence[MotionFinding]) -> tuple[float, float, float]:
    """Returns the rms errors before and after a discovery [m], and the removed fraction."""
    before = _pooled([case.before.rms for case in cases], cases)
    after = _pooled([case.after.rms for case in cases], cases)
    noise = _pooled([case.noise for case in cases], cases)
    samples = sum(case.samples for case in cases)
    return before, after, closed_share(before, after, noise, samples)


def _pooled(values: Sequence[float], cases: Sequence[MotionFinding]) -> float:
    if not cases:
        return NAN
    weights = [case.samples for case in cases]
    return float(np.sqrt(np.average(np.square(values), weights=weights)))
