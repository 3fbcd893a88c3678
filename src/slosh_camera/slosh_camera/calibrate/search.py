"""Coarse search for a round container in an image; yields initial poses for the fit.

Two upright lines give the container's axis, a row gives the still level; what the rest of the
picture then should show is looked up in the derivatives. Light goes straight here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.edges import EdgeImage, UprightLine, upright_lines
from slosh_camera.calibrate.pose import Axis, CameraPlace, axis_from_sides, cone_from_sides
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup

FloatArray = NDArray[np.float64]
Float32Array = NDArray[np.float32]

# Sides found by a vote are too rough for the pitch: it is tried at these differences.
_PITCHES = np.deg2rad((-5.0, -1.7, 1.7, 5.0))
# Weights of the level, the sides of the liquid, the sides above it, and the base.
_WEIGHTS = {"level": 3.0, "liquid": 2.0, "glass": 0.5, "base": 0.7}


@dataclass(frozen=True, slots=True)
class CandidatePlace:
    """An initial camera pose for the fit, with its score.

    Attributes:
        place: the place.
        score: weighted mean of the edges' supports, less what chance gives; at most 1.
        width: of the container in the image [px].
    """

    place: CameraPlace
    score: float
    width: float


@dataclass(frozen=True, slots=True, eq=False)
class _Maps:
    """Strength maps of horizontal and of vertical edges, widened by the search tolerance."""

    level: Float32Array
    upright: Float32Array


def find_candidates(
    edges: EdgeImage,
    camera: PinholeCamera,
    cup: Cup,
    count: int,
    level: tuple[float, float] | None = None,
) -> list[CandidatePlace]:
    """Finds camera poses that roughly agree with the edges of an image.

    Args:
        edges: the image, without distortion.
        camera: its camera, without distortion.
        count: at most so many.
        level: a pixel on the contact line of the still level; None: not told.

    Returns:
        Candidates that differ from one another, the best first; empty where the image has no
        pair of upright lines.
    """
    rows = edges.shape[0]
    lines = upright_lines(edges, TUNING.lines, TUNING.least_line * rows)
    maps = _support_maps(edges)
    found: list[CandidatePlace] = []
    if cup.taper:
        for left, right in _pairs(lines, edges.shape):
            best = _best_cone(maps, camera, cup, (left, right), level)
            found += [best] if best else []
        found.sort(key=lambda candidate: -candidate.score)
        return _distinct(found, count)
    for axis, width in _axes(lines, camera, cup, edges.shape):
        tries = [_best_level(maps, camera, cup, axis.pitched(p), width, level) for p in _PITCHES]
        # The fine fit finds the pitch from any of them.
        found += sorted((t for t in tries if t), key=lambda t: -t.score)[:1]
    found.sort(key=lambda candidate: -candidate.score)
    return _distinct(found, count)


def _support_maps(edges: EdgeImage) -> _Maps:
    level = edges.support(edges.down).astype(np.float32)
    upright = edges.support(edges.across).astype(np.float32)
    tall = np.ones((2 * TUNING.search_slack + 1, 1), np.uint8)
    wide = np.ones((1, 2 * TUNING.search_slack - 1), np.uint8)
    return _Maps(
        np.asarray(cv2.dilate(level, tall), np.float32),
        np.asarray(cv2.dilate(upright, wide), np.float32),
    )


def _axes(
    lines: list[UprightLine], camera: PinholeCamera, cup: Cup, shape: tuple[int, int]
) -> list[tuple[Axis, float]]:
    """Returns axes for pairs of lines as container sides, and the lines' distance apart [px]."""
    axes = []
    for left, right in _pairs(lines, shape):
        axis = axis_of_lines(left, right, camera, cup)
        if axis is not None:
            axes.append((axis, right.column - left.column))
    return axes


def _pairs(
    lines: list[UprightLine], shape: tuple[int, int]
) -> Iterator[tuple[UprightLine, UprightLine]]:
    """Yields pairs of nearly vertical lines that are side by side and far enough apart."""
    for first, second in combinations(lines, 2):
        left, right = sorted((first, second), key=lambda line: line.column)
        shared = min(left.bottom, right.bottom) - max(left.top, right.top)
        if (
            right.column - left.column >= TUNING.least_width * shape[1]
            and shared >= 0.03 * shape[0]
        ):
            yield left, right


def axis_of_lines(
    left: UprightLine, right: UprightLine, camera: PinholeCamera, cup: Cup
) -> Axis | None:
    """Returns the axis of a container whose sides are two lines, or None if impossible."""
    rays = [_line_rays(line, camera) for line in (left, right)]
    axis = axis_from_sides(rays[0], rays[1], cup.radius + cup.wall_thickness)
    if axis is None or axis.distance < 1.5 * cup.radius:
        return None
    place = axis.place(0.0)
    upright = abs(place.pitch) <= TUNING.most_pitch and abs(place.roll) <= TUNING.most_roll
    return axis if upright else None


