"""The visible curves of a round container in an image, and the image edges along them.

They are the two sides of the container (planes through the camera that touch the outer wall), the
still level on the front and, seen from above, on the rear wall, and the floor's front edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.edges import EdgeImage, find_edges
from slosh_camera.calibrate.pose import CameraPlace, pose_of
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup, CupView, Wall

FloatArray = NDArray[np.float64]

# The fit works at this azimuth; the caller's is put in afterwards.
AZIMUTH = -0.5 * np.pi


class Curve(Enum):
    """A curve of a round container that is visible in the image."""

    LEFT = "left side"
    RIGHT = "right side"
    LEFT_EMPTY = "left side above the liquid"
    RIGHT_EMPTY = "right side above the liquid"
    FRONT = "still level, front"
    REAR = "still level, rear"
    BASE = "floor"


WETTED = (Curve.LEFT, Curve.RIGHT)
EMPTY = (Curve.LEFT_EMPTY, Curve.RIGHT_EMPTY)
SIDES = WETTED + EMPTY
_LEFT = (Curve.LEFT, Curve.LEFT_EMPTY)
# The curves whose places are known best; empty glass has several edges, the floor is a guess.
OUTLINE = (*WETTED, Curve.FRONT, Curve.REAR)


@dataclass(frozen=True, slots=True, eq=False)
class SeenCurve:
    """Image edges detected along a predicted curve of the container.

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

    def only(self, kept: NDArray[np.bool_]) -> SeenCurve:
        """Returns the curve with only those edges that a mask (N,) selects."""
        return replace(
            self, pixels=self.pixels[kept], normals=self.normals[kept], slopes=self.slopes[kept]
        )


def view_at(
    camera: PinholeCamera, cup: Cup, place: CameraPlace, azimuth: float = AZIMUTH
) -> CupView:
    """Returns the container's projection model for a camera pose and a camera azimuth [rad]."""
    return CupView(camera, pose_of(place, azimuth), cup)


def curve_points(view: CupView, curve: Curve, count: int) -> FloatArray:
    """Returns points (count, 2) along a curve [px], from left to right or from bottom to top."""
    cup = view.cup
    if curve in SIDES:
        top = cup.rim_level if cup.rim_level is not None else 0.5 * cup.fill_height
        low, high = (0.05, 0.95) if curve in EMPTY else (-0.97, -0.03)
        scale = top if curve in EMPTY else cup.fill_height
        return _side_points(view, curve, np.linspace(low * scale, high * scale, count))
    # The last degrees before a side are bent, short and mixed with it.
    arc = np.deg2rad(np.linspace(-76.0, 76.0, count))
    middle = view.camera_azimuth
    if curve is Curve.REAR:
        return view.project_wall(middle + np.pi - arc, 0.0, Wall.REAR)
    level = -cup.fill_height if curve is Curve.BASE else 0.0
    return view.project_wall(middle + arc, level, Wall.FRONT)


def _side_points(view: CupView, curve: Curve, z: FloatArray) -> FloatArray:
    """Returns points of the outer wall on its silhouette, as seen from the camera."""
    half = view.side_half_angle
    azimuth = view.camera_azimuth + (-half if curve in _LEFT else half)
    return view.project(view.cup.outer_points(azimuth, z))


def sides_of(view: CupView) -> tuple[FloatArray, FloatArray]:
    """Returns the image points of the container's left and right side at the still level [px]."""
    left, right = (_side_points(view, curve, np.zeros(1))[0] for curve in WETTED)
    return left, right


def width_of(view: CupView) -> float:
    """Returns the image width of the container at the level of the liquid at rest [px]."""
    left, right = sides_of(view)
    return float(np.hypot(*(right - left)))


def look_for_curves(
    edges: EdgeImage, view: CupView, reach: float, level_reach: float = np.inf
) -> tuple[SeenCurve, ...]:
    """Detects edges along each visible curve of the container; skips curves it cannot use.

    They are looked for so far to both sides, the still level's contact line no farther than
    `level_reach` [px].
    """
    apart = separation(view)
    double = view.pose.camera_centre[2] > 0.0 and apart > TUNING.separate_lines
    seen = []
    for curve in Curve:
        near = reach
        if curve is Curve.REAR and not double:
            continue
        if curve in (Curve.FRONT, Curve.REAR) and double:
            near = min(reach, 0.45 * apart)
        if curve is Curve.FRONT:
            near = min(near, level_reach)
        found = _look(edges, view, curve, near)
        if found.samples >= 10:
            seen.append(found)
    return tuple(seen)


def separation(view: CupView) -> float:
    """Returns the distance in image rows [px] between front and rear contact line at rest."""
    front = curve_points(view, Curve.FRONT, 3)[1]
    rear = curve_points(view, Curve.REAR, 3)[1]
    return float(np.hypot(*(front - rear)))


def _look(edges: EdgeImage, view: CupView, curve: Curve, reach: float) -> SeenCurve:
    ends = curve_points(view, curve, 9)
    length = float(np.nansum(np.hypot(*np.diff(ends, axis=0).T)))
    points = curve_points(view, curve, max(int(length / TUNING.curve_spacing), 12))
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, np.newaxis]
    # Outwards for a side, upwards for a level.
    normals = np.column_stack((tangent[:, 1], -tangent[:, 0]))
    if curve in SIDES and curve not in _LEFT:
        normals = -normals
    rows, columns = edges.shape
    inside = np.all((points >= 2.0) & (points <= (columns - 3.0, rows - 3.0)), axis=1)
    points, normals = points[inside], normals[inside]
    found = find_edges(edges, points, normals, reach, outermost=curve in SIDES)
    kept = found.slope > 0.0
    return SeenCurve(curve, found.pixels[kept], normals[kept], found.slope[kept], len(points))


def distances(view: CupView, seen: SeenCurve) -> FloatArray:
    """Returns signed distances (N,) of edges from a predicted curve [px], along its normals."""
    if seen.curve in SIDES:
        return _side_distances(view, seen)
    line = curve_points(view, seen.curve, 81)
    v = np.interp(seen.pixels[:, 0], line[:, 0], line[:, 1])
    return (seen.pixels[:, 1] - v) * seen.normals[:, 1]


def _side_distances(view: CupView, seen: SeenCurve) -> FloatArray:
    origin, direction = view.rays(seen.pixels)
    flat = np.hypot(direction[:, 0], direction[:, 1])
    offset = (origin[0] * direction[:, 1] - origin[1] * direction[:, 0]) / flat
    cup, distance = view.cup, axis_distance(view)
    left = seen.curve in _LEFT
    if cup.taper:
        # From the plane through the camera that touches the cone, at the axis' distance.
        side = view.camera_azimuth + view.side_half_angle * (-1.0 if left else 1.0)
        outwards = distance * (direction @ (np.cos(side), np.sin(side), -cup.taper)) / flat
    else:
        outwards = (-offset if left else offset) - (cup.radius + cup.wall_thickness)
    shine = TUNING.shine if cup.wall_thickness > 0.0 and cup.wall_refractive_index > 1.0 else 0.0
    return np.asarray(outwards * view.camera.fx / distance + shine)


def axis_distance(view: CupView) -> float:
    """Returns the horizontal distance from the camera to the container's axis [m]."""
    return float(np.hypot(*view.pose.camera_centre[:2]))
