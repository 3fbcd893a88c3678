"""Finds the upper end of the liquid along each scan line; compiled.

All pictures here are unrolled walls (J, M) of one number per sample: 0 is liquid behind the front
wall, 1 is background. Rows are counted from the top.
"""

from __future__ import annotations

import numpy as np
from numba.types import Tuple, UniTuple, float32, float64, int64

from slosh_base.compiled.compilation import GIVEN_1, GIVEN_2, GIVEN_3, compiled, entry_point, given
from slosh_camera.cylinder.tuning import TUNING

# Numba's types of what the functions take.
PICTURE, ROWS, STEPS = given(float32, 2), given(int64, 1), given(float32, 3)

# Ends and bins of a histogram of what may be liquid.
_LOWEST, _TOP = -0.3, 0.5
_BINS = 256
_ENOUGH = TUNING.level_samples
_NEAR = TUNING.edge_margin
_SOFT = TUNING.soft_rows
_ENDED = TUNING.slope_ended
_LIQUID_SPREAD = 1.0 / TUNING.liquid_spread
_BACKGROUND_SPREAD = 1.0 / TUNING.background_spread
_BETWEEN = TUNING.unknown_cost
_UNLIKE = TUNING.unlike_cost
_WRONG = TUNING.wrong_weight
_HALF_EDGE = TUNING.half_edge
_LEAK = TUNING.hidden_leak
_BESIDE = TUNING.edge_reach
_LIKE_LIQUID = TUNING.like_liquid
_UNKNOWN_SURFACE = TUNING.unknown_surface
_DULL_SURFACE = TUNING.dull_surface
_BRIGHT_SURFACE = TUNING.bright_surface


@entry_point(float64[::1](PICTURE, int64, int64, float64))
def liquid_levels(picture, top, bottom, reach):  # type: ignore[no-untyped-def]
    """Returns the liquid's grey level on each scan line, from samples that are mostly liquid.

    The median of the samples that are near the level that is most frequent in all of them:
    background in a deep trough and what shines through low down do not count.

    Args:
        picture: (J, M), liquid near 0.
        top, bottom: rows between which samples count.
        reach: deviation from the most frequent level beyond which a sample does not count.

    Returns:
        (M,) levels; NaN where a line has hardly any such samples.
    """
    lines = picture.shape[1]
    low, scale = _LOWEST, _BINS / (_TOP - _LOWEST)
    counts = np.zeros(_BINS, np.int64)
    for j in range(top, bottom, 2):
        for i in range(0, lines, 2):
            b = int((picture[j, i] - low) * scale)
            if 0 <= b < _BINS:
                counts[b] += 1
    most = np.argmax(counts[:-2] + counts[1:-1] + counts[2:]) + 1
    first = max(int(most - reach * scale), 0)
    stop = min(int(most + reach * scale) + 1, _BINS)
    levels = np.full(lines, np.nan)
    for i in range(lines):
        counts[:] = 0
        total = 0
        for j in range(top, bottom):
            b = int((picture[j, i] - low) * scale)
            if first <= b < stop:
                counts[b] += 1
                total += 1
        if total >= _ENOUGH:
            half, b = 0, first - 1
            while 2 * half < total:
                b += 1
                half += counts[b]
            # The median, within its bin.
            levels[i] = low + (b + 1.0 - (half - 0.5 * total) / counts[b]) / scale
    return levels


# No NaN and no sign of zero counts here: a third faster, with the very same sums on every machine.
@entry_point(int64[::1](PICTURE, PICTURE, GIVEN_1, float64), fastmath={"nnan", "nsz"})
def liquid_tops(picture, inside, level, tolerance):  # type: ignore[no-untyped-def]
    """Returns the row of the liquid's upper end on each scan line.

    Of all places for the end, the one that leaves fewest samples on the wrong side: every sample
    below that does not look like liquid counts against it, every one above that does as well. So
    no single highlight, droplet or noisy sample decides.

    Args:
        picture: (J, M).
        inside: (J, M) 1 inside the image, 0 outside.
        level: (M,) the liquid's level by line.
        tolerance: deviation from the level up to which a sample is rather liquid.

    Returns:
        (M,) first row of liquid; J where there is none.
    """
    rows, lines = picture.shape
    # Single precision and no branches: the compiler makes it eight lines at a time.
    scale = np.float32(1.0 / tolerance)
    offset = (level * scale + 1.0).astype(np.float32)
    one = np.float32(1.0)
    row = np.full(lines, rows, np.float32)
    total = np.zeros(lines, np.float32)
    best = np.zeros(lines, np.float32)
    for j in range(rows - 1, -1, -1):
        here = np.float32(j)
        for i in range(lines):
            # What is further from the background than the liquid is no sign of what is above it.
            deviation = picture[j, i] * scale - offset[i]
            total[i] += min(max(deviation, -one), one) * inside[j, i]
            row[i] = here if total[i] < best[i] else row[i]
            best[i] = min(total[i], best[i])
    return row.astype(np.int64)


