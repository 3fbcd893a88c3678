"""Median of a few hundred numbers, about ten times as fast as `np.median`."""

from __future__ import annotations

import numpy as np
from numba.types import float64

from slosh_base.compiled.compilation import entry_point, given

ROBUST = 1.4826
"""Standard deviation over the median deviation of a normal distribution."""


@entry_point(float64(given(float64, 1, "A")))
def median(values):  # type: ignore[no-untyped-def]
    """Returns the median of (N,) numbers; NaN if any is NaN or there are none."""
    half = values.size // 2
    for value in values:
        if np.isnan(value):
            return np.nan
    if not values.size:
        return np.nan
    ordered = np.partition(values, half)
    if values.size % 2:
        return ordered[half]
    return 0.5 * (np.max(ordered[:half]) + ordered[half])
