"""The robust fit of surface shapes to edges on the wall and to silhouettes, compiled.

Two kinds of evidence. A point of the front line lies on the wall: its height is the surface's
there. An upper edge is a silhouette: along its line of sight from the front to the rear wall the
surface just touches the ray, at the rear wall or at a crest in between. Both are linear in the
shapes' heights, the second for a given place of touch.

A surface seen at a grazing angle mirrors the background, and a thin crest lets it shine through:
below a silhouette at a crest the surface fades in, and its edge in the image lies lower than the
silhouette. At the rear wall the surface ends in a step instead, unless it bends as well. With the
angle s between ray and surface at the place of touch and the angle s' that it reaches the edge's
neighbourhood of w rows further down, s'^2 = s^2 + 2 k w for a curvature k, the edge lies
(1 - s/s') of a full fade lower.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from slosh_model.compile_cache import use_compile_cache

use_compile_cache()

_CHORD = 9
_STEPS = 12
_SHAPES = 8
# Tukey's function: beyond this many standard deviations an observation has no weight.
_TUKEY = 4.7
_COARSE = 12.0
# The edge's neighbourhood, and how far below a crest the middle of its fade is seen [rows]; the
# second as measured on rendered crests of all curvatures, and its relative standard deviation.
_NEIGHBOURHOOD = 3.5
_FADE = 1.0
_FADE_DOUBT = 0.35


@njit(cache=True, nogil=True)
def _shapes(x, y, radial, out):  # type: ignore[no-untyped-def]
    """All shapes' heights at a place in radii."""
    square = x * x + y * y
    first = second = mean = double = 0.0
    for k in range(radial.shape[1] - 1, -1, -1):
        first = first * square + radial[0, k]
        second = second * square + radial[1, k]
        mean = mean * square + radial[2, k]
        double = double * square + radial[3, k]
    out[0] = 1.0
    out[1] = first * x
    out[2] = first * y
    out[3] = second * x
    out[4] = second * y
    out[5] = mean
    out[6] = double * (x * x - y * y)
    out[7] = double * 2.0 * x * y


@njit(cache=True, nogil=True)
def _clearance(near, far, part, heights, radial, out):  # type: ignore[no-untyped-def]
    """Surface above the ray at a part of the way from the front to the rear wall [m]."""
    _shapes(near[0] + part * (far[0] - near[0]), near[1] + part * (far[1] - near[1]), radial, out)
    total = -(near[2] + part * (far[2] - near[2]))
    for k in range(_SHAPES):
        total += heights[k] * out[k]
    return total


@njit(cache=True, nogil=True)
def touch(near, far, radius, footprint, heights, radial, out):  # type: ignore[no-untyped-def]
    """Where the surface comes closest to a ray from below, or rises most above it.

    Args:
        near, far: (3,) ends of the ray: x, y in radii, z [m].
        radius: of the container [m].
        footprint: of a row on the rear wall [m].
        heights: (SHAPES,) [m].
        radial: power series of the shapes.
        out: (SHAPES,) takes the shapes at that place.

    Returns:
        Part of the way, the surface's height above the ray there [m], and how far it would be
        above the ray through the visible edge [m].
    """
    values = np.empty(_CHORD)
    best = 0
    for k in range(_CHORD):
        values[k] = _clearance(near, far, k / (_CHORD - 1.0), heights, radial, out)
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
        further = np.sqrt(slope**2 - 2.0 * bend / step**2 * _NEIGHBOURHOOD * footprint)
        hidden = _FADE * footprint * (1.0 - slope / further)
    return part, _clearance(near, far, part, heights, radial, out), hidden


@njit(cache=True, nogil=True)
def silhouette_rows(near, far, bottom, radius, footprint, heights, radial):  # type: ignore[no-untyped-def]
    """Row on each line at which the surface of given heights ends against the background.

    Args:
        near, far: (J, M, 3) ends of every sample's ray: x, y in radii, z [m]; NaN: none.
        bottom: (M,) row that certainly shows liquid.
        radius, footprint: as for touch.
        heights: (SHAPES,) [m].
        radial: power series of the shapes.

    Returns:
        (M,) row of the edge; NaN where no ray of the line reaches the rear wall, -1 where the
        surface ends above the first row.
    """
    lines = near.shape[1]
    rows = np.full(lines, np.nan)
    shapes = np.empty(_SHAPES)
    for i in range(lines):
        high, low = 0, bottom[i]
        if np.isnan(far[high, i, 0]) or np.isnan(far[low, i, 0]):
            continue
        _, top, hidden = touch(
            near[high, i], far[high, i], radius, footprint, heights, radial, shapes
        )
        above = top - hidden
        _, top, hidden = touch(
            near[low, i], far[low, i], radius, footprint, heights, radial, shapes
        )
        below = top - hidden
        if above > 0.0 or below < 0.0:
            rows[i] = -1.0 if above > 0.0 else np.nan
            continue
        while low - high > 1:
            # The clearance is nearly linear in the row: false position, kept inside the bracket.
            middle = high + int((low - high) * above / (above - below))
            middle = min(max(middle, high + 1), low - 1)
            _, top, hidden = touch(
                near[middle, i], far[middle, i], radius, footprint, heights, radial, shapes
            )
            if top > hidden:
                low, below = middle, top - hidden
            else:
                high, above = middle, top - hidden
        rows[i] = high + above / (above - below)
    return rows


