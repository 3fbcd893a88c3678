"""Calibration from a still image of a round container: its pose, how sure it is, or a refusal."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import (
    AZIMUTH,
    WETTED,
    Curve,
    distances,
    look_for_curves,
    view_at,
    width_of,
)
from slosh_camera.calibrate.edges import edge_image
from slosh_camera.calibrate.fit import INLIER, NO_HINT, Fit, Hint, fit_place
from slosh_camera.calibrate.pose import CameraPlace, place_of
from slosh_camera.calibrate.search import Candidate, find_candidates
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup, CupView, Wall

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]

# Heights at which the error of a measured height is stated [m].
HEIGHTS = (-0.02, 0.0, 0.02)
MAX_RESIDUAL = 0.6
"""Residual up to which a fit is believed [px]."""
MAX_HEIGHT_ERROR = 1e-3
"""Standard error of a height up to which a pose is of use [m]."""
_LEAST_SHARE = 0.5
_CANDIDATES, _FINE_FITS = 6, 3
# The coarse search takes so many columns at least, and less than twice as many.
_SEARCH_WIDTH = 800
# A second place counts as another answer where it moves a height by more than this [m], and as a
# rival where its score comes so close to the best and its residual is at most so much larger.
_SAME = 1e-3
# Rough fits that differ by less than this, relative to the distance or [rad], are one.
_ALIKE = 0.02
_RIVAL, _RIVAL_RESIDUAL = 0.93, 1.5
_ARC = np.deg2rad(np.linspace(-60.0, 60.0, 13))
_STEP = 1e-6


@dataclass(frozen=True, slots=True)
class CurveCheck:
    """How well a curve of the container lies on the image's edges.

    Attributes:
        name: of the curve.
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
    """A pose with what is known about its quality.

    Attributes:
        view: camera, pose and container.
        place: the camera's place about the container.
        stddev: (5,) standard errors of the place's numbers, in its order and units.
        residual: rms distance between the liquid's outline and the edges [px].
        residual_height: what the residual of the still level is as a height on the front wall [m].
        height_stddev: largest standard error of a height of -20 to 20 mm on the front and on the
            rear wall [m].
        curves: the single curves.
    """

    view: CupView
    place: CameraPlace
    stddev: FloatArray
    residual: float
    residual_height: float
    height_stddev: dict[Wall, float]
    curves: tuple[CurveCheck, ...]


def calibrate_by_edges(
    image: Image,
    camera: PinholeCamera,
    cup: Cup,
    azimuth: float = AZIMUTH,
    hint: Hint = NO_HINT,
) -> StillFit:
    """Pose of a container by its edges and its still level in an image.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red, liquid at rest.
        camera: its camera.
        cup: the container.
        azimuth: at which the camera stands about the container's axis [rad]; the picture of a
            round container does not show it.
        hint: what a board tells in addition.

    Returns:
        The pose.

    Raises:
        SloshCameraError: the image does not fit the camera, or does not determine the pose.
    """
    check_size(image, camera)
    straight, pinhole = undistorted(image, camera)
    edges = edge_image(straight)
    starts = [candidate.place for candidate in _candidates(straight, pinhole, cup)]

    def roughly(places: list[CameraPlace]) -> list[Fit]:
        tries = [fit_place(edges, pinhole, cup, place, hint, rough=True) for place in places]
        return _distinct([fit for fit in tries if fit])

    rough = roughly(starts)[:_FINE_FITS]
    places = [fit.place for fit in rough]
    places += [_mirrored(place, cup) for place in places]
    fits = [fit_place(edges, pinhole, cup, place, hint) for place in places]
    ranked = sorted((fit for fit in fits if fit), key=lambda fit: -fit.score)
    if not ranked:
        raise SloshCameraError(
            "still image: no round container is found; its two sides and the still level must be "
            "in the image, sharp and clear of other edges"
        )
    answers = [_result(fit, camera, pinhole, cup, azimuth) for fit in ranked]
    faults = [_fault(fit, answer) for fit, answer in zip(ranked, answers, strict=True)]
    if all(faults):
        raise SloshCameraError(f"still image: {faults[0]}")
    best = faults.index("")
    view = view_at(pinhole, cup, ranked[best].place)
    for rival, fault in zip(ranked[best + 1 :], faults[best + 1 :], strict=True):
        if not fault:
            _check_rival(view, ranked[best], rival)
    return answers[best]


