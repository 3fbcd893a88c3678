"""Features of a container's front wall, unrolled to a plane: lines, colour changes and sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import sides_of
from slosh_camera.calibrate.edges import EdgeImage
from slosh_camera.calibrate.pose import CameraPlace
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.optics.cup import Cup, CupView

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]
FloatOrArray = TypeVar("FloatOrArray", float, FloatArray)

# Sectors of the front wall that are looked at, and columns of each.
_SECTORS, _COLUMNS = 5, 5
# The colours compared lie so far above and below a line, in radii: the change is at the line, and
# it lasts.
_WINDOWS = ((0.06, 0.2), (0.15, 0.7))
# The same for the steps along a line: each pair clears a ring or a meniscus of another thickness.
_NEAR_WINDOWS = ((0.03, 0.08), (0.06, 0.12), (0.09, 0.16), (0.12, 0.25))
# Where liquid shows below its meniscus, in radii from the level, and the part of the rows that may
# be more uneven than told.
_BELOW = (0.05, 0.2)
_UNEVEN_ROWS = 10.0
# What is compared below and above a level, in radii from it, without the rear line: as a part of
# its distance, the surface before it where that is wide enough, otherwise what is behind it.
_PARTED, _BEFORE_REAR, _WIDE_SURFACE, _BEHIND_REAR = 0.5, 0.6, 0.1, 1.3
_MOST_ROWS = 3000
# Where a line that goes on beside the container is looked for, in outer radii from the axis: an
# edge of a table behind it.
_BESIDE = (1.2, 1.3, 1.4, 1.5)


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """Unrolled front wall: pixels (N, M, 2), colours (N, M, channels), heights (N,) [m]."""

    heights: FloatArray
    pixels: Float32Array
    colours: Float32Array


def unrolled(edges: EdgeImage, view: CupView, low: float, high: float) -> Strip:
    """Unrolls the front wall between two heights [m], with about one row per pixel."""
    cup = view.cup
    left, right = sides_of(view)
    step = 2.0 * cup.radius / float(np.hypot(*(right - left)))
    first, last = np.clip((np.floor(low / step), np.ceil(high / step)), -_MOST_ROWS, _MOST_ROWS)
    heights = step * np.arange(first, last + 1.0)
    azimuth = view.camera_azimuth + np.linspace(-TUNING.arc, TUNING.arc, _SECTORS * _COLUMNS)
    shape = (heights.size, azimuth.size)
    points = np.empty((*shape, 3))
    radius = cup.radius_at(heights)[:, np.newaxis]
    points[..., 0] = radius * np.cos(azimuth)
    points[..., 1] = radius * np.sin(azimuth)
    points[..., 2] = heights[:, np.newaxis]
    pixels = view.project(points.reshape(-1, 3)).reshape(*shape, 2).astype(np.float32)
    rows, columns = edges.shape
    inside = np.all((pixels >= 1.0) & (pixels <= (columns - 2.0, rows - 2.0)), axis=2)
    where = np.where(inside[..., np.newaxis], pixels, 0.0).astype(np.float32)
    # OpenCV's types do not know that one map may hold both coordinates.
    colours = cv2.remap(  # type: ignore[call-overload]
        edges.smooth, where, None, cv2.INTER_LINEAR
    ).reshape(*shape, -1)
    colours[~inside] = np.nan
    return Strip(heights, pixels, np.asarray(colours, np.float32))


def lines_across(edges: EdgeImage, strip: Strip) -> FloatArray:
    """Returns how continuously an edge crosses the wall at each height (N,), from 0 to 1."""
    support = edges.support(slopes_of(strip)).astype(np.float32)
    support = np.asarray(
        cv2.dilate(support, np.ones((2 * TUNING.strip_slack + 1, 1), np.uint8)), np.float32
    )
    return _of_weakest(support.reshape(len(support), _SECTORS, _COLUMNS).mean(axis=2))


def _of_weakest(sectors: Float32Array) -> FloatArray:
    """Returns the mean (N,) of the two sectors of (N, _SECTORS) where the value is smallest."""
    return np.asarray(np.sort(sectors, axis=1)[:, :2].mean(axis=1), np.float64)


def steps_along(strip: Strip, radius: float) -> FloatArray:
    """Returns the colour change (N,) at each height itself, all along the wall [grey levels].

    Unlike `lasting_changes` it is that of the front contact line alone, and the smallest near the
    line and away from it, so that a ring that lies close to a level has none.
    """
    size = float(strip.heights[1] - strip.heights[0])
    index = np.arange(strip.heights.size)
    least = np.full(index.size, np.inf)
    for window in _NEAR_WINDOWS:
        near = max(round(window[0] * radius / size), 1)
        far = max(round(window[1] * radius / size), near + 1)
        middles = _row_medians(strip.colours, far - near + 1)
        above = middles[np.minimum(index + near, index.size - 1)]
        step = middles[np.maximum(index - far, 0)] - above
        sectors = np.median(step.reshape(index.size, _SECTORS, _COLUMNS, -1), axis=2)
        change = np.abs(np.nan_to_num(sectors)).max(axis=2)
        least = np.minimum(least, _of_weakest(change))
    return least


def unevenness_below(strip: Strip, radius: float) -> float:
    """Returns how much neighbouring columns just below height 0 differ [grey levels]."""
    low, high = (-share * radius for share in reversed(_BELOW))
    colours = strip.colours[(strip.heights > low) & (strip.heights < high)]
    if not colours.size:
        return 0.0
    bend = colours[:, 1:-1] - 0.5 * (colours[:, :-2] + colours[:, 2:])
    rows = np.median(np.abs(np.nan_to_num(bend)).max(axis=2), axis=1)
    return float(np.percentile(rows, 100.0 - _UNEVEN_ROWS))


def misplaced_colours(strip: Strip, cup: Cup, place: CameraPlace) -> FloatArray:
    """Returns how much of the wall does not look like its side of a level at each height (N,) [m].

    Below the liquid's level is one colour and above it another. A ring or a bubble has neither and
    counts by its thickness, wherever the level is; what lies between a level that is believed and
    the true one counts for the believed one alone.

    Args:
        strip: about the level of the pose, from below.
        cup: the container.
        place: the camera's place.

    Returns:
        Mean thickness; inf away from the level of the pose.
    """
    near = np.flatnonzero(np.abs(strip.heights) <= _PARTED * cup.radius)
    heights, step = strip.heights[near], float(strip.heights[1] - strip.heights[0])
    split = strip.colours[near].reshape(near.size, _SECTORS, _COLUMNS, -1)
    colours = np.median(split, axis=2)
    azimuths = np.linspace(-TUNING.arc, TUNING.arc, _SECTORS * _COLUMNS)
    amiss = np.zeros(near.size)
    for sector, azimuth in enumerate(azimuths.reshape(_SECTORS, _COLUMNS).mean(axis=1)):
        rear = rear_above(cup, place, 0.0) * float(np.cos(azimuth))
        used = np.ones(near.size, dtype=bool)
        if _BEFORE_REAR * rear >= _WIDE_SURFACE * cup.radius:
            used = heights <= _BEFORE_REAR * rear
        elif rear > 0.0:
            used = (heights <= 0.0) | (heights >= _BEHIND_REAR * rear)
        seen = colours[used, sector]
        rows = np.searchsorted(np.flatnonzero(used), np.arange(near.size))
        by_row = [_unlike(seen[:row]) + _unlike(seen[row:]) for row in range(len(seen) + 1)]
        amiss += step * np.array(by_row)[rows] / _SECTORS
    thickness = np.full(strip.heights.size, np.inf)
    thickness[near] = amiss
    return thickness


def _unlike(colours: Float32Array) -> float:
    """Returns how many of the rows (N, channels) do not have the usual colour."""
    known = colours[~np.isnan(colours).any(axis=1)]
    if not len(known):
        return 0.0
    away = np.abs(known - np.median(known, axis=0)).max(axis=1)
    return float(np.minimum(away / TUNING.other_colour, 1.0).sum())


def own_lines(edges: EdgeImage, view: CupView, strip: Strip) -> FloatArray:
    """Returns `lines_across`, reduced for lines that continue beside the container."""
    return lines_across(edges, strip) * (1.0 - TUNING.behind * beside(edges, view, strip.heights))


def level_like(line: FloatArray, change: FloatArray, largest: float) -> FloatArray:
    """Returns how likely each height (N,) is the liquid level, from 0 to 1.

    Args:
        line: (N,) how much of a line is there, 0 to 1.
        change: (N,) of the colour, that lasts [grey levels].
        largest: of the changes where a level can be [grey levels]. Where one line parts two
            colours, a ring's small change is none.
    """
    full = max(TUNING.full_step, TUNING.of_largest * largest)
    return line * (TUNING.line_alone + (1.0 - TUNING.line_alone) * np.minimum(change / full, 1.0))


def slopes_of(strip: Strip) -> FloatArray:
    """Returns the colour change between adjacent rows (N, M) [grey levels/px]."""
    apart = np.hypot(*np.moveaxis(np.gradient(strip.pixels, axis=0), 2, 0))
    slope = np.abs(np.gradient(strip.colours, axis=0)).max(axis=2) / np.maximum(apart, 1e-3)
    return np.nan_to_num(np.asarray(slope, np.float64))


def lasting_changes(strip: Strip, cup: Cup, place: CameraPlace) -> FloatArray:
    """Returns the colour change across each height that lasts beyond it [grey levels]."""
    step = float(strip.heights[1] - strip.heights[0])
    rear = np.maximum(rear_above(cup, place, strip.heights), 0.0) / step
    change = np.full(strip.heights.size, np.inf)
    for window in _WINDOWS:
        near, far = (max(round(share * cup.radius / step), 1) for share in window)
        change = np.minimum(change, _change(strip.colours, rear, near, far))
    return change


def beside(edges: EdgeImage, view: CupView, heights: FloatArray) -> FloatArray:
    """Returns how much of a line at each height (N,) continues beside the container, 0 to 1."""
    outer = view.cup.radius + view.cup.wall_thickness
    across = np.array([-np.sin(view.camera_azimuth), np.cos(view.camera_azimuth)])
    tall = np.ones((4 * TUNING.strip_slack + 1, 1), np.uint8)
    support = np.asarray(cv2.dilate(edges.support(edges.down).astype(np.float32), tall))
    least = np.ones(heights.size)
    for side in (-1.0, 1.0):
        seen = np.zeros(heights.size)
        for away in _BESIDE:
            place = side * away * outer * across
            points = np.column_stack((*np.broadcast_arrays(place[0], place[1], heights),))
            seen += _values(support, view.project(points)) / len(_BESIDE)
        least = np.minimum(least, seen)
    return least


def _values(chart: NDArray[np.generic], pixels: FloatArray) -> FloatArray:
    """Returns an image map's values at the pixels nearest to positions (N, 2); 0 outside."""
    # OpenCV's types do not know that one map may hold both coordinates.
    found = cv2.remap(  # type: ignore[call-overload]
        np.asarray(chart, np.float32), pixels.astype(np.float32)[:, np.newaxis], None,
        cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT,
    )  # fmt: skip
    return np.asarray(found[:, 0], np.float64)


