"""The fine fit of a camera's place to a container's edges in a still image.

Fitted are the two sides of the container (planes through the camera that touch the outer wall),
the still level on the front and, seen from above, on the rear wall, and the floor's front edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from slosh_camera.calibrate.edges import EdgeImage, find_edges
from slosh_camera.calibrate.pose import CameraPlace, pose_of
from slosh_camera.camera import PinholeCamera
from slosh_camera.errors import SloshCameraError
from slosh_camera.geometry import Cup, CupView, Wall

FloatArray = NDArray[np.float64]

# The fit works at this azimuth; the caller's is put in afterwards.
AZIMUTH = -0.5 * np.pi

_PLACE = 5
# Samples of one curve [px apart]; bounds of the error of one, and how many neighbours share it.
_SPACING = 2.0
_LEAST_ERROR, _MOST_ERROR = 0.15, 1.0
_SHARED_BY = 5.0
# What a whole curve may be off [px], beside its samples' errors: reflections at a side shift and
# turn it, and empty glass has several edges; the liquid's meniscus; the floor's thickness and a
# fill height given too roughly [m].
_SIDE_ERROR, _SIDE_TURN, _EMPTY_ERROR = 0.2, 0.2, 1.0
_LEVEL_ERROR = 0.2
_BASE_ERROR = 0.0015
# Towards its edge a shiny wall mirrors ever more of what is beside it, so that the steepest
# change lies inside the true edge: 0.46 to 0.56 px for Fresnel's formulas, a radius of 60 to 300
# px, and the smoothing used here with a pixel's own.
_SHINE = 0.47
# Search to both sides of a predicted curve, as a share of the container's width, and at least.
_STAGES = ((0.045, 8.0), (0.045, 8.0), (0.03, 6.0), (0.015, 4.0), (0.012, 3.0), (0.012, 3.0))
# An edge farther off than this after the fit belongs to something else [px].
INLIER = 1.5
# Front and rear line closer than this are one edge [px].
_LEAST_SEPARATION = 6.0
_FAR = 1e3
_DIFFERENCE = 1e-6


class Curve(Enum):
    """A curve of the container that shows in the image."""

    LEFT = "left side"
    RIGHT = "right side"
    LEFT_EMPTY = "left side above the liquid"
    RIGHT_EMPTY = "right side above the liquid"
    FRONT = "still level, front"
    REAR = "still level, rear"
    BASE = "floor"


_WETTED = (Curve.LEFT, Curve.RIGHT)
_EMPTY = (Curve.LEFT_EMPTY, Curve.RIGHT_EMPTY)
_SIDES = _WETTED + _EMPTY
_LEFT = (Curve.LEFT, Curve.LEFT_EMPTY)


@dataclass(frozen=True, slots=True, eq=False)
class SeenCurve:
    """The edges found along a predicted curve.

    Attributes:
        curve: which one.
        pixels: (N, 2) edges found.
        normals: (N, 2) unit normals of the prediction there.
        slopes: (N,) their strengths [levels/px].
        samples: how many samples of the curve lie in the image, N at most.
    """

    curve: Curve
    pixels: FloatArray
    normals: FloatArray
    slopes: FloatArray
    samples: int


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A fitted place.

    Attributes:
        place: the camera's place.
        covariance: (5, 5) of its five numbers, in their order and units.
        seen: the edges that were fitted.
        residuals: distance of each edge from its fitted curve [px], one array per curve.
        score: mean support of the curves, 0 to 1.
    """

    place: CameraPlace
    covariance: FloatArray
    seen: tuple[SeenCurve, ...]
    residuals: tuple[FloatArray, ...]
    score: float

    @property
    def rms(self) -> float:
        """Root mean square of the inliers' residuals [px]."""
        every = np.concatenate(self.residuals)
        near = every[np.abs(every) < INLIER]
        return float(np.sqrt(np.mean(near**2))) if near.size else float("nan")

    def share(self, curve: Curve) -> float:
        """Part of a curve's samples that lie on an edge; NaN: the curve is not in the image."""
        for seen, residual in zip(self.seen, self.residuals, strict=True):
            if seen.curve is curve:
                return float(np.count_nonzero(np.abs(residual) < INLIER) / max(seen.samples, 1))
        return float("nan")


def fit_place(edges: EdgeImage, camera: PinholeCamera, cup: Cup, start: CameraPlace) -> Fit | None:
    """Fit the camera's place to the edges, looking for them ever closer to the prediction.

    Args:
        edges: the image, without distortion.
        camera: its camera, without distortion.
        cup: the container.
        start: where to start.

    Returns:
        The fit; None where it runs away or loses the edges.
    """
    place = start
    covariance = np.full((_PLACE, _PLACE), np.nan)
    try:
        for share, least in _STAGES:
            view = view_at(camera, cup, place)
            reach = max(share * _width(view), least)
            seen = look_for_curves(edges, view, reach)
            if not _enough(seen):
                return None
            place, covariance = _solve(camera, cup, place, seen)
        view = view_at(camera, cup, place)
        seen = look_for_curves(edges, view, reach)
    except SloshCameraError:
        return None
    residuals = tuple(distances(view, curve) for curve in seen)
    return Fit(place, covariance, seen, residuals, _score(edges, seen, residuals))