def check_pose(
    image: Image, view: CupView, covariance: FloatArray, reach: float = 0.05
) -> StillFit:
    """The quality of a pose that is known by other means, by the edges of the container.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red, liquid at rest.
        view: camera, pose and container.
        covariance: (5, 5) of the camera's place.
        reach: how far off the edges are looked for, as a share of the container's width.

    Returns:
        The pose; its residual is NaN where no edges are found.
    """
    check_size(image, view.camera)
    straight, pinhole = undistorted(image, view.camera)
    place, azimuth = place_of(view.pose)
    upright = view_at(pinhole, view.cup, place)
    edges = edge_image(straight)
    seen = look_for_curves(edges, upright, reach * width_of(upright))
    residuals = tuple(distances(upright, curve) for curve in seen)
    fit = Fit(place, covariance, seen, residuals, float("nan"))
    return _result(fit, view.camera, pinhole, view.cup, azimuth)


def check_size(image: Image, camera: PinholeCamera) -> None:
    """Refuse an image that is not the camera's."""
    if image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise SloshCameraError(
            f"still image: is {image.ndim}-dimensional {image.dtype}, needs 8-bit grey or colour"
        )
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise SloshCameraError(
            f"still image: has {width} x {height} pixels, the camera is calibrated for "
            f"{camera.width} x {camera.height}"
        )


def undistorted(image: Image, camera: PinholeCamera) -> tuple[Image, PinholeCamera]:
    """The image as a camera without distortion would take it, and that camera."""
    if not any(camera.distortion):
        return image, camera
    size = (camera.width, camera.height)
    matrix, lens = camera.matrix, np.array(camera.distortion)
    maps = cv2.initUndistortRectifyMap(matrix, lens, None, matrix, size, cv2.CV_32FC1)
    straight = cv2.remap(image, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(straight, dtype=np.uint8), replace(camera, distortion=(0.0,) * 5)


def _candidates(image: Image, camera: PinholeCamera, cup: Cup) -> list[Candidate]:
    shrink = max(camera.width // _SEARCH_WIDTH, 1)
    if shrink > 1:
        width, height = camera.width // shrink, camera.height // shrink
        image = image[: height * shrink, : width * shrink]
        image = np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA))
        camera = PinholeCamera(
            width,
            height,
            camera.fx / shrink,
            camera.fy / shrink,
            (camera.cx + 0.5) / shrink - 0.5,
            (camera.cy + 0.5) / shrink - 0.5,
        )
    return find_candidates(edge_image(image), camera, cup, _CANDIDATES)


def _mirrored(place: CameraPlace, cup: Cup) -> CameraPlace:
    """As far below the level as a place is above it, with its rear line where the front one was.

    From above the rear line is often the stronger and passes for the front line of a camera below.
    """
    reach = np.copysign(cup.radius, place.height)
    was = np.arctan2(place.height, place.distance + reach)
    becomes = np.arctan2(-place.height, place.distance - reach)
    return replace(place, height=-place.height, pitch=place.pitch + float(becomes - was))


def _distinct(fits: list[Fit]) -> list[Fit]:
    """The fits that ended at different places, the best first."""
    kept: list[Fit] = []
    for fit in sorted(fits, key=lambda fit: -fit.score):
        far = _ALIKE * fit.place.distance
        size = np.array([far, far, _ALIKE, _ALIKE, _ALIKE])
        if all(np.any(np.abs(fit.place.numbers - k.place.numbers) > size) for k in kept):
            kept.append(fit)
    return kept