def _change(colours: Float32Array, rear: FloatArray, near: int, far: int) -> FloatArray:
    """Returns the colour changes (N,) across both contact lines of a level [grey levels].

    Args:
        colours: (N, M, channels) of the strip, from below.
        rear: (N,) rows from the contact line to the rear one.
        near: where the rows begin whose median is taken, from either line.
    """
    middles = _row_medians(colours, far - near + 1)
    index = np.arange(len(colours))
    above = index + rear.astype(int) + near
    known = (above < len(colours)) & (index >= far)
    step = middles[np.maximum(index - far, 0)] - middles[np.minimum(above, len(colours) - 1)]
    change = np.max(np.abs(np.median(step, axis=1)), axis=1)
    return np.where(known, np.nan_to_num(change), 0.0)


def _row_medians(colours: Float32Array, count: int) -> Float32Array:
    """Returns the medians of so many rows from each row on; NaN where there are fewer."""
    middles = np.full(colours.shape, np.nan, np.float32)
    if len(colours) >= count:
        rows = np.lib.stride_tricks.sliding_window_view(colours, count, axis=0)
        middles[: len(rows)] = np.median(rows, axis=-1)
    return middles


def rear_above(cup: Cup, place: CameraPlace, height: FloatOrArray) -> FloatOrArray:
    """Returns how much higher than the front contact line the rear one appears on the wall [m]."""
    return (place.height - height) * 2.0 * cup.radius / (place.distance + cup.radius)


def walls_below(
    edges: EdgeImage, view: CupView, heights: FloatArray, start: float, depth: float
) -> FloatArray:
    """Returns which share of both sides is visible within a depth below each height, 0 to 1."""
    step = float(heights[1] - heights[0])
    count = min(max(round(depth / step), 1), _MOST_ROWS)
    z = np.concatenate((heights[0] - step * np.arange(count, 0, -1.0), heights)) - start
    total = np.concatenate(([0.0], np.cumsum(_sides_seen(edges, view, z))))
    return np.asarray((total[count + 1 :] - total[1 : heights.size + 1]) / count)


def _sides_seen(edges: EdgeImage, view: CupView, z: FloatArray) -> FloatArray:
    """Returns 1 for each height (N,) at which both container sides are visible, otherwise 0."""
    half = view.side_half_angle
    support = edges.support(edges.across).astype(np.float32)
    wide = np.asarray(
        cv2.dilate(support, np.ones((1, 4 * TUNING.strip_slack + 1), np.uint8)), np.float32
    )
    seen = np.ones(z.size)
    for side in (-half, half):
        points = view.cup.outer_points(view.camera_azimuth + side, z)
        seen = np.minimum(seen, _values(wide, view.project(points)) > 0.4)
    return seen
