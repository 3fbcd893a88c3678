"""Finds a container by its two sides, which determine its axis; then finds the liquid level.

Made for photographs of tall glass, where print, reflections and a meniscus have more edges than
the level has. What is on the wall is compared at all heights before one of them is the level.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import Curve, SeenCurve, view_at
from slosh_camera.calibrate.edges import EdgeImage, UprightLine, find_edges, upright_lines
from slosh_camera.calibrate.pose import Axis, CameraPlace
from slosh_camera.calibrate.search import axis_of_lines, height_through
from slosh_camera.calibrate.strip import (
    Strip,
    lasting_changes,
    level_like,
    lines_across,
    own_lines,
    rear_above,
    slopes_of,
    unrolled,
    walls_below,
)
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup, CupView

FloatArray = NDArray[np.float64]

_STEPS = 2


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Approximate pose of a container and its liquid level in an image.

    Attributes:
        place: of the camera.
        curves: edges on its two sides, and on the level's contact line, in the middle of its
            meniscus.
    """

    place: CameraPlace
    curves: tuple[SeenCurve, ...]


@dataclass(frozen=True, slots=True)
class _Line:
    """A line on the wall that may be the liquid's level, with its features.

    Attributes:
        height: where it is [m].
        low: from where on the surface would be seen through the front wall [m].
        high: up to where [m].
        beats: its strength over that of the strongest line elsewhere.
        line: how much of it shows, 0 to 1.
        of_inside: the same as a part of what shows of the clearest line within the surface.
        above: strength of the strongest line in the glass above, over its own.
        within: its strongest row lies where the level can be. Otherwise it is the flank of a line
            that is out of reach, e.g. of a ring or of a level near a foot that hides the sides.
    """

    height: float
    low: float
    high: float
    beats: float
    line: float
    of_inside: float
    above: float
    within: bool


def find_outline(
    edges: EdgeImage, camera: PinholeCamera, cup: Cup, level: tuple[float, float] | None = None
) -> Outline | None:
    """Finds the best pair of container sides in an image, and the liquid level between them.

    Args:
        edges: the image, without distortion.
        camera: its camera, without distortion.
        level: a pixel on the contact line of the still level; None: not told.

    Returns:
        Both; None where there are no two sides, the liquid is shallow, or no line between the
        sides looks like a level.

    Raises:
        SloshCameraError: two lines may be the level.
    """
    found = _sides(edges, camera, cup)
    if found is None:
        return None
    axis, sides = found
    # Heights count from where the axis is nearest to the camera.
    place = axis.place(0.0)
    try:
        view = view_at(camera, cup, place)
    except SloshCameraError:  # no container can stand so
        return None
    low, high = _extent(view, camera)
    if not high > low:
        return None
    strip = unrolled(edges, view, low, high)
    if strip.heights.size < TUNING.least_strip:
        return None
    if level is None and cup.fill_height < TUNING.least_fill * cup.radius:
        return None
    if level is not None:
        heights = -height_through(camera, cup, axis, level)
        line = lines_across(edges, strip)
        middles = [_middle(line, strip.heights, float(one), cup, place) for one in heights]
        heights = np.array(middles, dtype=np.float64)
    else:
        heights = _level(edges, view, strip, place)
    if heights.size == 0:
        return None
    height = float(heights[0])
    front = _front(edges, strip, height, cup)
    return None if front is None else Outline(axis.place(-height), (*sides, front))


def _sides(
    edges: EdgeImage, camera: PinholeCamera, cup: Cup
) -> tuple[Axis, tuple[SeenCurve, SeenCurve]] | None:
    """Returns the two lines that are most likely the container's sides, and their axis."""
    rows, columns = edges.shape
    lines = upright_lines(edges, TUNING.lines, TUNING.least_line * rows)
    support = edges.support(edges.across).astype(np.float32)
    support = np.asarray(cv2.dilate(support, np.ones((1, 5), np.uint8)), np.float32)
    shown = [_along(support, line) for line in lines]
    best, found = TUNING.least_rows * rows, None
    for pair in combinations(sorted(range(len(lines)), key=lambda i: lines[i].column), 2):
        left, right = (lines[index] for index in pair)
        both = np.minimum(*(shown[index] for index in pair))
        if right.column - left.column < TUNING.least_width * columns or both.sum() <= best:
            continue
        axis = axis_of_lines(left, right, camera, cup)
        if axis is not None:
            best, found = float(both.sum()), (axis, left, right, both)
    if found is None:
        return None
    axis, left, right, both = found
    v = np.flatnonzero(both >= TUNING.shown)[:: TUNING.row_spacing].astype(np.float64)
    return axis, (_side(edges, left, v, Curve.LEFT), _side(edges, right, v, Curve.RIGHT))


