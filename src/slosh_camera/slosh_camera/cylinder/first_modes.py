"""Estimates the first sloshing mode from points of the contact line; compiled."""

from __future__ import annotations

import numpy as np
from numba.types import Tuple, float64, int64

from slosh_base.compiled.compilation import GIVEN_1, compiled, entry_point, given


@compiled
def _agreement(cosine, sine, height, scale, x, y):  # type: ignore[no-untyped-def]
    """Counts the points that agree with an assumed first mode, using every third point."""
    total = 0.0
    for k in range(0, height.size, 3):
        if not np.isnan(height[k]):
            error = x * cosine[k] + y * sine[k] - height[k]
            total += 3.0 * max(0.0, 1.0 - abs(error) / scale)
    return total


@entry_point(
    Tuple((float64[:, ::1], float64[::1]))(
        GIVEN_1, GIVEN_1, float64, given(int64, 2), int64, float64
    )
)
def first_mode_candidates(azimuth, height, scale, pairs, count, highest):  # type: ignore[no-untyped-def]
    """Returns first-mode candidates that pass through pairs of points, best agreement first.

    Args:
        azimuth: (N,) [rad]. height: (N,) [m]; NaN where unknown.
        scale: deviation beyond which a point does not agree; candidates differ by more [m].
        pairs: (P, 2) indices of lines.
        count: of candidates.
        highest: first mode that liquid can have [m].

    Returns:
        (count, 2) heights at +x and at +y [m], and (count,) shares of points that agree; rest is
        the one candidate where no pair gives another.
    """
    known = max(np.count_nonzero(~np.isnan(height)), 1)
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    tried = np.zeros((pairs.shape[0] + 1, 2))
    score = np.full(pairs.shape[0] + 1, -1.0)
    score[0] = _agreement(cosine, sine, height, scale, 0.0, 0.0)
    for p in range(pairs.shape[0]):
        i, j = pairs[p]
        if np.isnan(height[i]) or np.isnan(height[j]):
            continue
        ci, si, cj, sj = cosine[i], sine[i], cosine[j], sine[j]
        determinant = ci * sj - cj * si
        if abs(determinant) < 0.3:
            continue
        x = (height[i] * sj - height[j] * si) / determinant
        y = (ci * height[j] - cj * height[i]) / determinant
        if np.hypot(x, y) > highest:
            continue
        tried[p + 1] = x, y
        score[p + 1] = _agreement(cosine, sine, height, scale, x, y)
    best = np.zeros((count, 2))
    share = np.zeros(count)
    for c in range(count):
        top = int(np.argmax(score))
        if score[top] < 0.0:
            return best[:c], share[:c]
        best[c] = tried[top]
        share[c] = score[top] / known
        for p in range(score.size):
            if np.hypot(tried[p, 0] - best[c, 0], tried[p, 1] - best[c, 1]) < scale:
                score[p] = -1.0
    return best, share
