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
(1 - s/s') of a full fade lower. Where the liquid climbs at the wall, its line there is what is
seen, and it does not fade: the share of the fade that is there is fitted, too.
"""

from __future__ import annotations

import numpy as np
from numba.types import Tuple, boolean, float64, int64

from slosh_camera.cylinder.surface_modes import RADIAL_STEPS, RADIAL_TABLE
from slosh_model.compilation import GIVEN_1, GIVEN_2, GIVEN_3, compiled, entry_point, given
from slosh_model.normal_equations import factorize, substitute

_TABLE = RADIAL_TABLE
_PER_UNIT = float(RADIAL_STEPS)

_CHORD = 9
_STEPS = 12
_SHAPES = 8
# Tukey's function: beyond this many standard deviations an observation has no weight.
_TUKEY = 4.7
COARSE, FINE = 12.0, 6.0
"""Deviations up to which observations count at first, for a rough and for a good start."""
# The solver has converged where no height changes by more [m]; places of touch are looked for in
# every third round.
_CONVERGED = 3e-6
_NARROWER = 0.6
_MANY_RAYS = 20
_AGAIN = 3
# The edge's neighbourhood, and how far below a crest the middle of its fade is seen [rows]; the
# second as measured on rendered crests of all curvatures, and its relative standard deviation.
_NEIGHBOURHOOD = 3.5
_FADE = 1.0
_FADE_DOUBT = 0.35
# Weight with which the share of the fade is held at none or all of it.
_HELD = 1e9


@compiled
def _radial(square):  # type: ignore[no-untyped-def]
    """Radial parts of first, second, mean and double shape, by ρ²."""
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
    """All shapes' heights at a place in radii."""
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
def _clearance(near, far, part, heights):  # type: ignore[no-untyped-def]
    """Surface above the ray at a part of the way from the front to the rear wall [m]."""
    x = near[0] + part * (far[0] - near[0])
    y = near[1] + part * (far[1] - near[1])
    first, second, mean, double = _radial(x * x + y * y)
    height = heights[0] + mean * heights[5]
    height += first * (heights[1] * x + heights[2] * y)
    height += second * (heights[3] * x + heights[4] * y)
    height += double * (heights[6] * (x * x - y * y) + heights[7] * 2.0 * x * y)
    return height - near[2] - part * (far[2] - near[2])


@compiled
def _shapes_on_ray(near, far, part, out):  # type: ignore[no-untyped-def]
    """All shapes' heights at a part of the way."""
    _shapes(near[0] + part * (far[0] - near[0]), near[1] + part * (far[1] - near[1]), out)


@compiled
def touch(near, far, radius, fade, heights):  # type: ignore[no-untyped-def]
    """Where the surface comes closest to a ray from below, or rises most above it.

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
        values[k] = _clearance(near, far, k / (_CHORD - 1.0), heights)
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
        hidden = _FADE * fade * (1.0 - slope / further)
    return part, _clearance(near, far, part, heights), hidden


@entry_point(float64[::1](GIVEN_3, GIVEN_3, given(int64, 1), float64, float64, GIVEN_1))
def silhouette_rows(near, far, bottom, radius, fade, heights):  # type: ignore[no-untyped-def]
    """Row on each line at which the surface of given heights ends against the background.

    Args:
        near, far: (J, M, 3) ends of every sample's ray: x, y in radii, z [m]; NaN: none.
        bottom: (M,) row that certainly shows liquid.
        radius, fade: as for touch.
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


@compiled
def _tukey(ratio, limit):  # type: ignore[no-untyped-def]
    if abs(ratio) >= limit:
        return 0.0
    return (1.0 - (ratio / limit) ** 2) ** 2


@compiled
def _dot(shapes, heights):  # type: ignore[no-untyped-def]
    """Height of a surface; for so few numbers a library call would cost more than the sum."""
    total = 0.0
    for k in range(_SHAPES):
        total += shapes[k] * heights[k]
    return total


@compiled
def _usual_ratio(near, far, ray_scale, radius, fade, heights):  # type: ignore[no-untyped-def]
    """One and a half times the rays' median deviation from a surface; 0 where they are few.

    A surface fitted to the front line alone may lie far below the edge behind it, which most rays
    agree on.
    """
    ratios = np.empty(ray_scale.size)
    count = 0
    for i in range(ray_scale.size):
        if not np.isnan(far[i, 0]):
            _, top, hidden = touch(near[i], far[i], radius, fade, heights)
            ratios[count] = abs(top - hidden) / ray_scale[i]
            count += 1
    return 1.5 * np.median(ratios[:count]) if count >= _MANY_RAYS else 0.0


@compiled
def _one_sided(ratio):  # type: ignore[no-untyped-def]
    """Weight of a height that the surface has at least."""
    return 1.0 if ratio < 0.0 else 0.0


@compiled
def _add(normal, right, shapes, error, weight):  # type: ignore[no-untyped-def]
    """One observation's part of the normal equations, the lower triangle."""
    for k in range(_SHAPES):
        scaled = weight * shapes[k]
        right[k] -= scaled * error
        for j in range(k + 1):
            normal[k, j] += scaled * shapes[j]


@compiled
def _begin(normal, right, heights, centre, precision, share_error, share_precision):  # type: ignore[no-untyped-def]
    """The prior's part of the normal equations, of the heights and of the share."""
    for k in range(_SHAPES):
        right[k] = 0.0
        for j in range(_SHAPES):
            right[k] += precision[k, j] * (centre[j] - heights[j])
        for j in range(k + 1):
            normal[k, j] = precision[k, j]
        normal[_SHAPES, k] = 0.0
    normal[_SHAPES, _SHAPES] = share_precision
    right[_SHAPES] = share_precision * share_error


@compiled
def _factorized(normal, held, factor):  # type: ignore[no-untyped-def]
    """Cholesky's factor of the normal matrix, with more weight on the share where it is held."""
    for k in range(_SHAPES + 1):
        for j in range(k + 1):
            factor[k, j] = normal[k, j]
    factor[_SHAPES, _SHAPES] += held
    factorize(factor, _SHAPES + 1)
    return factor


@compiled
def _solved(factor, right, step):  # type: ignore[no-untyped-def]
    """Step that solves the normal equations."""
    for k in range(_SHAPES + 1):
        step[k] = right[k]
    substitute(factor, _SHAPES + 1, step)


@compiled
def _inverse(factor):  # type: ignore[no-untyped-def]
    """The inverse of the normal matrix, column by column."""
    columns = np.zeros((_SHAPES + 1, _SHAPES + 1))
    for k in range(_SHAPES + 1):
        columns[k, k] = 1.0
        substitute(factor, _SHAPES + 1, columns[k])
    return columns


@compiled
def _move(heights, step):  # type: ignore[no-untyped-def]
    """Adds the step to the heights."""
    for k in range(_SHAPES):
        heights[k] += step[k]


@compiled
def _largest(step):  # type: ignore[no-untyped-def]
    """By how much a height changes at most."""
    largest = 0.0
    for k in range(_SHAPES):
        largest = max(largest, abs(step[k]))
    return largest


@entry_point(
    Tuple((float64[::1], float64[:, ::1], *5 * [float64[::1]]))(
        GIVEN_2, GIVEN_1, GIVEN_1, given(boolean, 1), GIVEN_2, GIVEN_2, GIVEN_1, float64, float64,
        GIVEN_1, GIVEN_1, GIVEN_2, float64, float64, float64,
    )
)  # fmt: skip
def solve(  # type: ignore[no-untyped-def]
    front, front_height, front_scale, front_bound, near, far, ray_scale, radius, fade,
    start, centre, precision, share, share_spread, coarse,
):  # fmt: skip
    """Iterated reweighted least squares with a Gaussian prior.

    Args:
        front: (N, SHAPES) shapes at the front points.
        front_height: (N,) [m]; NaN where there is none. front_scale: (N,) deviation [m].
        front_bound: (N,) whether the surface may be higher there.
        near, far: (M, 3) ends of the rays that the surface touches; NaN where there is none.
        ray_scale: (M,) deviation [m].
        radius, fade: as for touch.
        start: (SHAPES,) first guess of the heights [m].
        centre, precision: (SHAPES,) mean [m] and (SHAPES, SHAPES) inverse covariance of the prior.
        share, share_spread: of the fade that crests show, the prior's mean and standard deviation.
        coarse: deviations up to which observations count at first; more where the start is rough.

    Returns:
        heights and share (SHAPES + 1,) [m, 1], the inverse of their normal matrix, residuals and
        weights of the front (N,) and of the rays (M,), and the rays' place of touch (M,).
    """
    heights = start.copy()
    n, m = front_height.size, ray_scale.size
    front_error, front_weight = np.full(n, np.nan), np.zeros(n)
    ray_error, ray_weight, part = np.full(m, np.nan), np.zeros(m), np.full(m, np.nan)
    shapes = np.empty(_SHAPES)
    normal = np.zeros((_SHAPES + 1, _SHAPES + 1))
    factor = np.zeros((_SHAPES + 1, _SHAPES + 1))
    right, step = np.empty(_SHAPES + 1), np.empty(_SHAPES + 1)
    share_centre, share_precision = share, share_spread**-2
    hidden = np.zeros(m)
    limit = max(coarse, _TUKEY, _usual_ratio(near, far, ray_scale, radius, fade, heights))
    for round in range(_STEPS):
        doubt = share_centre - share
        _begin(normal, right, heights, centre, precision, doubt, share_precision)
        for i in range(n):
            if np.isnan(front_height[i]):
                continue
            front_error[i] = _dot(front[i], heights) - front_height[i]
            ratio = front_error[i] / front_scale[i]
            front_weight[i] = _one_sided(ratio) if front_bound[i] else _tukey(ratio, limit)
            weight = front_weight[i] / front_scale[i] ** 2
            _add(normal, right, front[i], front_error[i], weight)
        for i in range(m):
            if np.isnan(far[i, 0]):
                continue
            # The place of touch hardly moves, and moving it changes nothing to first order.
            if round % _AGAIN == 0:
                part[i], top, hidden[i] = touch(near[i], far[i], radius, fade, heights)
            else:
                top = _clearance(near[i], far[i], part[i], heights)
            _shapes_on_ray(near[i], far[i], part[i], shapes)
            ray_error[i] = top - share * hidden[i]
            variance = ray_scale[i] ** 2 + (_FADE_DOUBT * hidden[i]) ** 2
            ray_weight[i] = _tukey(ray_error[i] / np.sqrt(variance), limit)
            weight = ray_weight[i] / variance
            _add(normal, right, shapes, ray_error[i], weight)
            right[_SHAPES] += weight * hidden[i] * ray_error[i]
            normal[_SHAPES, _SHAPES] += weight * hidden[i] ** 2
            for k in range(_SHAPES):
                normal[_SHAPES, k] -= weight * hidden[i] * shapes[k]
        _solved(_factorized(normal, 0.0, factor), right, step)
        free = share + step[_SHAPES]
        if free < 0.0 or free > 1.0:
            # Solved anew for the share that is nearest, so that the heights go with it.
            right[_SHAPES] += _HELD * (min(max(free, 0.0), 1.0) - share)
            _solved(_factorized(normal, _HELD, factor), right, step)
        _move(heights, step)
        share += step[_SHAPES]
        if limit == _TUKEY and _largest(step) < _CONVERGED:
            break
        limit = max(_TUKEY, _NARROWER * limit)
    found = np.zeros(_SHAPES + 1)
    _move(found, heights)
    found[_SHAPES] = share
    inverse = _inverse(_factorized(normal, 0.0, factor))
    return found, inverse, front_error, front_weight, ray_error, ray_weight, part


@entry_point(float64[:, ::1](GIVEN_2))
def shapes_of(near):  # type: ignore[no-untyped-def]
    """Heights (N, SHAPES) of all shapes at places (N, 3), x and y in radii."""
    shapes = np.empty((near.shape[0], _SHAPES))
    for i in range(near.shape[0]):
        _shapes(near[i, 0], near[i, 1], shapes[i])
    return shapes


@entry_point(float64[:, ::1](GIVEN_1))
def wall_shapes_of(azimuth):  # type: ignore[no-untyped-def]
    """Heights (N, SHAPES) of all shapes on the wall, by azimuth (N,) [rad]."""
    shapes = np.empty((azimuth.size, _SHAPES))
    for i in range(azimuth.size):
        _shapes(np.cos(azimuth[i]), np.sin(azimuth[i]), shapes[i])
    return shapes


@entry_point(boolean[::1](GIVEN_2, GIVEN_2, float64, float64, GIVEN_1))
def above_ray(near, far, radius, fade, heights):  # type: ignore[no-untyped-def]
    """Whether a surface is seen above each ray (M, 3) to (M, 3); not where there is none."""
    above = np.zeros(near.shape[0], np.bool_)
    for i in range(near.shape[0]):
        if not np.isnan(far[i, 0]):
            _, top, hidden = touch(near[i], far[i], radius, fade, heights)
            above[i] = top > hidden
    return above


@entry_point(
    Tuple((float64[::1], float64[::1], boolean[::1]))(
        given(int64, 1), GIVEN_1, GIVEN_1, int64, GIVEN_1, int64
    )
)
def around_the_wall(index, residual, trust, bins, kernel, near):  # type: ignore[no-untyped-def]
    """Residuals of points on a closed curve, spread over their neighbourhood.

    Args:
        index: (N,) bin of each point. residual: (N,) [m]. trust: (N,) weight of each.
        bins: of the curve.
        kernel: weights of the neighbours, of odd length.
        near: as long as the part of the curve for which a point stands.

    Returns:
        (bins,) weighted sums of the residuals [m], sums of the weights, and whether a point is
        near.
    """
    half, reach = kernel.size // 2, near // 2
    edge = max(half, reach)
    # Both ends are continued by the other, so that no neighbour needs to be wrapped.
    sums, counts = np.zeros(bins + 2 * edge), np.zeros(bins + 2 * edge)
    for p in range(index.size):
        for place in (index[p] + edge, index[p] + edge - bins, index[p] + edge + bins):
            if 0 <= place < sums.size:
                sums[place] += trust[p] * residual[p]
                counts[place] += trust[p]
    total, count = np.zeros(bins), np.zeros(bins)
    seen = np.zeros(bins, np.bool_)
    for b in range(bins):
        for k in range(-half, half + 1):
            total[b] += kernel[k + half] * sums[b + edge + k]
            count[b] += kernel[k + half] * counts[b + edge + k]
        for k in range(-reach, reach + 1):
            seen[b] |= counts[b + edge + k] > 0.0
    return total, count, seen
