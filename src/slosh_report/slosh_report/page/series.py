"""Reduces long time series with gaps to lines for a chart."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array

SMALLEST_GAP = 0.1
"""A camera that drops some images in a row has no gap yet [s]."""
STEPS = 5.0
"""Samples farther apart than this many usual steps are a gap."""
POINTS = 1200
"""A chart's pixels: longer series are drawn by the extremes of each bin."""


def gap_length(t: Array) -> float:
    """Returns the sample spacing above which a series counts as interrupted [s].

    Args:
        t: (N,) times of the samples that are known [s], not decreasing.
    """
    if len(t) < 2:
        return SMALLEST_GAP
    return max(SMALLEST_GAP, STEPS * float(np.median(np.diff(t))))


def time_ends(t: Array) -> tuple[float, float]:
    """Returns the start and end of the time axis that all charts share [s]."""
    if len(t) < 2:
        return (0.0, 1.0) if not len(t) else (float(t[0]) - 0.5, float(t[0]) + 0.5)
    margin = 0.01 * float(t[-1] - t[0])
    return float(t[0]) - margin, float(t[-1]) + margin


def gaps(t: Array, values: Array) -> tuple[tuple[float, float], ...]:
    """Returns the time spans without samples, including those at both ends [s].

    Args:
        t: (N,) [s], not decreasing.
        values: (N,); NaN: no sample.

    Returns:
        start and end of each [s].
    """
    if not len(t):
        return ()
    known = t[np.isfinite(values)]
    if not len(known):
        return ((float(t[0]), float(t[-1])),)
    edges = np.concatenate((t[:1], known, t[-1:]))
    wide = np.flatnonzero(np.diff(edges) > gap_length(known))
    return tuple((float(edges[i]), float(edges[i + 1])) for i in wide)


def envelope(t: Array, values: Array, points: int = POINTS) -> tuple[Array, Array]:
    """Reduces a series to about `points` points with the same extremes.

    A long series is cut into bins of equal duration, and each is drawn by its minimum and its
    maximum. Single samples that are missing are bridged; a gap stays open: there a NaN parts the
    line.

    Args:
        t: (N,) [s], not decreasing.
        values: (N,); NaN where there are none.
        points: wanted number.

    Returns:
        times and values, in order.
    """
    finite = np.isfinite(values)
    t, values = t[finite], values[finite]
    gap = gap_length(t)
    if len(t) > points:
        gap = max(gap, float(t[-1] - t[0]) / (points // 2))  # finer ones are below a pixel
        parting = np.concatenate(([0], np.cumsum(np.diff(t) > gap)))
        chosen = extremes(t, values, points // 2)
        t, values = t[chosen], values[chosen]
        wide = np.flatnonzero(np.diff(parting[chosen]))
    else:
        wide = np.flatnonzero(np.diff(t) > gap)
    middle = 0.5 * (t[wide] + t[wide + 1]) if len(wide) else t[:0]
    return np.insert(t, wide + 1, middle), np.insert(values, wide + 1, np.nan)


def lone(values: Array) -> NDArray[np.bool_]:
    """Returns which samples (N,) lie between two missing samples, so that no line shows them."""
    known = np.concatenate(([False], np.isfinite(values), [False]))
    return np.asarray(known[1:-1] & ~known[:-2] & ~known[2:])


def extremes(t: Array, values: Array, bins: int) -> NDArray[np.intp]:
    """Returns the indices of the minimum and maximum in each bin, in order.

    Args:
        t: (N,) [s], not decreasing.
        values: (N,), all finite.
        bins: of equal duration.
    """
    chosen: set[int] = set()
    for a, b in _bins(t, bins):
        part = values[a:b]
        chosen |= {a + int(np.argmin(part)), a + int(np.argmax(part))}
    return np.array(sorted(chosen), dtype=np.intp)


def highest(values: Array, points: int) -> NDArray[np.intp]:
    """Returns indices of at most `points` samples: the maxima of equal parts of the series.

    Args:
        values: (N,), all finite.
        points: wanted number.
    """
    if len(values) <= points:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), points + 1).astype(int).tolist()
    parts = [a + int(np.argmax(values[a:b])) for a, b in pairwise(edges)]
    return np.array(parts, dtype=np.intp)


def united(spans: Iterable[tuple[float, float]], closer: float) -> list[tuple[float, float]]:
    """Merges time spans that overlap or are closer than a given distance [s]."""
    found: list[tuple[float, float]] = []
    for start, end in sorted(spans):
        if found and start <= found[-1][1] + closer:
            found[-1] = (found[-1][0], max(found[-1][1], end))
        else:
            found.append((start, end))
    return found


def _bins(t: Array, bins: int) -> list[tuple[int, int]]:
    """Returns start and end (exclusive) indices of each time bin that has samples."""
    edges = np.searchsorted(t, np.linspace(t[0], t[-1], bins + 1))
    edges[0], edges[-1] = 0, len(t)
    return [(a, b) for a, b in pairwise(edges.tolist()) if b > a]