def _line_rays(line: UprightLine, camera: PinholeCamera) -> FloatArray:
    middle = 0.5 * (camera.height - 1)
    v = np.array([0.25, 1.75]) * middle
    u = line.column + line.lean * (v - middle)
    return np.column_stack(((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(2)))


def _best_level(
    maps: _Maps,
    camera: PinholeCamera,
    cup: Cup,
    axis: Axis,
    width: float,
    level: tuple[float, float] | None,
) -> CandidatePlace | None:
    """Returns the camera pose with the best liquid level on an axis, or through a click."""
    rows = maps.level.shape[0]
    v = np.arange(0.03 * rows, 0.99 * rows, TUNING.row_step)
    slope = (v - camera.cy) / camera.fy
    near = axis.distance - cup.radius
    drop = axis.up[1] - slope * axis.up[2]
    drop = np.where(np.abs(drop) > 1e-6, drop, np.nan)
    heights = near * (axis.forward[1] - slope * axis.forward[2]) / drop
    heights = heights[np.abs(heights) < 3.0 * axis.distance]
    if level is not None:
        heights = height_through(camera, cup, axis, level)
    if heights.size == 0:
        return None
    scores = _scores(maps, camera, cup, axis, heights)
    best = int(np.argmax(scores))
    score = float(scores[best]) - TUNING.search_chance * TUNING.search_slack / width
    return CandidatePlace(axis.place(float(heights[best])), score, width)


def _best_cone(
    maps: _Maps,
    camera: PinholeCamera,
    cup: Cup,
    sides: tuple[UprightLine, UprightLine],
    level: tuple[float, float] | None,
) -> CandidatePlace | None:
    """Returns the camera pose with the best level on a cone with two known sides; None if none."""
    left, right = sides
    cone = cone_from_sides(_line_rays(left, camera), _line_rays(right, camera), cup.taper)
    if cone is None:
        return None
    tip = float(cup.outer_radius_at(0.0)) / cup.taper
    # The level's contact line in the container's middle is in each of these rows.
    rows, width = maps.level.shape[0], right.column - left.column
    v = np.arange(0.03 * rows, 0.99 * rows, TUNING.row_step) if level is None else level[1]
    slope = (np.atleast_1d(v) - camera.cy) / camera.fy
    aside = tip * cone.up - cup.radius * cone.forward
    with np.errstate(divide="ignore", invalid="ignore"):
        away = (slope * aside[2] - aside[1]) / (cone.tip[1] - slope * cone.tip[2])
    best = None
    for ahead in away[np.isfinite(away) & (away * cone.tip[2] > 0.0)]:
        axis, height = cone.at(float(ahead), tip)
        place = axis.place(height)
        upright = abs(place.pitch) <= TUNING.most_pitch and abs(place.roll) <= TUNING.most_roll
        if not upright or not axis.distance > 1.5 * cup.radius:
            continue
        score = float(_scores(maps, camera, cup, axis, np.array([height]))[0])
        score -= TUNING.search_chance * TUNING.search_slack / width
        if best is None or score > best.score:
            best = CandidatePlace(place, score, width)
    return best


def height_through(
    camera: PinholeCamera, cup: Cup, axis: Axis, pixel: tuple[float, float]
) -> FloatArray:
    """Returns the camera's height above a level through a pixel, (1,) [m]; empty if impossible."""
    (ray,) = camera.rays(np.array([pixel]))
    # As components to the right, away from the camera and up; the origin is on the axis.
    right, away, up = (float(value) for value in ray @ axis.rotation)
    square = right * right + away * away
    root = (axis.distance * away) ** 2 - square * (axis.distance**2 - cup.radius**2)
    if not root >= 0.0:
        return np.empty(0)
    return np.array([-(axis.distance * away - np.sqrt(root)) / square * up])


def _scores(
    maps: _Maps, camera: PinholeCamera, cup: Cup, axis: Axis, heights: FloatArray
) -> FloatArray:
    """Scores each camera height (N,) above the liquid level by edge strength."""
    arc = np.deg2rad(np.linspace(-62.0, 62.0, 21))
    # A cone has one axis for every height, a cylinder one for all.
    viewer = cup.outer_radius_at(heights[0] if cup.taper else 0.0)
    side = np.arccos(min(float(viewer) / axis.distance, 1.0))
    top = min(cup.rim_level or 0.5 * cup.fill_height, cup.fill_height)
    below = -np.linspace(0.08, 0.95, 12) * cup.fill_height
    above = np.linspace(0.1, 0.9, 8) * top

    def supports(
        azimuth: ArrayOrFloat, radius: ArrayOrFloat, z: ArrayOrFloat, chart: Float32Array
    ) -> FloatArray:
        return _lookup(chart, _pixels(camera, axis, heights, azimuth, radius, z))

    def outer(z: FloatArray) -> FloatArray:
        return cup.outer_radius_at(z)

    front = _mean(supports(arc, cup.radius, 0.0, maps.level))
    rear = _mean(supports(arc + np.pi, cup.radius, 0.0, maps.level))
    liquid = [_mean(supports(sign * side, outer(below), below, maps.upright)) for sign in (-1, 1)]
    glass = [_mean(supports(sign * side, outer(above), above, maps.upright)) for sign in (-1, 1)]
    base = _mean(
        supports(arc, cup.radius_at(-cup.fill_height), -cup.fill_height, maps.level), least=0.5
    )
    # The rear line is hidden behind the liquid for a camera below the level.
    second = np.where(heights > 0.0, np.fmin(front, rear), 0.0)
    level = np.where(heights > 0.0, np.fmax(front, rear), front)
    parts = {
        "level": 0.8 * level + 0.2 * np.fmax(second, level * (np.abs(heights) < 0.02)),
        # Both sides are there or it is not a container.
        "liquid": np.minimum(*(np.nan_to_num(part) for part in liquid)),
        "glass": np.minimum(*glass),
        "base": base,
    }
    total = np.zeros(heights.size)
    weight = np.zeros(heights.size)
    for name, part in parts.items():
        seen = np.isfinite(part)
        total += np.where(seen, _WEIGHTS[name] * np.nan_to_num(part), 0.0)
        weight += np.where(seen, _WEIGHTS[name], 0.0)
    return np.where(np.isfinite(level), total / np.maximum(weight, 1e-9), 0.0)


ArrayOrFloat = FloatArray | float


def _pixels(
    camera: PinholeCamera,
    axis: Axis,
    heights: FloatArray,
    azimuth: ArrayOrFloat,
    radius: ArrayOrFloat,
    z: ArrayOrFloat,
) -> FloatArray:
    """Projects points (azimuth, radius, height) into the image for N camera heights [px]."""
    angle, level, across = np.broadcast_arrays(*map(np.atleast_1d, (azimuth, z, radius)))
    points = np.column_stack(
        (across * np.sin(angle), -across * np.cos(angle), np.asarray(level, dtype=np.float64))
    )
    here = points @ axis.rotation.T + axis.distance * axis.forward
    cast = here[np.newaxis, :, :] - heights[:, np.newaxis, np.newaxis] * axis.up
    depth = np.where(cast[..., 2] > 1e-6, cast[..., 2], np.nan)
    flat = cast[..., :2] / depth[..., np.newaxis]
    return flat * (camera.fx, camera.fy) + (camera.cx, camera.cy)


def _lookup(chart: Float32Array, pixels: FloatArray) -> FloatArray:
    """Returns an edge map's values at the given image pixels; NaN outside the image."""
    rows, columns = chart.shape
    place = np.rint(np.nan_to_num(pixels, nan=-1.0, posinf=-1.0, neginf=-1.0))
    u, v = place[..., 0], place[..., 1]
    inside = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
    index_u, index_v = np.where(inside, u, 0).astype(int), np.where(inside, v, 0).astype(int)
    return np.where(inside, chart[index_v, index_u], np.nan)


def _mean(values: FloatArray, least: float = 0.3) -> FloatArray:
    """Returns the mean over samples inside the image (axis 1), NaN if there are too few."""
    seen = np.isfinite(values)
    count = seen.sum(axis=1)
    total = np.where(seen, values, 0.0).sum(axis=1)
    return np.where(count >= least * values.shape[1], total / np.maximum(count, 1), np.nan)


def _distinct(found: list[CandidatePlace], count: int) -> list[CandidatePlace]:
    """Returns the best initial poses, without those whose fit would give the same pose."""
    kept: list[CandidatePlace] = []
    for candidate in found:
        if len(kept) == count:
            break
        places = [other.place for other in kept]
        if any(_alike(candidate.place, place) for place in places):
            continue
        if sum(_is_one(candidate.place, place) for place in places) < TUNING.of_one_place:
            kept.append(candidate)
    return kept


def _is_one(first: CameraPlace, second: CameraPlace) -> bool:
    """Whether two camera poses are nearly equal in distance and yaw."""
    apart = abs(first.distance - second.distance)
    near = apart < TUNING.one_distance * min(first.distance, second.distance)
    return near and abs(first.yaw - second.yaw) < TUNING.one_yaw


def _alike(first: CameraPlace, second: CameraPlace) -> bool:
    size = np.array([0.02 * first.distance, 0.05 * first.distance, 0.01, 0.035, 0.02])
    return bool(np.all(np.abs(first.numbers - second.numbers) < size))
