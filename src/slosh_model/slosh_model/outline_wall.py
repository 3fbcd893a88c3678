"""Heights of a plane liquid surface on vertical walls over any outline.

Corners of the wall are (c, s), x and y in units of the reaches along them: the plane that is
sh_x high at c = 1 and sh_y high at s = 1 is c sh_x + s sh_y high there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba.types import void

from slosh_base.compiled.compilation import (
    CHANGED_1,
    GIVEN_1,
    GIVEN_2,
    compiled,
    entry_point,
)
from slosh_base.types import Array

MOST_CORNERS = 48
"""Of a wall; a bend has about one for each 8°: of its radius at most 0.3 % is lost."""
_ALIKE = 1e-9
"""Relative difference of heights below which a whole side is the highest place."""


@compiled
def highest_at_corners(corners, count, height_x, height_y):  # type: ignore[no-untyped-def]
    """Returns the maximum height [m] of a plane surface on a wall with corners.

    Args:
        corners: (MOST_CORNERS, 2), of which the first `count` are the wall's.
        count: at least 3.
        height_x, height_y: at the reaches along x and y [m]; NaN: so is the maximum.
    """
    if height_x != height_x or height_y != height_y:
        return math.nan  # a comparison with NaN would leave 0
    best = 0.0  # its mean is 0: never below
    for k in range(count):
        best = max(best, corners[k, 0] * height_x + corners[k, 1] * height_y)
    return best


@compiled
def azimuth_at_corners(corners, count, height_x, height_y, reach_x, reach_y):  # type: ignore[no-untyped-def]
    """Returns the highest corner's azimuth [rad], or the mean azimuth of equally high corners."""
    best = highest_at_corners(corners, count, height_x, height_y)
    if best != best:
        return math.nan
    x = y = 0.0
    if best > 0.0:
        for k in range(count):
            if corners[k, 0] * height_x + corners[k, 1] * height_y >= best * (1.0 - _ALIKE):
                x += corners[k, 0]
                y += corners[k, 1]
    return math.atan2(reach_y * y, reach_x * x)


@compiled
def place_at_corners(azimuth, corners, count, reach_x, reach_y):  # type: ignore[no-untyped-def]
    """Returns the wall position in a direction from the axis, relative to the half widths.

    The outermost, where the wall is there more than once; (0, 0), where it is not there at all.

    Args:
        azimuth: the direction [rad].
        corners: (MOST_CORNERS, 2), of which the first `count` are the wall's.
        count: at least 3.
        reach_x, reach_y: [m].
    """
    c, s = math.cos(azimuth) / reach_x, math.sin(azimuth) / reach_y
    far = 0.0
    for k in range(count):
        n = k + 1 if k + 1 < count else 0
        x, y = corners[k, 0], corners[k, 1]
        dx, dy = corners[n, 0] - x, corners[n, 1] - y
        across = c * dy - s * dx
        if across != 0.0:
            share = (s * x - c * y) / across
            if -1e-12 <= share <= 1.0 + 1e-12:
                far = max(far, (x * dy - y * dx) / across)
    return c * far, s * far


@entry_point(void(GIVEN_2, GIVEN_1, GIVEN_2, CHANGED_1, CHANGED_1))
def highest_of_many(corners, reaches, heights, maximum, azimuth):  # type: ignore[no-untyped-def]
    """Computes maximum heights [m] at the wall and their azimuths [rad] for many plane surfaces.

    Args:
        corners: (K, 2) of the wall.
        reaches: (2,) [m].
        heights: (N, 2) at the reaches along x and y [m].
        maximum, azimuth: (N,) receive the results [m, rad].
    """
    count = corners.shape[0]
    for i in range(heights.shape[0]):
        x, y = heights[i, 0], heights[i, 1]
        maximum[i] = highest_at_corners(corners, count, x, y)
        azimuth[i] = azimuth_at_corners(corners, count, x, y, reaches[0], reaches[1])


def few_corners(places: Array, most: int = MOST_CORNERS) -> Array:
    """Reduces a closed outline (N, 2) to the points (K, 2) that preserve its shape best.

    Those whose triangle with their neighbours is smallest are left out first (Visvalingam &
    Whyatt, Cartogr. J. 30, 1993).
    """
    kept = [tuple(place) for place in places.tolist()]
    whole = abs(_triangles(places).sum()) + float(np.ptp(places, axis=0).prod())
    while len(kept) > 3:
        areas = np.abs(_triangles(np.array(kept)))
        least = int(np.argmin(areas))
        if len(kept) <= most and areas[least] > 1e-12 * whole:
            break
        del kept[least]
    return np.array(kept)


def _triangles(places: Array | Sequence[tuple[float, float]]) -> Array:
    """Returns twice the signed area of each point's triangle with its neighbours."""
    at = np.asarray(places)
    before, after = at - np.roll(at, 1, axis=0), np.roll(at, -1, axis=0) - at
    return np.asarray(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])