@entry_point(float64(PICTURE, GIVEN_1, int64, int64))
def usual_deviation(picture, level, top, bottom):  # type: ignore[no-untyped-def]
    """Returns the median deviation of samples from the liquid's grey level on their scan line."""
    counts = np.zeros(_BINS, np.int64)
    for j in range(top, bottom, 2):
        for i in range(0, picture.shape[1], 2):
            counts[min(int(abs(picture[j, i] - level[i]) * _BINS), _BINS - 1)] += 1
    half = 0.5 * np.sum(counts)
    b = 0
    while counts[b] < half:
        half -= counts[b]
        b += 1
    return (b + half / max(counts[b], 1)) / _BINS


@compiled
def _steepest(line, row, sign, first):  # type: ignore[no-untyped-def]
    """Returns the largest drop of grey level that ends at a row of a scan line, and its row."""
    steepest, place = 0.0, row - 1
    for j in range(row + 1, max(row - 1 - _SOFT, first) - 1, -1):
        slope = sign * (line[j] - line[j + 1])
        if slope > steepest:
            steepest, place = slope, j
        elif j < row - 1 and slope < _ENDED * steepest:
            break
    return steepest, place


@compiled
def _crossing(line, top, bottom, middle, sign):  # type: ignore[no-untyped-def]
    """Returns the sub-row position where a scan line crosses a grey level; NaN if it does not."""
    for j in range(top, bottom):
        if sign * (line[j] - middle) >= 0.0 > sign * (line[j + 1] - middle):
            return j + (line[j] - middle) / (line[j] - line[j + 1])
    return np.nan


