"""Finds intervals without samples in motions, and bounds what lies between samples."""

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

UNTOLD = 0.4
"""Of the liquid's first period: rows that are farther apart do not tell its motion."""
RESERVE = 1.25
"""Factor on what a line between rows loses: the bound held for 299 of 300 random strokes."""
LEAST_SHARE = 0.01
"""A height that may be higher by this share between the rows' reading and the motion is told."""


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


def row_spacing(t: Array, acceleration: Array) -> float:
    """Returns the longest interval of a motion in which it is not at rest at both ends [s]."""
    still = ~np.any(acceleration, axis=1)
    return float(np.diff(t)[~(still[1:] & still[:-1])].max(initial=0.0))


def unresolved(spacing: float, model: Model) -> float:
    """Returns by which share heights may be higher than those of a motion read row by row.

    A line between rows that are `spacing` apart keeps sinc²(spacing/period) of an acceleration at
    the liquid's frequency. Near half a period rows do not tell such an acceleration.

    >>> from slosh_model import read_model
    >>> print(f"{unresolved(0.05, read_model('cup/model.yaml')):.3f}")
    0.123

    Args:
        spacing: longest interval between rows [s].
        model: of the liquid.

    Returns:
        the share; 0 where it is below LEAST_SHARE, infinity where nothing is known.
    """
    share = spacing * model.mode_frequency(1) / math.tau
    if share >= UNTOLD:
        return math.inf
    more = RESERVE * (1.0 / float(np.sinc(share)) ** 2 - 1.0)
    return more if more >= LEAST_SHARE else 0.0


def unresolved_text(spacing: float, model: Model) -> str:
    """Describes how much of a motion the spacing of its rows hides; empty if little."""
    more = unresolved(spacing, model)
    if more == 0.0:
        return ""
    period = math.tau / model.mode_frequency(1)
    apart = f"rows are {spacing:.3g} s apart, the liquid's period is {period:.2g} s"
    if more == math.inf:
        return (
            f"{apart}: they do not tell the motion; is t in s? Sample it at least every "
            f"{PERIOD_SHARE * period:.2g} s"
        )
    return f"{apart}: between them the height may be {100.0 * more:.2g} % higher"
