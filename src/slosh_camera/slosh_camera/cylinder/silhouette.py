"""Computes the outline of a free surface against the background; compiled.

Along the line of sight from the front to the rear wall the surface just touches the ray to its
upper edge, at the rear wall or at a crest in between: a silhouette.

A surface seen at a grazing angle mirrors the background, and a thin crest lets it shine through:
below a silhouette at a crest the surface fades in, and its edge in the image lies lower than the
silhouette. At the rear wall the surface ends in a step instead, unless it bends as well. With the
angle s between ray and surface at the place of touch and the angle s' that it reaches the edge's
neighbourhood of w rows further down, s'^2 = s^2 + 2 k w for a curvature k, the edge lies
(1 - s/s') of a full fade lower. Where the liquid climbs at the wall, its line there is what is
seen, and it does not fade: the share of the fade that is there is fitted, too.
"""

from __future__ import annotations

import numpy as np
from numba.types import boolean, float64, int64

from slosh_base.compiled.compilation import GIVEN_1, GIVEN_2, GIVEN_3, compiled, entry_point, given
from slosh_camera.cylinder.surface import RADIAL_STEPS, RADIAL_TABLE, SHAPES
from slosh_camera.cylinder.tuning import TUNING

_TABLE = RADIAL_TABLE
_PER_UNIT = float(RADIAL_STEPS)
# Places on a ray at which the surface is looked at first.
_CHORD = 9
_NEIGHBOURHOOD = TUNING.fade_rows


@compiled
def _radial(square):  # type: ignore[no-untyped-def]
    """Returns the mode shapes' radial factors at ρ², the squared radius in container radii."""
    place = square * _PER_UNIT
    k = min(int(place), _TABLE.shape[0] - 2)
    part = place - k
    return (
        _TABLE[k, 0] + part * (_TABLE[k + 1, 0] - _TABLE[k, 0]),
        _TABLE[k, 1] + part * (_TABLE[k + 1, 1] - _TABLE[k, 1]),
        _TABLE[k, 2] + part * (_TABLE[k + 1, 2] - _TABLE[k, 2]),
        _TABLE[k, 3] + part * (_TABLE[k + 1, 3] - _TABLE[k, 3]),
    )


@compiled
def _shapes(x, y, out):  # type: ignore[no-untyped-def]
    """Returns the heights of all surface mode shapes at a position in units of the radius."""
    first, second, mean, double = _radial(x * x + y * y)
    out[0] = 1.0
    out[1] = first * x
    out[2] = first * y
    out[3] = second * x
    out[4] = second * y
    out[5] = mean
    out[6] = double * (x * x - y * y)
    out[7] = double * 2.0 * x * y


@compiled
def clearance(near, far, part, heights):  # type: ignore[no-untyped-def]
    """Returns the surface's height [m] above the point at a fraction of a line of sight."""
    x = near[0] + part * (far[0] - near[0])
    y = near[1] + part * (far[1] - near[1])
    first, second, mean, double = _radial(x * x + y * y)
    height = heights[0] + mean * heights[5]
    height += first * (heights[1] * x + heights[2] * y)
    height += second * (heights[3] * x + heights[4] * y)
    height += double * (heights[6] * (x * x - y * y) + heights[7] * 2.0 * x * y)
    return height - near[2] - part * (far[2] - near[2])


@compiled
def shapes_on_ray(near, far, part, out):  # type: ignore[no-untyped-def]
    """Computes the heights of all mode shapes at a fraction of a line of sight's length."""
    _shapes(near[0] + part * (far[0] - near[0]), near[1] + part * (far[1] - near[1]), out)