def _fault(fit: Fit, answer: StillFit) -> str:
    """Why a fit is not to be used; empty: it is."""
    for curve in WETTED:
        share = np.nan_to_num(fit.share(curve))
        if share < _LEAST_SHARE:
            return (
                f"the {curve.value} of the liquid shows on {100.0 * share:.0f} % of its length; "
                "the whole container must be in the image, sharp and unobstructed"
            )
    level = np.nanmax([fit.share(Curve.FRONT), fit.share(Curve.REAR), 0.0])
    if level < _LEAST_SHARE:
        return (
            f"the still level shows on {100.0 * level:.0f} % of its length; the liquid must be at "
            "rest and stand out from what is above it"
        )
    if not answer.residual <= MAX_RESIDUAL:
        return (
            f"the container's edges lie {answer.residual:.2f} px rms from the best pose, more "
            f"than {MAX_RESIDUAL:g}; check the intrinsic parameters and the dimensions"
        )
    worst = max(answer.height_stddev.values())
    if not worst <= MAX_HEIGHT_ERROR:
        return (
            f"it determines heights to {1e3 * worst:.1f} mm only, {1e3 * MAX_HEIGHT_ERROR:g} mm "
            "are needed; the container must fill more of the image"
        )
    return ""


def _check_rival(view: CupView, best: Fit, rival: Fit) -> None:
    """Refuse where two different poses explain the image equally well."""
    if rival.score < _RIVAL * best.score or rival.rms > _RIVAL_RESIDUAL * best.rms:
        return
    try:
        other = view_at(view.camera, view.cup, rival.place)
    except SloshCameraError:
        return
    shift = _heights(other, view, Wall.FRONT) - np.repeat(HEIGHTS, _ARC.size)
    # A ray that misses the other container's wall gives no number.
    if not np.max(np.abs(shift)) <= _SAME:
        poses = " or ".join(
            f"{1e3 * fit.place.distance:.0f} mm from the container and "
            f"{1e3 * fit.place.height:.0f} mm above the still level"
            for fit in (best, rival)
        )
        raise SloshCameraError(
            f"still image: two poses fit equally well, {poses}; the floor in the image, a board, "
            "or fewer other things would tell"
        )


def _result(
    fit: Fit, camera: PinholeCamera, pinhole: PinholeCamera, cup: Cup, azimuth: float
) -> StillFit:
    view = view_at(camera, cup, fit.place, azimuth)
    upright = view_at(pinhole, cup, fit.place)
    checks = tuple(
        _checked(seen.curve, seen.samples, residual)
        for seen, residual in zip(fit.seen, fit.residuals, strict=True)
    )
    front = [check.rms for check in checks if check.name == Curve.FRONT.value]
    ((u, v),) = upright.project_wall(AZIMUTH, 0.0, Wall.FRONT)
    return StillFit(
        view,
        fit.place,
        np.sqrt(np.diag(fit.covariance)),
        fit.rms,
        (front[0] if front else float("nan")) * upright.height_per_pixel((u, v), Wall.FRONT),
        {wall: _height_stddev(upright, fit, wall) for wall in Wall},
        checks,
    )


def _checked(curve: Curve, samples: int, residual: FloatArray) -> CurveCheck:
    near = residual[np.abs(residual) < INLIER]
    rms = float(np.sqrt(np.mean(near**2))) if near.size else float("nan")
    offset = float(np.median(residual)) if residual.size else float("nan")
    return CurveCheck(curve.value, near.size / samples, offset, rms)


def _height_stddev(view: CupView, fit: Fit, wall: Wall) -> float:
    """Largest standard error of a height, by the place's covariance [m]."""
    here = _heights(view, view, wall)
    columns = []
    for index in range(fit.covariance.shape[0]):
        moved = fit.place.numbers
        moved[index] += _STEP
        other = view_at(view.camera, view.cup, CameraPlace(*moved))
        columns.append((_heights(other, view, wall) - here) / _STEP)
    slope = np.column_stack(columns)
    variance = np.einsum("ni,ij,nj->n", slope, fit.covariance, slope)
    return float(np.sqrt(np.nanmax(variance)))


def _heights(view: CupView, truth: CupView, wall: Wall) -> FloatArray:
    """Heights that a view reads where another one sees points of the wall [m]."""
    arc = AZIMUTH + (_ARC if wall is Wall.FRONT else np.pi - _ARC)
    azimuth, height = np.tile(arc, len(HEIGHTS)), np.repeat(HEIGHTS, arc.size)
    return view.on_wall(truth.project_wall(azimuth, height, wall), wall)[1]