def _side(edges: EdgeImage, line: UprightLine, v: FloatArray, curve: Curve) -> SeenCurve:
    """Detects edges along a container side in the given image rows (N,)."""
    u = line.column + line.lean * (v - 0.5 * (edges.shape[0] - 1))
    outwards = np.array([1.0, -line.lean]) / np.hypot(1.0, line.lean)
    normals = np.tile(outwards if curve is Curve.RIGHT else -outwards, (v.size, 1))
    seen = find_edges(edges, np.column_stack((u, v)), normals, TUNING.side_reach, outermost=False)
    kept = seen.slope > 0.0
    return SeenCurve(curve, seen.pixels[kept], normals[kept], seen.slope[kept], v.size)


def _along(support: NDArray[np.float32], line: UprightLine) -> FloatArray:
    """Returns the edge strength along a line in each image row, (rows,); 0 outside the image."""
    rows, columns = support.shape
    v = np.arange(rows)
    u = np.rint(line.column + line.lean * (v - 0.5 * (rows - 1))).astype(int)
    inside = (u >= 0) & (u < columns)
    return np.where(inside, support[v, np.where(inside, u, 0)], 0.0)


def _extent(view: CupView, camera: PinholeCamera) -> tuple[float, float]:
    """Returns the lowest and highest height of the front wall that the image shows [m]."""
    distance = float(np.hypot(*view.pose.camera_centre[:2]))
    heights = np.linspace(-TUNING.outline_reach, TUNING.outline_reach, 1201) * distance
    azimuth = view.camera_azimuth
    across = view.cup.radius * np.array([np.cos(azimuth), np.sin(azimuth)])
    points = np.column_stack((*np.broadcast_arrays(across[0], across[1], heights),))
    u, v = view.project(points).T
    inside = (u >= 1.0) & (u <= camera.width - 2.0) & (v >= 1.0) & (v <= camera.height - 2.0)
    seen = heights[inside]
    return (float(seen[0]), float(seen[-1])) if seen.size else (0.0, 0.0)


def _level(edges: EdgeImage, view: CupView, strip: Strip, place: CameraPlace) -> FloatArray:
    """Finds the height of the liquid level, (1,) [m]; empty if no line looks like a level.

    Raises:
        SloshCameraError: two do.
    """
    cup, heights = view.cup, strip.heights
    line, strength, rivals, in_glass, anywhere = _strengths(edges, view, strip, place)
    found, apart = [], TUNING.peaks_apart * cup.radius
    for index in _peaks(strength, heights, apart):
        height = float(heights[index])
        out_of_reach = (np.abs(heights - height) < apart) & (strength == 0.0)
        rear = float(rear_above(cup, place, height))
        slack = TUNING.one_line * cup.radius
        low, high = height + min(rear, 0.0) - slack, height + max(rear, 0.0) + slack
        inside = (heights >= low) & (heights <= high)
        found.append(
            _Line(
                height,
                low,
                high,
                float(strength[index] / np.max(rivals, initial=1e-9, where=~inside)),
                float(line[index]),
                float(line[index] / line[inside].max()),
                float(np.max(in_glass, initial=0.0, where=heights > high) / strength[index]),
                bool(np.max(anywhere, initial=0.0, where=out_of_reach) <= strength[index]),
            )
        )
    if not found:
        return np.empty(0)
    # A surface seen from above or below holds images of the wall and of its own edge.
    whole = [
        one
        for one in found
        if one.within
        and one.beats >= 1.0 / TUNING.rival
        and one.of_inside >= TUNING.of_inside
        and one.above < TUNING.rival
    ]
    for one in whole:
        outer = [it for it in found if it is not one and it.low <= one.height <= it.high]
        outer = [it for it in outer if not one.low <= it.height <= one.high]
        if not any(it.line >= TUNING.rival * one.line for it in outer):
            front = _foremost(one, whole, TUNING.one_line * cup.radius)
            return np.array([_middle(strength, heights, front, cup, place)])
    raise SloshCameraError(
        "still image: two levels are possible; printed rings, seams and the edge of a foot look "
        "similar; click on the still level's contact line: --level U V"
    )


def _foremost(one: _Line, lines: list[_Line], reach: float) -> float:
    """Returns the front contact line's height [m], even if the rear contact line is clearer.

    From below the nearest line is the highest: the top of the meniscus and not the level.
    """
    if one.high - one.height <= one.height - one.low:
        return one.height
    near = [it for it in lines if abs(it.height - one.height) <= reach]
    return min(it.height for it in near if it.line >= TUNING.rival * one.line)