@compiled
def touch(near, far, radius, fade, heights):  # type: ignore[no-untyped-def]
    """Finds where a line of sight is closest above the surface, or deepest below the surface.

    Args:
        near, far: (3,) ends of the ray: x, y in radii, z [m].
        radius: of the container [m].
        fade: height on the rear wall over which a crest fades in, a row in a sharp picture [m].
        heights: (SHAPES,) [m].

    Returns:
        Part of the way, the surface's height above the ray there [m], and how far it would be
        above the ray through the visible edge [m].
    """
    values = np.empty(_CHORD)
    best = 0
    for k in range(_CHORD):
        values[k] = clearance(near, far, k / (_CHORD - 1.0), heights)
        if values[k] > values[best]:
            best = k
    part = best / (_CHORD - 1.0)
    middle = min(max(best, 1), _CHORD - 2)
    left, right = values[middle - 1], values[middle + 1]
    bend = left - 2.0 * values[middle] + right
    step = radius * np.hypot(far[0] - near[0], far[1] - near[1]) / (_CHORD - 1.0)
    slope = 0.0
    if best == middle:
        if bend < 0.0:
            part += 0.5 * (left - right) / bend / (_CHORD - 1.0)
    elif best:
        slope = max((0.5 * (right - left) + bend) / step, 0.0)
    hidden = 0.0
    if best and bend < 0.0:
        further = np.sqrt(slope**2 - 2.0 * bend / step**2 * _NEIGHBOURHOOD * fade)
        hidden = fade * (1.0 - slope / further)
    return part, clearance(near, far, part, heights), hidden


@entry_point(float64[::1](GIVEN_3, GIVEN_3, given(int64, 1), float64, float64, GIVEN_1))
def silhouette_rows(near, far, bottom, radius, fade, heights):  # type: ignore[no-untyped-def]
    """Returns the row on each scan line where the surface ends against the background.

    Args:
        near, far: (J, M, 3) ends of every sample's ray: x, y in radii, z [m]; NaN: none.
        bottom: (M,) row that certainly shows liquid.
        heights: (SHAPES,) [m].

    Returns:
        (M,) row of the edge; NaN where no ray of the line reaches the rear wall, -1 where the
        surface ends above the first row.
    """
    lines = near.shape[1]
    rows = np.full(lines, np.nan)
    for i in range(lines):
        high, low = 0, bottom[i]
        if np.isnan(far[high, i, 0]) or np.isnan(far[low, i, 0]):
            continue
        _, top, hidden = touch(near[high, i], far[high, i], radius, fade, heights)
        above = top - hidden
        _, top, hidden = touch(near[low, i], far[low, i], radius, fade, heights)
        below = top - hidden
        if above > 0.0 or below < 0.0:
            rows[i] = -1.0 if above > 0.0 else np.nan
            continue
        while low - high > 1:
            # The clearance is nearly linear in the row: false position, kept inside the bracket.
            middle = high + int((low - high) * above / (above - below))
            middle = min(max(middle, high + 1), low - 1)
            _, top, hidden = touch(near[middle, i], far[middle, i], radius, fade, heights)
            if top > hidden:
                low, below = middle, top - hidden
            else:
                high, above = middle, top - hidden
        rows[i] = high + above / (above - below)
    return rows


@entry_point(float64[:, ::1](GIVEN_2))
def shapes_of(near):  # type: ignore[no-untyped-def]
    """Returns heights (N, SHAPES) of all mode shapes at positions (N, 3), x and y per radius."""
    shapes = np.empty((near.shape[0], SHAPES))
    for i in range(near.shape[0]):
        _shapes(near[i, 0], near[i, 1], shapes[i])
    return shapes


@entry_point(float64[:, ::1](GIVEN_1))
def wall_shapes_of(azimuth):  # type: ignore[no-untyped-def]
    """Returns heights (N, SHAPES) of all mode shapes on the wall at azimuths (N,) [rad]."""
    shapes = np.empty((azimuth.size, SHAPES))
    for i in range(azimuth.size):
        _shapes(np.cos(azimuth[i]), np.sin(azimuth[i]), shapes[i])
    return shapes


@entry_point(boolean[::1](GIVEN_2, GIVEN_2, float64, float64, GIVEN_1))
def above_ray(near, far, radius, fade, heights):  # type: ignore[no-untyped-def]
    """Whether the surface is visible above each line of sight, given by two ends (M, 3)."""
    above = np.zeros(near.shape[0], np.bool_)
    for i in range(near.shape[0]):
        if not np.isnan(far[i, 0]):
            _, top, hidden = touch(near[i], far[i], radius, fade, heights)
            above[i] = top > hidden
    return above