@njit(cache=True, nogil=True)
def _tukey(ratio, limit):  # type: ignore[no-untyped-def]
    if abs(ratio) >= limit:
        return 0.0
    return (1.0 - (ratio / limit) ** 2) ** 2


@njit(cache=True, nogil=True)
def first_mode_candidates(azimuth, height, scale, pairs, count):  # type: ignore[no-untyped-def]
    """First modes through pairs of front points, those first that most other points agree with.

    Args:
        azimuth: (N,) [rad]. height: (N,) [m]; NaN where unknown.
        scale: deviation beyond which a point does not agree; candidates differ by more [m].
        pairs: (P, 2) indices of lines.
        count: of candidates.

    Returns:
        (count, 2) heights at +x and at +y [m], and (count,) shares of points that agree; rest is
        the one candidate where no pair gives another.
    """
    known = max(np.count_nonzero(~np.isnan(height)), 1)
    tried = np.zeros((pairs.shape[0] + 1, 2))
    score = np.full(pairs.shape[0] + 1, -1.0)
    score[0] = _agreement(azimuth, height, scale, 0.0, 0.0)
    for p in range(pairs.shape[0]):
        i, j = pairs[p]
        if np.isnan(height[i]) or np.isnan(height[j]):
            continue
        ci, si, cj, sj = (
            np.cos(azimuth[i]), np.sin(azimuth[i]), np.cos(azimuth[j]), np.sin(azimuth[j]),
        )  # fmt: skip
        determinant = ci * sj - cj * si
        if abs(determinant) < 0.3:
            continue
        x = (height[i] * sj - height[j] * si) / determinant
        y = (ci * height[j] - cj * height[i]) / determinant
        tried[p + 1] = x, y
        score[p + 1] = _agreement(azimuth, height, scale, x, y)
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


@njit(cache=True, nogil=True)
def _agreement(azimuth, height, scale, x, y):  # type: ignore[no-untyped-def]
    """Number of points that agree with a first mode, counted on every third."""
    total = 0.0
    for k in range(0, height.size, 3):
        if not np.isnan(height[k]):
            error = x * np.cos(azimuth[k]) + y * np.sin(azimuth[k]) - height[k]
            total += 3.0 * max(0.0, 1.0 - abs(error) / scale)
    return total


@njit(cache=True, nogil=True)
def solve(  # type: ignore[no-untyped-def]
    front, front_height, front_scale, front_bound, near, far, ray_scale, radius, footprint,
    start, centre, precision, radial,
):  # fmt: skip
    """Iterated reweighted least squares with a Gaussian prior.

    Args:
        front: (N, SHAPES) shapes at the front points.
        front_height: (N,) [m]; NaN where there is none. front_scale: (N,) deviation [m].
        front_bound: (N,) whether the surface may be higher there.
        near, far: (M, 3) ends of the rays that the surface touches; NaN where there is none.
        ray_scale: (M,) deviation [m].
        radius, footprint: as for touch.
        start: (SHAPES,) first guess of the heights [m].
        centre, precision: (SHAPES,) mean [m] and (SHAPES, SHAPES) inverse covariance of the prior.
        radial: power series of the shapes.

    Returns:
        heights (SHAPES,) [m], the inverse of the normal matrix, residuals and weights of the
        front (N,) and of the rays (M,), and the rays' place of touch (M,).
    """
    heights = start.copy()
    n, m = front_height.size, ray_scale.size
    front_error, front_weight = np.full(n, np.nan), np.zeros(n)
    ray_error, ray_weight, part = np.full(m, np.nan), np.zeros(m), np.full(m, np.nan)
    shapes = np.empty(_SHAPES)
    normal = np.empty((_SHAPES, _SHAPES))
    right = np.empty(_SHAPES)
    limit = _COARSE
    for _ in range(_STEPS):
        normal[:] = precision
        right[:] = precision @ (centre - heights)
        for i in range(n):
            if np.isnan(front_height[i]):
                continue
            front_error[i] = front[i] @ heights - front_height[i]
            ratio = front_error[i] / front_scale[i]
            if front_bound[i]:
                front_weight[i] = 1.0 if ratio < 0.0 else 0.0
            else:
                front_weight[i] = _tukey(ratio, limit)
            weight = front_weight[i] / front_scale[i] ** 2
            _add(normal, right, front[i], front_error[i], weight)
        for i in range(m):
            if np.isnan(far[i, 0]):
                continue
            part[i], top, hidden = touch(
                near[i], far[i], radius, footprint, heights, radial, shapes
            )
            ray_error[i] = top - hidden
            variance = ray_scale[i] ** 2 + (_FADE_DOUBT * hidden) ** 2
            ray_weight[i] = _tukey(ray_error[i] / np.sqrt(variance), limit)
            _add(normal, right, shapes, ray_error[i], ray_weight[i] / variance)
        step = np.linalg.solve(normal, right)
        heights += step
        if limit == _TUKEY and np.max(np.abs(step)) < 1e-6:
            break
        limit = max(_TUKEY, 0.7 * limit)
    return heights, np.linalg.inv(normal), front_error, front_weight, ray_error, ray_weight, part


@njit(cache=True, nogil=True)
def _add(normal, right, shapes, error, weight):  # type: ignore[no-untyped-def]
    for k in range(_SHAPES):
        scaled = weight * shapes[k]
        right[k] -= scaled * error
        for j in range(_SHAPES):
            normal[k, j] += scaled * shapes[j]