def _strengths(
    edges: EdgeImage, view: CupView, strip: Strip, place: CameraPlace
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Returns for each wall height how much of a line is there and how like a level it looks.

    Returns:
        How much of a line is there; how much it looks like the level, where that can be; the same
        where it may be if the fill height was told too roughly; wherever there is glass above and
        below; and anywhere.
    """
    cup, heights = view.cup, strip.heights
    fill = cup.fill_height
    line = own_lines(edges, view, strip)
    depth = max(fill, TUNING.least_glass_height * cup.radius)
    walled = walls_below(edges, view, heights, 0.0, depth)
    glass = (
        walls_below(
            edges,
            view,
            heights,
            -TUNING.glass[1] * cup.radius,
            (TUNING.glass[1] - TUNING.glass[0]) * cup.radius,
        )
        >= TUNING.walled
    )
    changes = lasting_changes(strip, cup, place)
    short = walls_below(edges, view, heights, 0.0, TUNING.least_glass_height * cup.radius)
    change = np.where(glass & (short >= TUNING.walled), changes, 0.0)
    in_glass = np.where(change > 0.0, level_like(line, change, float(change.max())), 0.0)
    # The sides end about where the fill height has the floor.
    allowed = glass & (walled >= TUNING.may_be_walled)
    stretch = max(
        (TUNING.below_to - TUNING.below_from) * fill, TUNING.least_glass_height * cup.radius
    )
    allowed &= walls_below(edges, view, heights, TUNING.below_from * fill, stretch) < TUNING.below
    change = np.where(allowed, changes, 0.0)
    strength = level_like(line, change, float(change.max()))
    likely = allowed & (walled >= TUNING.walled)
    return (
        np.where(allowed, line, 0.0),
        np.where(likely, strength, 0.0),
        np.where(allowed, strength, 0.0),
        in_glass,
        level_like(line, changes, float(change.max())),
    )


def _peaks(strength: FloatArray, heights: FloatArray, apart: float) -> list[int]:
    """Returns indices of the strongest maxima that are at least `apart` away from each other."""
    left, peaks = strength.copy(), []
    while left.max() >= TUNING.least_level:
        peaks.append(int(np.argmax(left)))
        left[np.abs(heights - heights[peaks[-1]]) < apart] = 0.0
    return peaks


def _middle(
    strength: FloatArray, heights: FloatArray, middle: float, cup: Cup, place: CameraPlace
) -> float:
    """Returns the mean height of the edges near a height, without the rear contact line's [m]."""
    rear = float(rear_above(cup, place, middle))
    reach = TUNING.band * cup.radius
    up, down = (TUNING.upwards if rear > 0.0 else TUNING.from_below) * reach, reach
    if rear > TUNING.one_line * cup.radius:
        up = min(up, TUNING.to_rear * rear)
    elif rear < -TUNING.one_line * cup.radius:
        down = min(down, -TUNING.to_rear * rear)
    for _ in range(_STEPS):
        near = (heights >= middle - down) & (heights <= middle + up)
        middle = float(np.average(heights[near], weights=strength[near] ** 2))
    return middle


def _front(edges: EdgeImage, strip: Strip, height: float, cup: Cup) -> SeenCurve | None:
    """Detects the front contact line as the mean position of the edges in each column."""
    near = np.flatnonzero(np.abs(strip.heights - height) <= TUNING.band * cup.radius)
    if near.size < 3:
        return None
    slope = slopes_of(strip)[near]
    weight = np.where(slope > 0.5 * edges.reference, edges.support(slope), 0.0)
    total = weight.sum(axis=0)
    seen = total > 0.0
    if not np.any(seen):
        return None
    share = weight[:, seen] / total[seen]
    # The lines of all columns together tell the height, and each column how far it is off.
    away = (share * (strip.heights[near] - height)[:, np.newaxis]).sum(axis=0)
    most = TUNING.wander * cup.radius
    at = height + np.clip(_steady(away - np.median(away)), -most, most)
    rows = np.interp(at, strip.heights, np.arange(strip.heights.size))
    pixels = strip.pixels[:, seen].astype(np.float64)
    lower = np.clip(rows.astype(int), 0, len(pixels) - 2)
    part, column = (rows - lower)[:, np.newaxis], np.arange(rows.size)
    middle = (1.0 - part) * pixels[lower, column] + part * pixels[lower + 1, column]
    normals = np.tile([0.0, -1.0], (len(middle), 1))
    return SeenCurve(Curve.FRONT, middle, normals, slope.max(axis=0)[seen], slope.shape[1])


def _steady(values: FloatArray) -> FloatArray:
    """Applies a running median over five values (N,), which removes outliers."""
    padded = np.pad(values, 2, "edge")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1))
