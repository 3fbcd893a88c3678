"""Quality of a calibrated pose: agreement with edges, errors of heights, warnings, a picture."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.board import BoardFit
from slosh_camera.calibrate.curves import AZIMUTH, SIDES, Curve, curve_points, view_at
from slosh_camera.calibrate.fit import PlaceFit
from slosh_camera.calibrate.pose import QUANTITIES, CameraPlace, GivenView
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.images.colour import letter_size, put_text, to_colour
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import CupView, Wall

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]


HEIGHTS = (-0.02, 0.0, 0.02)
"""Heights at which the error of a measured height is stated [m]."""
# The part of either wall at which it is stated [rad], 0 towards or away from the camera.
_ARC = np.deg2rad(np.linspace(-60.0, 60.0, 13))
# Step of a derivative.
_STEP = 1e-6


@dataclass(frozen=True, slots=True)
class CurveCheck:
    """Agreement of one curve of the container with the image's edges.

    Attributes:
        share: part of its samples that have an edge within 1.5 px, 0 to 1.
        offset: median signed distance of the edges [px]; outwards for a side, upwards for a
            level; NaN: no edges.
        rms: root mean square distance of the edges within 1.5 px [px]; NaN: none.
    """

    name: str
    share: float
    offset: float
    rms: float


@dataclass(frozen=True, slots=True, eq=False)
class StillFit:
    """A calibrated pose and its quality.

    Attributes:
        view: camera, pose and container.
        place: the camera's place about the container.
        stddev: (8,) standard errors of the place's numbers and of what was told about the focal
            length, the wall's thickness and the fill height, in the order and units of
            CameraPlace and of GivenView.off_by; 0 for what was known.
        residual: rms distance between the liquid's outline and the edges [px].
        residual_height: what the residual of the still level is as a height on the front wall [m].
        height_stddev: largest standard error of a height of -20 to 20 mm on the front and on the
            rear wall [m].
        level_shows: the image shows that the level is a liquid's, or it was told; so do edges
            alone of a pose that is known.
    """

    view: CupView
    place: CameraPlace
    stddev: FloatArray
    residual: float
    residual_height: float
    height_stddev: dict[Wall, float]
    curves: tuple[CurveCheck, ...]
    level_shows: bool = True


def still_fit(fit: PlaceFit, camera: PinholeCamera, azimuth: float) -> StillFit:
    """Returns the calibrated pose and its quality from a fit.

    Args:
        fit: of the container's curves to an image without distortion.
        camera: that took the image, with its distortion.
        azimuth: at which the camera stands about the container's axis [rad].
    """
    lens = replace(
        fit.camera, distortion=camera.distortion, distortion_model=camera.distortion_model
    )
    view = view_at(lens, fit.cup, fit.place, azimuth)
    upright = view_at(fit.camera, fit.cup, fit.place)
    checks = tuple(
        _checked(seen.curve, seen.samples, residual)
        for seen, residual in zip(fit.seen, fit.residuals, strict=True)
    )
    front = [check.rms for check in checks if check.name == Curve.FRONT.value]
    ((u, v),) = upright.project_wall(AZIMUTH, 0.0, Wall.FRONT)
    return StillFit(
        view,
        fit.place,
        _doubtful(fit) * np.sqrt(np.diag(fit.covariance)),
        fit.rms,
        (front[0] if front else float("nan")) * upright.height_per_pixel((u, v), Wall.FRONT),
        {wall: _height_stddev(upright, fit, wall) for wall in Wall},
        checks,
    )


def height_shift(view: CupView, truth: CupView, wall: Wall) -> FloatArray:
    """Returns the height errors that one pose causes if another pose is the true one [m].

    NaN where a ray misses the view's wall.
    """
    shift: FloatArray = _heights(view, truth, wall) - np.repeat(HEIGHTS, _ARC.size)
    return shift


def _checked(curve: Curve, samples: int, residual: FloatArray) -> CurveCheck:
    near = residual[np.abs(residual) < TUNING.inlier]
    rms = float(np.sqrt(np.mean(near**2))) if near.size else float("nan")
    offset = float(np.median(residual)) if residual.size else float("nan")
    return CurveCheck(curve.value, near.size / samples, offset, rms)


def _height_stddev(view: CupView, fit: PlaceFit, wall: Wall) -> float:
    """Returns the largest standard deviation of measured heights due to the pose [m]."""
    told = GivenView(fit.camera, fit.cup)
    here = _heights(view, view, wall)
    columns = []
    for step in _STEP * np.eye(len(fit.covariance)):
        place = CameraPlace(*(fit.place.numbers + step[:-QUANTITIES]))
        other = view_at(*told.off_by(step[-QUANTITIES:]), place)
        columns.append((_heights(other, view, wall) - here) / _STEP)
    slope = np.column_stack(columns)
    variance = np.einsum("ni,ij,nj->n", slope, fit.covariance, slope)
    known = variance[np.isfinite(variance)]
    return _doubtful(fit) * float(np.sqrt(known.max())) if known.size else float("inf")


def _doubtful(fit: PlaceFit) -> float:
    """Returns the factor by which contradictory edges enlarge the pose's standard deviations."""
    return float(np.nanmax([fit.tension, fit.rms / TUNING.usual_residual, 1.0]))