def view_at(
    camera: PinholeCamera, cup: Cup, place: CameraPlace, azimuth: float = AZIMUTH
) -> CupView:
    """The container as the camera at a place sees it."""
    return CupView(camera, pose_of(place, azimuth), cup)


def _width(view: CupView) -> float:
    left, right = (_side_points(view, curve, np.zeros(1))[0] for curve in _WETTED)
    return float(np.hypot(*(right - left)))


def curve_points(view: CupView, curve: Curve, count: int) -> FloatArray:
    """Points (count, 2) along a curve in the image [px], from left to right or from below."""
    cup = view.cup
    if curve in _SIDES:
        top = cup.rim_level if cup.rim_level is not None else 0.5 * cup.fill_height
        low, high = (0.05, 0.95) if curve in _EMPTY else (-0.97, -0.03)
        scale = top if curve in _EMPTY else cup.fill_height
        return _side_points(view, curve, np.linspace(low * scale, high * scale, count))
    # The last degrees before a side are bent, short and mixed with it.
    arc = np.deg2rad(np.linspace(-76.0, 76.0, count))
    middle = view.camera_azimuth
    if curve is Curve.REAR:
        return view.project_wall(middle + np.pi - arc, 0.0, Wall.REAR)
    level = -cup.fill_height if curve is Curve.BASE else 0.0
    return view.project_wall(middle + arc, level, Wall.FRONT)


def _side_points(view: CupView, curve: Curve, z: FloatArray) -> FloatArray:
    """Points of the outer wall where a plane through the camera touches it."""
    outer = view.cup.radius + view.cup.wall_thickness
    centre = view.pose.camera_centre
    half = np.arccos(outer / np.hypot(centre[0], centre[1]))
    azimuth = view.camera_azimuth + (-half if curve in _LEFT else half)
    points = np.column_stack(
        (np.full(z.size, outer * np.cos(azimuth)), np.full(z.size, outer * np.sin(azimuth)), z)
    )
    return view.project(points)


def look_for_curves(edges: EdgeImage, view: CupView, reach: float) -> tuple[SeenCurve, ...]:
    """Edges along every curve that the view should show, those of no use left out."""
    separation = _separation(view)
    double = view.pose.camera_centre[2] > 0.0 and separation > _LEAST_SEPARATION
    seen = []
    for curve in Curve:
        near = reach
        if curve is Curve.REAR and not double:
            continue
        if curve in (Curve.FRONT, Curve.REAR) and double:
            near = min(reach, 0.45 * separation)
        found = _look(edges, view, curve, near)
        if found.samples >= 10:
            seen.append(found)
    return tuple(seen)


def _separation(view: CupView) -> float:
    """Rows between the middles of the front and the rear line of the still level [px]."""
    front = curve_points(view, Curve.FRONT, 3)[1]
    rear = curve_points(view, Curve.REAR, 3)[1]
    return float(np.hypot(*(front - rear)))


def _look(edges: EdgeImage, view: CupView, curve: Curve, reach: float) -> SeenCurve:
    ends = curve_points(view, curve, 9)
    length = float(np.nansum(np.hypot(*np.diff(ends, axis=0).T)))
    points = curve_points(view, curve, max(int(length / _SPACING), 12))
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, np.newaxis]
    # Outwards for a side, upwards for a level.
    normals = np.column_stack((tangent[:, 1], -tangent[:, 0]))
    if curve in _SIDES and curve not in _LEFT:
        normals = -normals
    rows, columns = edges.shape
    inside = np.all((points >= 2.0) & (points <= (columns - 3.0, rows - 3.0)), axis=1)
    points, normals = points[inside], normals[inside]
    found = find_edges(edges, points, normals, reach, outermost=curve in _SIDES)
    kept = found.slope > 0.0
    return SeenCurve(curve, found.pixels[kept], normals[kept], found.slope[kept], len(points))


def distances(view: CupView, seen: SeenCurve) -> FloatArray:
    """Signed distance of the edges found from a curve (N,) [px]; along the normals positive."""
    if seen.curve in _SIDES:
        return _side_distances(view, seen)
    line = curve_points(view, seen.curve, 81)
    v = np.interp(seen.pixels[:, 0], line[:, 0], line[:, 1])
    return (seen.pixels[:, 1] - v) * seen.normals[:, 1]


def _side_distances(view: CupView, seen: SeenCurve) -> FloatArray:
    origin, direction = view.rays(seen.pixels)
    flat = np.hypot(direction[:, 0], direction[:, 1])
    offset = (origin[0] * direction[:, 1] - origin[1] * direction[:, 0]) / flat
    outer = view.cup.radius + view.cup.wall_thickness
    outwards = (-offset if seen.curve in _LEFT else offset) - outer
    distance = _distance(view)
    cup = view.cup
    shine = _SHINE if cup.wall_thickness > 0.0 and cup.wall_refractive_index > 1.0 else 0.0
    return np.asarray(outwards * view.camera.fx / distance + shine)


