"""Finds intervals without samples in motions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_model.model import Model

GAP_SHARE = 10.0
"""An interval longer than so many usual ones (their median),"""
PERIOD_SHARE = 1.0 / 8.0
"""and than this share of the liquid's first period, is a gap: a line across it keeps less than
sinc²(1/8) = 95 % of an acceleration at the liquid's frequency."""


class Gap(NamedTuple):
    """An interval of a motion in which input samples are missing.

    Attributes:
        start: time of the sample before it [s].
        length: of the interval [s].
        usual: the median interval [s].
    """

    start: float
    length: float
    usual: float

    def __str__(self) -> str:
        return (
            f"{self.length:.3g} s without a sample after t = {self.start:.9g} s "
            f"(usual {self.usual:.3g} s)"
        )


def find_gaps(t: Array, model: Model) -> list[Gap]:
    """Finds the gaps between samples of a motion, in order of time.

    Args:
        t: (N,) time, increasing [s].
        model: of the liquid that the motion moves.
    """
    if len(t) < 3:
        return []
    intervals = np.diff(t)
    usual = float(np.median(intervals))
    shortest = max(GAP_SHARE * usual, PERIOD_SHARE * math.tau / model.mode_frequency(1))
    rows = np.flatnonzero(intervals > shortest)
    return [Gap(float(t[row]), float(intervals[row]), usual) for row in rows]


def gap_text(t: Array, model: Model) -> str:
    """Describes the gaps in a motion; empty if there are none."""
    gaps = find_gaps(t, model)
    if not gaps:
        return ""
    longest = max(gaps, key=lambda gap: gap.length)
    others = "" if len(gaps) == 1 else f" and {len(gaps) - 1} more"
    return f"a gap in the motion: {longest}{others}; fill it in, or cut the motion there"
