"""Where the liquid ends along each scan line, compiled.

All pictures here are unrolled walls (J, M) of one number per sample: 0 is liquid behind the front
wall, 1 is background. Rows are counted from the top.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from slosh_model.compile_cache import use_compile_cache

FloatArray = NDArray[np.float64]

use_compile_cache()

# Samples beside an edge that must be inside the image.
_NEAR = 2
# Rows over which a soft edge goes on, and slope, as a part of the steepest, at which it has ended.
_SOFT = 12
_ENDED = 0.2
# Deviations at which a sample speaks against liquid and against background, inverted; what a
# sample of the free surface costs, which may look like either.
_LIQUID_SPREAD = 1.0 / 0.45
_BACKGROUND_SPREAD = 1.0 / 0.6
_BETWEEN = 0.2
_UNLIKE = 0.6
# Weight of wrong samples against edges, and a slope that is half an edge.
_WRONG = 4.0
_HALF_EDGE = 0.08
# Distance from which on an edge is another one [rows].
_BESIDE = 4
# Weights of two edges, front line and upper edge; a front line alone has weight 1. The upper one
# counts more, since the surface may look like the liquid, and yet less than a front line alone,
# the simpler explanation of a single edge - unless the surface is known to look like the liquid.
_UNKNOWN_SURFACE = 0.3, 0.8
_DULL_SURFACE = 0.15, 1.0
_BRIGHT_SURFACE = 0.45, 0.65
# A surface that at rest deviates less from the liquid shows hardly any front line.
_LIKE_LIQUID = 0.15


@njit(cache=True, nogil=True)
def liquid_levels(picture, top, bottom, reach):  # type: ignore[no-untyped-def]
    """The liquid's level on each line, from what is mostly liquid.

    The median of the samples that are near the level that is most frequent in all of them:
    background in a deep trough and what shines through low down do not count.

    Args:
        picture: (J, M), liquid near 0.
        top, bottom: rows between which samples count.
        reach: deviation from the most frequent level beyond which a sample does not count.

    Returns:
        (M,) levels; NaN where a line has hardly any such samples.
    """
    bins = 128
    lines = picture.shape[1]
    low, high = -0.5, 0.8
    counts = np.zeros(bins, np.int64)
    for i in range(lines):
        for j in range(top, bottom):
            b = int((picture[j, i] - low) / (high - low) * bins)
            if 0 <= b < bins:
                counts[b] += 1
    best = 0
    most = -1
    for b in range(1, bins - 1):
        near = counts[b - 1] + counts[b] + counts[b + 1]
        if near > most:
            most, best = near, b
    mode = low + (best + 0.5) / bins * (high - low)
    levels = np.full(lines, np.nan)
    for i in range(lines):
        values = np.empty(max(bottom - top, 0))
        count = 0
        for j in range(top, bottom):
            if abs(picture[j, i] - mode) < reach:
                values[count] = picture[j, i]
                count += 1
        if count >= 8:
            levels[i] = np.median(values[:count])
    return levels


@njit(cache=True, nogil=True)
def liquid_tops(picture, level, tolerance, first, last):  # type: ignore[no-untyped-def]
    """Row of the liquid's upper end on each line.

    Of all places for the end, the one that leaves fewest samples on the wrong side: every sample
    below that does not look like liquid counts against it, every one above that does as well. So
    no single highlight, droplet or noisy sample decides.

    Args:
        picture: (J, M).
        level: (M,) the liquid's level by line.
        tolerance: deviation from the level up to which a sample is rather liquid.
        first: (M,) first row inside the image.
        last: (M,) last row inside the image.

    Returns:
        row: (M,) first row of liquid; J where there is none.
        clarity: (M,) mean of the evidence over the 8 samples on either side, in [-1, 1].
    """
    rows, lines = picture.shape
    row = np.empty(lines, np.int64)
    clarity = np.empty(lines)
    cost = np.empty(rows + 1)
    for i in range(lines):
        total = best = 0.0
        place = last[i] + 1
        cost[place] = 0.0
        for j in range(last[i], first[i] - 1, -1):
            # What is further from the background than the liquid is no sign of what is above it.
            deviation = (picture[j, i] - level[i]) / tolerance - 1.0
            total += min(max(deviation, -1.0), 1.0)
            cost[j] = total
            if total < best:
                best = total
                place = j
        row[i] = place if best < 0.0 else rows
        below = min(place + 8, last[i] + 1)
        above = max(place - 8, first[i])
        span = max(below - above, 1)
        clarity[i] = (cost[below] + cost[above] - 2.0 * cost[place]) / span
    return row, clarity


@njit(cache=True, nogil=True)
def refine_edges(picture, row, first, last):  # type: ignore[no-untyped-def]
    """Edges to a fraction of a sample: where the picture crosses the middle of the step.

    The step is followed from its steepest place as far as it goes, and the levels on either side
    are taken beside it: uneven light does not move it, and blur does not either.

    Args:
        picture: (J, M).
        row: (M,) first row below the edge, or below the upper part of a soft one.
        first, last: (M,) rows inside the image.

    Returns:
        place: (M,) row of the edge; NaN where there is no step.
        width: (M,) step over the steepest slope [samples].
    """
    lines = picture.shape[1]
    place = np.full(lines, np.nan)
    width = np.full(lines, np.nan)
    for i in range(lines):
        r = row[i]
        if r <= first[i] + _NEAR or r > last[i] - _NEAR:
            continue
        line = picture[:, i]
        sign = 1.0 if line[r - 1] + line[r - 2] > line[r] + line[r + 1] else -1.0
        steepest, middle = _steepest(line, r, sign, first[i])
        if steepest <= 0.0:
            continue
        limit = _ENDED * steepest
        top, bottom = middle, middle + 1
        while top > max(first[i], r - 2 * _SOFT) and sign * (line[top - 1] - line[top]) >= limit:
            top -= 1
        while (
            bottom < min(last[i], r + _SOFT) and sign * (line[bottom] - line[bottom + 1]) >= limit
        ):
            bottom += 1
        high = 0.5 * (line[max(top - 1, first[i])] + line[top])
        low = 0.5 * (line[bottom] + line[min(bottom + 1, last[i])])
        place[i] = _crossing(line, top, bottom, 0.5 * (high + low), sign)
        width[i] = abs(high - low) / steepest
    return place, width


@njit(cache=True, nogil=True)
def _steepest(line, row, sign, first):  # type: ignore[no-untyped-def]
    """Largest fall of a step whose lower end is at a row, and the row above it."""
    steepest, place = 0.0, row - 1
    for j in range(row + 1, max(row - 1 - _SOFT, first) - 1, -1):
        slope = sign * (line[j] - line[j + 1])
        if slope > steepest:
            steepest, place = slope, j
        elif j < row - 1 and slope < _ENDED * steepest:
            break
    return steepest, place


@njit(cache=True, nogil=True)
def _crossing(line, top, bottom, middle, sign):  # type: ignore[no-untyped-def]
    """Row between two at which a line of samples crosses a level; NaN where it does not."""
    for j in range(top, bottom):
        if sign * (line[j] - middle) >= 0.0 > sign * (line[j + 1] - middle):
            return j + (line[j] - middle) / (line[j] - line[j + 1])
    return np.nan


@njit(cache=True, nogil=True)
def follow_edge(picture, static, guess, reach, floor, first, reversed_weight):  # type: ignore[no-untyped-def]
    """The most marked edge near a guessed curve, continuous from line to line.

    The path along which the sum of the slopes is largest, with steps of at most two samples from
    line to line against the guess, by dynamic programming.

    Args:
        picture: (J, M).
        static: (J, M) slope of what is there without any wave: the rim, a label.
        guess: (M,) rows of the guessed curve; NaN: no edge is looked for.
        reach: samples by which the edge may lie off the guess.
        floor: (M,) row below which there is no edge to look for: the front line.
        first: (M,) first row inside the image.
        reversed_weight: weight of edges above which it is less like background than below.

    Returns:
        row: (M,) first row below the edge; -1 where there is none.
        slope: (M,) difference over the edge.
    """
    gain = _gains(picture, static, guess, reach, floor, first, reversed_weight)
    lines, offsets = gain.shape
    score = np.zeros((lines, offsets))
    origin = np.zeros((lines, offsets), np.int64)
    for i in range(lines):
        for o in range(offsets):
            best = -np.inf
            for move in range(-2, 3):
                p = o + move
                if i > 0 and 0 <= p < offsets and score[i - 1, p] - 0.02 * abs(move) > best:
                    best = score[i - 1, p] - 0.02 * abs(move)
                    origin[i, o] = p
            # A line without an edge passes the path on.
            here = gain[i, o] if gain[i, o] > -np.inf else 0.0
            score[i, o] = here + (best if i > 0 else 0.0)
    row = np.full(lines, -1, np.int64)
    slope = np.zeros(lines)
    o = int(np.argmax(score[lines - 1]))
    for i in range(lines - 1, -1, -1):
        if gain[i, o] > -np.inf:
            row[i] = int(np.rint(guess[i])) + o - reach
            slope[i] = gain[i, o]
        o = origin[i, o]
    return row, slope


@njit(cache=True, nogil=True)
def rows_of_heights(table, level):  # type: ignore[no-untyped-def]
    """Rows at which lines up the wall reach given heights.

    Args:
        table: (J, M) height of the wall by row, falling downwards [m].
        level: (M,) [m].

    Returns:
        (M,) rows; at the ends for heights beyond them.
    """
    rows, lines = table.shape
    found = np.empty(lines)
    for i in range(lines):
        high, low = 0, rows - 1
        if level[i] >= table[high, i]:
            found[i] = high
            continue
        if level[i] <= table[low, i]:
            found[i] = low
            continue
        while low - high > 1:
            middle = (low + high) // 2
            if table[middle, i] > level[i]:
                high = middle
            else:
                low = middle
        found[i] = high + (table[high, i] - level[i]) / (table[high, i] - table[low, i])
    return found


@njit(cache=True, nogil=True)
def _gains(picture, static, guess, reach, floor, first, reversed_weight):  # type: ignore[no-untyped-def]
    """Slopes (M, 2 reach + 1) around a guessed curve; -inf where there is no edge to look for."""
    rows, lines = picture.shape
    offsets = 2 * reach + 1
    gain = np.full((lines, offsets), -np.inf)
    for i in range(lines):
        if np.isnan(guess[i]):
            continue
        centre = int(np.rint(guess[i]))
        for o in range(offsets):
            j = centre + o - reach
            if j - 2 < first[i] or j + 1 >= rows or j > floor[i] - 2:
                continue
            above = picture[j - 1, i] + picture[j - 2, i]
            below = picture[j, i] + picture[j + 1, i]
            step = 0.5 * (above - below)
            step = step if step > 0.0 else -reversed_weight * step
            gain[i, o] = max(step - static[j, i], 0.0)
    return gain


@njit(cache=True, nogil=True)
def surface_score(picture, static, surface, front, upper, first, last):  # type: ignore[no-untyped-def]
    """How well a picture agrees with a surface's front line and upper edge.

    Below the front line there should be liquid, above the upper edge background, in between
    anything; on both lines there should be an edge.

    Args:
        picture: (J, M).
        static: (J, M) slope of what is there without any wave.
        surface: what the free surface looks like at rest; NaN: unknown.
        front, upper: (M,) rows; an upper edge that is NaN or negative is not seen.
        first, last: (M,) rows inside the image.

    Returns:
        Mean over the lines; at most about 2.
    """
    lines = picture.shape[1]
    front_part, upper_part = _UNKNOWN_SURFACE
    if abs(surface) < _LIKE_LIQUID:
        front_part, upper_part = _DULL_SURFACE
    elif abs(surface) >= _LIKE_LIQUID:
        front_part, upper_part = _BRIGHT_SURFACE
    total = 0.0
    for i in range(lines):
        low = min(max(int(np.rint(front[i])), first[i]), last[i] + 1)
        high = low
        if upper[i] >= 0.0 and upper[i] < low:
            high = max(int(np.rint(upper[i])), first[i])
        wrong = 0.0
        for j in range(high, low):
            unlike = min(((picture[j, i] - surface) * _LIQUID_SPREAD) ** 2, 1.0)
            wrong += _BETWEEN if np.isnan(surface) else _UNLIKE * unlike
        for j in range(first[i], high):
            wrong += min(max((1.0 - picture[j, i]) * _BACKGROUND_SPREAD, 0.0) ** 2, 1.0)
        for j in range(low, last[i] + 1):
            wrong += min((picture[j, i] * _LIQUID_SPREAD) ** 2, 1.0)
        edges = _edge_at(picture, static, front[i], i, first[i], last[i], 0.7)
        if high < low - 2:
            upper_edge = _edge_at(picture, static, upper[i], i, first[i], last[i], 0.3)
            edges = front_part * edges + upper_part * upper_edge
        total += edges - _WRONG * wrong / (last[i] + 1 - first[i])
    return total / lines


@njit(cache=True, nogil=True)
def _edge_at(picture, static, row, line, first, last, reversed_weight):  # type: ignore[no-untyped-def]
    """How marked the edge next to a row is, and how near: between 0 and 1."""
    best = 0.0
    place = row
    centre = int(np.rint(row + 0.5))
    for j in range(max(centre - _BESIDE, first + 2), min(centre + _BESIDE + 1, last)):
        above = picture[j - 1, line] + picture[j - 2, line]
        below = picture[j, line] + picture[j + 1, line]
        step = 0.5 * (above - below)
        step = (step if step > 0.0 else -reversed_weight * step) - static[j, line]
        if step > best:
            best, place = step, j - 0.5
    off = (place - row) / _BESIDE
    return best / (best + _HALF_EDGE) * max(1.0 - off * off, 0.0)