def _enough(seen: Sequence[SeenCurve]) -> bool:
    """Both sides and a line of the level have edges."""
    sizes = {curve.curve: len(curve.pixels) for curve in seen}
    level = max(sizes.get(Curve.FRONT, 0), sizes.get(Curve.REAR, 0))
    return level >= 8 and min(sizes.get(curve, 0) for curve in _WETTED) >= 8


def _solve(
    camera: PinholeCamera, cup: Cup, start: CameraPlace, seen: Sequence[SeenCurve]
) -> tuple[CameraPlace, FloatArray]:
    """Least squares over the place and each curve's own error; the place and its covariance.

    A curve's own error (an offset, for a side a turn, too) is an unknown with an expected size,
    so that the covariance holds what no number of samples averages out.
    """
    view = view_at(camera, cup, start)
    shapes = [_own_errors(view, curve) for curve in seen]
    weights = [_weight(curve, distances(view, curve)) for curve in seen]
    scale = np.array([start.distance, start.distance, 1.0, 1.0, 1.0])
    splits = np.cumsum([shape.shape[1] for shape in shapes])
    samples = sum(len(curve.pixels) for curve in seen)

    own_size = int(splits[-1])
    own_slope = np.vstack(
        (
            -_block_diagonal([w * shape for w, shape in zip(weights, shapes, strict=True)]),
            np.eye(own_size),
        )
    )

    def cost(numbers: FloatArray) -> FloatArray:
        own = numbers[_PLACE:]
        try:
            here = view_at(camera, cup, CameraPlace(*(numbers[:_PLACE] * scale)))
        except SloshCameraError:
            return np.full(samples + own_size, _FAR)
        parts = [
            weight * distances(here, curve) for curve, weight in zip(seen, weights, strict=True)
        ]
        fixed = np.nan_to_num(np.concatenate(parts), nan=_FAR)
        return np.concatenate((fixed, np.zeros(own_size))) + own_slope @ own

    def slope(numbers: FloatArray) -> FloatArray:
        # The curves' own errors enter linearly; differences are taken over the place alone.
        here = cost(numbers)
        columns = []
        for index in range(_PLACE):
            moved = numbers.copy()
            moved[index] += _DIFFERENCE
            columns.append((cost(moved) - here) / _DIFFERENCE)
        return np.column_stack((*columns, own_slope))

    first = np.concatenate((start.numbers / scale, np.zeros(own_size)))
    result = least_squares(cost, first, jac=slope, loss="soft_l1", max_nfev=25, xtol=1e-7)
    covariance = np.linalg.pinv(result.jac.T @ result.jac)[:_PLACE, :_PLACE]
    place = CameraPlace(*(float(value) for value in result.x[:_PLACE] * scale))
    return place, covariance * np.outer(scale, scale)


def _block_diagonal(blocks: Sequence[FloatArray]) -> FloatArray:
    whole: FloatArray = block_diag(*blocks)
    return whole


def _own_errors(view: CupView, seen: SeenCurve) -> FloatArray:
    """Expected errors of a whole curve at its samples (N, K) [px], one column per kind."""
    count = len(seen.pixels)
    flat = np.ones((count, 1))
    if seen.curve is Curve.BASE:
        return flat * (_LEVEL_ERROR + _BASE_ERROR * view.camera.fy / _distance(view))
    if seen.curve not in _SIDES:
        return flat * _LEVEL_ERROR
    shift = _EMPTY_ERROR if seen.curve in _EMPTY else _SIDE_ERROR
    turn = np.linspace(-_SIDE_TURN, _SIDE_TURN, count)[:, np.newaxis]
    return np.hstack((shift * flat, turn))


def _weight(seen: SeenCurve, residual: FloatArray) -> float:
    """One over the error of a sample, by the scatter of the samples about a smooth curve."""
    scatter = _MOST_ERROR
    if residual.size > 8 and seen.curve is not Curve.BASE:
        place = np.linspace(-1.0, 1.0, residual.size)
        smooth = np.polynomial.polynomial.polyfit(place, residual, 2)
        rest = residual - np.polynomial.polynomial.polyval(place, smooth)
        scatter = float(np.clip(1.5 * np.median(np.abs(rest)), _LEAST_ERROR, _MOST_ERROR))
    return float(1.0 / (scatter * np.sqrt(_SHARED_BY)))


def _distance(view: CupView) -> float:
    return float(np.hypot(*view.pose.camera_centre[:2]))


def _score(edges: EdgeImage, seen: Sequence[SeenCurve], residuals: Sequence[FloatArray]) -> float:
    """Mean over the curves of the support on each; a curve that is absent counts nothing."""
    parts = []
    for curve, residual in zip(seen, residuals, strict=True):
        near = np.abs(residual) < INLIER
        support = float(edges.support(curve.slopes[near]).sum()) / curve.samples
        parts.append((support, 2.0 if curve.curve is Curve.FRONT else 1.0))
    return float(np.average([part[0] for part in parts], weights=[part[1] for part in parts]))