@entry_point(UniTuple(float64[::1], 2)(PICTURE, ROWS, ROWS, ROWS))
def refine_edges(picture, row, first, last):  # type: ignore[no-untyped-def]
    """Refines rows of edges on the scan lines to fractions of a row.

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


@compiled
def fall_above(picture, j, i):  # type: ignore[no-untyped-def]
    """Returns how much the grey level drops from above a row to below it on a scan line."""
    above = picture[j - 1, i] + picture[j - 2, i]
    below = picture[j, i] + picture[j + 1, i]
    return 0.5 * (above - below)


@compiled
def has_stood(step, stationary, j, i):  # type: ignore[no-untyped-def]
    """Whether the liquid at rest showed an equally strong edge above a row of a scan line."""
    return abs(step) < stationary[0 if step > 0.0 else 1, j, i]


@compiled
def _step(picture, stationary, j, i):  # type: ignore[no-untyped-def]
    """Returns the grey-level drop at a row; 0 if the liquid at rest showed it there too."""
    step = fall_above(picture, j, i)
    return 0.0 if has_stood(step, stationary, j, i) else step


@compiled
def _gains(picture, stationary, guess, reach, floor, first, reversed_weight):  # type: ignore[no-untyped-def]
    """Returns edge strengths (M, 2 reach + 1) near a curve; -inf where edges are excluded."""
    rows, lines = picture.shape
    offsets = 2 * reach + 1
    gain = np.full((lines, offsets), -np.inf)
    for i in range(lines):
        if np.isnan(guess[i]):
            continue
        centre = int(np.rint(guess[i]))
        for o in range(offsets):
            j = centre + o - reach
            if j - 2 < first[i] or j + 1 >= rows or j > floor[i]:
                continue
            step = _step(picture, stationary, j, i)
            gain[i, o] = step if step > 0.0 else -reversed_weight[i] * step
    return gain


@entry_point(
    Tuple((int64[::1], float64[::1]))(PICTURE, STEPS, GIVEN_1, int64, GIVEN_1, ROWS, GIVEN_1)
)
def follow_edge(picture, stationary, guess, reach, floor, first, reversed_weight):  # type: ignore[no-untyped-def]
    """Finds the strongest continuous edge near an expected curve by dynamic programming.

    The path along which the sum of the slopes is largest, with steps of at most two samples from
    line to line against the guess, by dynamic programming.

    Args:
        picture: (J, M).
        stationary: (2, J, M) steps that edges must exceed, see `stationary_edges`.
        guess: (M,) rows of the guessed curve; NaN: no edge is looked for.
        reach: samples by which the edge may lie off the guess.
        floor: (M,) row below which there is no edge to look for.
        first: (M,) first row inside the image.
        reversed_weight: (M,) weight of edges above which it is less like background than below.

    Returns:
        row: (M,) first row below the edge; -1 where there is none.
        slope: (M,) difference over the edge.
    """
    gain = _gains(picture, stationary, guess, reach, floor, first, reversed_weight)
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


@entry_point(float64[::1](GIVEN_2, GIVEN_1))
def rows_of_heights(table, level):  # type: ignore[no-untyped-def]
    """Returns the rows at which scan lines reach the given heights on the wall.

    Args:
        table: (J, M) height of the wall by row, falling downwards [m]; NaN: not known, at the top.
        level: (M,) [m].

    Returns:
        (M,) rows; at the ends for heights beyond them.
    """
    rows, lines = table.shape
    found = np.empty(lines)
    for i in range(lines):
        high, low = 0, rows - 1
        while np.isnan(table[high, i]) and high < low:
            high += 1
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


@compiled
def _edge_at(picture, stationary, row, line, first, last, reversed_weight):  # type: ignore[no-untyped-def]
    """Rates the edge nearest to a row of a scan line by strength and distance, from 0 to 1."""
    best = 0.0
    place = row
    centre = int(np.rint(row + 0.5))
    for j in range(max(centre - _BESIDE, first + 2), min(centre + _BESIDE + 1, last)):
        step = _step(picture, stationary, j, line)
        step = step if step > 0.0 else -reversed_weight * step
        if step > best:
            best, place = step, j - 0.5
    off = (place - row) / _BESIDE
    return best / (best + _HALF_EDGE) * max(1.0 - off * off, 0.0)


@entry_point(
    float64(
        given(float32, 2, "A"), given(float32, 2, "A"), given(float32, 3, "A"), float64, float64,
        given(float64, 1, "A"), GIVEN_1, given(int64, 1, "A"), given(int64, 1, "A"),
    )
)  # fmt: skip
def surface_score(  # type: ignore[no-untyped-def]
    picture, backdrop, stationary, surface, hidden, front, upper, first, last
):
    """Scores how well an image agrees with an assumed surface's contact line and upper edge.

    Below the contact line there should be liquid, above the upper edge what is behind the glass,
    in between anything; on both lines there should be an edge.

    Args:
        picture: (J, M).
        backdrop: (J, M) what is behind the glass, at most 1.
        stationary: (2, J, M) steps that edges must exceed, see `stationary_edges`.
        surface: what the free surface looks like at rest; NaN: unknown.
        hidden: a line against which more than this speaks is hidden; inf: none is.
        front, upper: (M,) rows; an upper edge that is NaN or negative is not seen.
        first, last: (M,) rows inside the image.

    Returns:
        Mean over the lines; at most about 2.
    """
    lines = picture.shape[1]
    front_part, upper_part = _UNKNOWN_SURFACE
    if surface < _LIKE_LIQUID:
        front_part, upper_part = _DULL_SURFACE
    elif surface >= _LIKE_LIQUID:
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
            darker = max(backdrop[j, i] - picture[j, i], 0.0)
            wrong += min((darker * _BACKGROUND_SPREAD) ** 2, 1.0)
        for j in range(low, last[i] + 1):
            wrong += min((picture[j, i] * _LIQUID_SPREAD) ** 2, 1.0)
        edges = _edge_at(picture, stationary, front[i], i, first[i], last[i], 0.7)
        if high < low - 2:
            upper_edge = _edge_at(picture, stationary, upper[i], i, first[i], last[i], 0.3)
            edges = front_part * edges + upper_part * upper_edge
        share = _WRONG * wrong / (last[i] + 1 - first[i])
        total += edges - min(share, hidden + _LEAK * max(share - hidden, 0.0))
    return total / lines


@entry_point(float64[:, ::1](GIVEN_3, GIVEN_1))
def table_at(table, rows):  # type: ignore[no-untyped-def]
    """Interpolates a table of 3D points at a fractional row (M,) of each scan line."""
    values = np.full((rows.size, 3), np.nan)
    for i in range(rows.size):
        if np.isnan(rows[i]):
            continue
        j = min(max(int(rows[i]), 0), table.shape[0] - 2)
        for k in range(3):
            values[i, k] = table[j, i, k] + (table[j + 1, i, k] - table[j, i, k]) * (rows[i] - j)
    return values


@entry_point(float64[::1](GIVEN_1, int64, int64))
def between_lines(rows, skip, lines):  # type: ignore[no-untyped-def]
    """Interpolates rows (lines,) from those of every `skip`th scan line; -1 if undefined."""
    full = np.empty(lines)
    last = rows.size - 1
    for i in range(lines):
        left = min(i // skip, last)
        right = min(left + 1, last)
        part = (i - left * skip) / skip if right > left else 0.0
        full[i] = (1.0 - part) * rows[left] + part * rows[right]
        if rows[left] < 0.0 or rows[right] < 0.0:
            full[i] = -1.0
    return full