def _heights(view: CupView, truth: CupView, wall: Wall) -> FloatArray:
    """Returns the heights that one pose assigns to wall points projected by another [m]."""
    arc = AZIMUTH + (_ARC if wall is Wall.FRONT else np.pi - _ARC)
    azimuth, height = np.tile(arc, len(HEIGHTS)), np.repeat(HEIGHTS, arc.size)
    return view.on_wall(truth.project_wall(azimuth, height, wall), wall)[1]


def warnings_of(fit: StillFit) -> list[str]:
    """Returns warnings about contradictory or ambiguous edges in the image."""
    checks = {check.name: check for check in fit.curves}
    warnings = []
    floor = checks.get(Curve.BASE.value)
    if floor is not None and floor.share < TUNING.least_share:
        warnings.append(
            "the floor's edge is not where the dimensions predict it; if it is visible, check "
            "radius, fill height, wall thickness and the focal length, which the other edges "
            "do not determine"
        )
    for name in (Curve.LEFT.value, Curve.RIGHT.value, Curve.FRONT.value, Curve.REAR.value):
        check = checks.get(name)
        if check is not None and check.share < TUNING.clear_share:
            warnings.append(
                f"the {name} is visible on {100.0 * check.share:.0f} % of its length, the rest "
                "is hidden or the edge of another object: check that it is where --picture "
                "draws it"
            )
        if check is not None and abs(check.offset) > TUNING.doubtful_offset:
            warnings.append(
                f"the {name} is {check.offset:+.1f} px from where the pose predicts it"
            )
    if fit.residual > TUNING.most_residual:
        warnings.append(
            f"the edges are {fit.residual:.2f} px from the pose, more than "
            f"{TUNING.most_residual:g}: check the intrinsic parameters and the dimensions; "
            "standard errors are increased accordingly"
        )
    worst = max(fit.height_stddev.values())
    if worst > TUNING.most_height_error:
        warnings.append(
            f"heights are known to {1e3 * worst:.1f} mm only; let the container fill more "
            "of the image, or show both the front and the rear line of the level"
        )
    if not np.isfinite(fit.residual):
        warnings.append(
            "the container's edges are not visible, so nothing checks the board's pose"
        )
    return warnings


# Blue, green, red.
_FRONT, _REAR, _SIDE, _BASE = (70, 220, 70), (255, 170, 40), (60, 220, 255), (200, 80, 200)
_AXES = ((0, 0, 255), (0, 255, 0), (255, 0, 0))  # x, y, z
_SMALL_WIDTH = 1000
_SHIFT = 4
_COUNT = 181


def draw_calibration(image: Image, fit: StillFit, board: BoardFit | None = None) -> Image:
    """Draws the container's predicted edges and liquid level over the image.

    Green is the still level on the front wall, blue on the rear wall, yellow the outer sides and
    the rim, violet the floor; where they lie on what they name, the pose is right.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red; not changed.
        board: the board found, whose axes are drawn.

    Returns:
        (height, width, 3) blue-green-red picture, of double size where the image is small.
    """
    zoom = 2 if image.shape[1] < _SMALL_WIDTH else 1
    size = (zoom * image.shape[1], zoom * image.shape[0])
    picture = np.array(
        cv2.resize(to_colour(image), size, interpolation=cv2.INTER_CUBIC), dtype=np.uint8
    )
    for curve in Curve:
        _draw(picture, curve_points(fit.view, curve, _COUNT), zoom, _colour(curve))
    _draw_rim(picture, fit.view, zoom)
    if board is not None:
        _draw_axes(picture, fit, board, zoom)
    letters = letter_size(picture)
    place = (round(8 * letters), picture.shape[0] - round(12 * letters))
    put_text(picture, _caption(fit), place, letters)
    return picture


def _colour(curve: Curve) -> tuple[int, int, int]:
    if curve in SIDES:
        return _SIDE
    return {Curve.FRONT: _FRONT, Curve.REAR: _REAR}.get(curve, _BASE)


def _draw_rim(picture: Image, view: CupView, zoom: int) -> None:
    rim = view.cup.rim_level
    if rim is None:
        return
    arc = view.camera_azimuth + np.deg2rad(np.linspace(-76.0, 76.0, _COUNT))
    _draw(picture, view.project_wall(arc, rim, Wall.FRONT), zoom, _SIDE)
    # From above the rim its far side is seen over it, not through the front wall.
    if view.pose.camera_centre[2] < rim:
        _draw(picture, view.project_wall(arc + np.pi, rim, Wall.REAR), zoom, _SIDE)


def _draw(picture: Image, points: FloatArray, zoom: int, colour: tuple[int, int, int]) -> None:
    known = points[np.all(np.isfinite(points), axis=1)]
    if len(known) < 2:
        return
    place = np.clip((known + 0.5) * zoom - 0.5, -1e4, 1e4)
    fixed = np.round(place * (1 << _SHIFT)).astype(np.int32)
    cv2.polylines(picture, [fixed], False, colour, 1, cv2.LINE_AA, _SHIFT)


def _draw_axes(picture: Image, fit: StillFit, board: BoardFit, zoom: int) -> None:
    camera, pose = fit.view.camera, board.pose
    corners = np.vstack((np.zeros(3), 0.4 * fit.view.cup.radius * np.eye(3)))
    origin, *ends = camera.project(corners @ pose.rotation.T + pose.translation)
    for end, colour in zip(ends, _AXES, strict=True):
        _draw(picture, np.array([origin, end]), zoom, colour)


def _caption(fit: StillFit) -> str:
    worst = 1e3 * max(fit.height_stddev.values())
    return f"residual {fit.residual:.2f} px, heights to {worst:.2f} mm (1 sigma)"
