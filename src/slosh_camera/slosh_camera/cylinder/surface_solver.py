"""Robust fit of surface mode shapes to wall points and silhouettes; compiled.

Two kinds of evidence. A point of the contact line lies on the wall: its height is the surface's
there. An upper edge is a silhouette: along its line of sight from the front to the rear wall the
surface just touches the ray, at the rear wall or at a crest in between. Both are linear in the
shapes' heights, the second for a given place of touch. How much of a crest's fade there is
(`silhouette`) is fitted, too.
"""

from __future__ import annotations

import numpy as np
from numba.types import Tuple, boolean, float64, int64

from slosh_base.compiled.compilation import GIVEN_1, GIVEN_2, compiled, entry_point, given
from slosh_base.compiled.normal_equations import factorize, substitute
from slosh_camera.cylinder.silhouette import clearance, shapes_on_ray, touch
from slosh_camera.cylinder.surface import SHAPES
from slosh_camera.cylinder.tuning import TUNING

_STEPS = 12
_TUKEY = TUNING.tukey
_CONVERGED = TUNING.converged
_NARROWER = TUNING.narrower
_MANY_RAYS = TUNING.many_rays
_AGAIN = 3
_FADE_DOUBT = TUNING.fade_doubt
# Weight with which the share of the fade is held at none or all of it.
_HELD = 1e9


@compiled
def _tukey(ratio, limit):  # type: ignore[no-untyped-def]
    if abs(ratio) >= limit:
        return 0.0
    return (1.0 - (ratio / limit) ** 2) ** 2


@compiled
def _dot(shapes, heights):  # type: ignore[no-untyped-def]
    """Returns the dot product of two short vectors, faster than a library call."""
    total = 0.0
    for k in range(SHAPES):
        total += shapes[k] * heights[k]
    return total


@compiled
def _usual_ratio(near, far, ray_scale, radius, fade, heights):  # type: ignore[no-untyped-def]
    """Returns 1.5 times the median normalised silhouette residual; 0 with too few sight lines.

    A surface fitted to the contact line alone may lie far below the edge behind it, which most
    rays agree on.
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
    """Returns the weight, 1 or 0, of a measurement that only bounds the height from below."""
    return 1.0 if ratio < 0.0 else 0.0


@compiled
def _add(normal, right, shapes, error, weight):  # type: ignore[no-untyped-def]
    """Adds one measurement to the least-squares normal equations (lower triangle only)."""
    for k in range(SHAPES):
        scaled = weight * shapes[k]
        right[k] -= scaled * error
        for j in range(k + 1):
            normal[k, j] += scaled * shapes[j]


@compiled
def _begin(normal, right, heights, centre, precision, share_error, share_precision):  # type: ignore[no-untyped-def]
    """Initialises the normal equations with the Gaussian prior of all unknowns."""
    for k in range(SHAPES):
        right[k] = 0.0
        for j in range(SHAPES):
            right[k] += precision[k, j] * (centre[j] - heights[j])
        for j in range(k + 1):
            normal[k, j] = precision[k, j]
        normal[SHAPES, k] = 0.0
    normal[SHAPES, SHAPES] = share_precision
    right[SHAPES] = share_precision * share_error


@compiled
def _factorized(normal, held, factor):  # type: ignore[no-untyped-def]
    """Computes the Cholesky factor of the normal matrix; a large `held` fixes the last unknown."""
    for k in range(SHAPES + 1):
        for j in range(k + 1):
            factor[k, j] = normal[k, j]
    factor[SHAPES, SHAPES] += held
    factorize(factor, SHAPES + 1)
    return factor


@compiled
def _solved(factor, right, step):  # type: ignore[no-untyped-def]
    """Solves the factorised normal equations for the step of all unknowns."""
    for k in range(SHAPES + 1):
        step[k] = right[k]
    substitute(factor, SHAPES + 1, step)


@compiled
def _inverse(factor):  # type: ignore[no-untyped-def]
    """Returns the inverse of the normal matrix from its Cholesky factor."""
    columns = np.zeros((SHAPES + 1, SHAPES + 1))
    for k in range(SHAPES + 1):
        columns[k, k] = 1.0
        substitute(factor, SHAPES + 1, columns[k])
    return columns


@compiled
def _move(heights, step):  # type: ignore[no-untyped-def]
    """Adds the step of an iteration to the mode amplitudes."""
    for k in range(SHAPES):
        heights[k] += step[k]


@compiled
def _largest(step):  # type: ignore[no-untyped-def]
    """Returns the largest absolute amplitude change in a step."""
    largest = 0.0
    for k in range(SHAPES):
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
    """Solves the robust least-squares fit of a surface with a Gaussian prior.

    Args:
        front: (N, SHAPES) shapes at the front points.
        front_height: (N,) [m]; NaN where there is none. front_scale: (N,) deviation [m].
        front_bound: (N,) whether the surface may be higher there.
        near, far: (M, 3) ends of the rays that the surface touches; NaN where there is none.
        ray_scale: (M,) deviation [m].
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
    shapes = np.empty(SHAPES)
    normal = np.zeros((SHAPES + 1, SHAPES + 1))
    factor = np.zeros((SHAPES + 1, SHAPES + 1))
    right, step = np.empty(SHAPES + 1), np.empty(SHAPES + 1)
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
                top = clearance(near[i], far[i], part[i], heights)
            shapes_on_ray(near[i], far[i], part[i], shapes)
            ray_error[i] = top - share * hidden[i]
            variance = ray_scale[i] ** 2 + (_FADE_DOUBT * hidden[i]) ** 2
            ray_weight[i] = _tukey(ray_error[i] / np.sqrt(variance), limit)
            weight = ray_weight[i] / variance
            _add(normal, right, shapes, ray_error[i], weight)
            right[SHAPES] += weight * hidden[i] * ray_error[i]
            normal[SHAPES, SHAPES] += weight * hidden[i] ** 2
            for k in range(SHAPES):
                normal[SHAPES, k] -= weight * hidden[i] * shapes[k]
        _solved(_factorized(normal, 0.0, factor), right, step)
        free = share + step[SHAPES]
        if free < 0.0 or free > 1.0:
            # Solved anew for the share that is nearest, so that the heights go with it.
            right[SHAPES] += _HELD * (min(max(free, 0.0), 1.0) - share)
            _solved(_factorized(normal, _HELD, factor), right, step)
        _move(heights, step)
        share += step[SHAPES]
        if limit == _TUKEY and _largest(step) < _CONVERGED:
            break
        limit = max(_TUKEY, _NARROWER * limit)
    found = np.zeros(SHAPES + 1)
    _move(found, heights)
    found[SHAPES] = share
    inverse = _inverse(_factorized(normal, 0.0, factor))
    return found, inverse, front_error, front_weight, ray_error, ray_weight, part


@entry_point(
    Tuple((float64[::1], float64[::1], boolean[::1]))(
        given(int64, 1), GIVEN_1, GIVEN_1, int64, GIVEN_1, int64
    )
)
def around_the_wall(index, residual, trust, bins, kernel, near):  # type: ignore[no-untyped-def]
    """Smooths residuals by azimuth over neighbouring azimuths all around the wall.

    Args:
        index: (N,) bin of each point. residual: (N,) [m]. trust: (N,) weight of each.
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
