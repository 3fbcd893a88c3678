"""Calibration from a still image of a round container: its pose, how sure it is, or a refusal."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import (
    AZIMUTH,
    EMPTY,
    WETTED,
    Curve,
    distances,
    look_for_curves,
    sides_of,
    view_at,
    width_of,
)
from slosh_camera.calibrate.doubt import KNOWN, QUANTITIES, Doubt, Told
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
"""Residual up to which a fit is believed without a warning [px]."""
_LOST_RESIDUAL = 0.8
# Residual of a fit whose standard errors are what they seem [px]; they grow with a larger one.
_USUAL_RESIDUAL = 0.4
MAX_HEIGHT_ERROR = 1e-3
"""Standard error of a height up to which a pose is of use without a warning [m]."""
_LOST_HEIGHT = 3e-3
_LEAST_SHARE = 0.5
CLEAR_SHARE = 0.7
"""A curve that shows on less of its length may be another thing's edge."""
_CANDIDATES, _FINE_FITS = 6, 3
# The coarse search takes so many columns at least, and less than twice as many.
_SEARCH_WIDTH = 800
# A second place counts as another answer where it moves a height by more than this [m], and as a
# rival where its score comes so close to the best and its residual is at most so much larger.
_SAME = 1e-3
# Rough fits that differ by less than this, relative to the distance or [rad], are one.
_ALIKE = 0.02
_RIVAL, _RIVAL_RESIDUAL = 0.93, 1.5
# What stands between the sides of a container so many times as wide is rather seen through it, or
# stuck to it, though it scores higher: unless the wide one scores less than this part.
_WIDER, _ENCLOSING = 1.25, 0.6
# What shows of the empty glass, or else of the floor, where the container is what it seems.
_LEAST_GLASS, _LEAST_FLOOR = 0.35, 0.5
# How well a distance is known that is told, as a part of it.
_TOLD_DISTANCE = 0.1
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
        stddev: (8,) standard errors of the place's numbers and of what was told about the focal
            length, the wall's thickness and the fill height, in the order and units of
            CameraPlace and of Told.off_by; 0 for what was known.
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
    doubt: Doubt = KNOWN,
    distance: float | None = None,
) -> StillFit:
    """Pose of a container by its edges and its still level in an image.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red, liquid at rest.
        camera: its camera.
        cup: the container.
        azimuth: at which the camera stands about the container's axis [rad]; the picture of a
            round container does not show it.
        hint: what a board tells in addition.
        doubt: how far camera and container may be off; what is in doubt is estimated.
        distance: of the camera from the container's axis, to a tenth [m]; None: unknown.

    Returns:
        The pose.

    Raises:
        SloshCameraError: the image does not fit the camera, or does not determine the pose.
    """
    check_size(image, camera)
    straight, pinhole = undistorted(image, camera)
    told = Told(pinhole, cup, doubt)
    edges = edge_image(straight)
    candidates = _candidates(straight, pinhole, cup, distance)
    starts = [candidate.place for candidate in candidates]
    hint = hint if distance is None else hint.with_distance(distance, _TOLD_DISTANCE * distance)

    def roughly(places: list[CameraPlace]) -> list[Fit]:
        tries = [fit_place(edges, told, place, hint, rough=True) for place in places]
        return _distinct([fit for fit in tries if fit])

    rough = _worth_a_fit(roughly(starts))
    places = [fit.place for fit in rough]
    places += [_mirrored(place, cup) for place in places]
    fits = [fit_place(edges, told, place, hint) for place in places]
    ranked = sorted((fit for fit in fits if fit), key=lambda fit: -fit.score)
    if not ranked:
        raise SloshCameraError(
            "still image: no round container is found; its two sides and the still level must be "
            "in the image, sharp and clear of other edges: a plain background, dyed liquid, or "
            "--scale with two clicks"
        )
    answers = [_result(fit, camera, azimuth) for fit in ranked]
    sure = distance is not None
    faults = [_fault(fit, answer, sure) for fit, answer in zip(ranked, answers, strict=True)]
    if all(faults):
        raise SloshCameraError(f"still image: {faults[0]}")
    best = faults.index("")
    view = view_at(ranked[best].camera, ranked[best].cup, ranked[best].place)
    if not sure:
        # Also one that scores higher, but that neither glass nor floor speaks for.
        for rival, fault in zip(ranked, faults, strict=True):
            if rival is not ranked[best] and (not fault or not _is_corroborated(rival)):
                _check_rival(view, ranked[best], rival)
        _check_enclosed(ranked[best], ranked)
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
    every = np.zeros((len(covariance) + QUANTITIES,) * 2)
    every[: len(covariance), : len(covariance)] = covariance
    fit = Fit(pinhole, view.cup, place, every, 1.0, seen, residuals, float("nan"))
    return _result(fit, view.camera, azimuth)


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


def _candidates(
    image: Image, camera: PinholeCamera, cup: Cup, distance: float | None
) -> list[Candidate]:
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
    edges = edge_image(image)
    if distance is None:
        return find_candidates(edges, camera, cup, _CANDIDATES)
    # Of many, those about as far away as is told.
    many = find_candidates(edges, camera, cup, 4 * _CANDIDATES)
    near = [c for c in many if abs(c.place.distance - distance) < 3 * _TOLD_DISTANCE * distance]
    return near[:_CANDIDATES]


def _worth_a_fit(rough: list[Fit]) -> list[Fit]:
    """The best rough fits, and the one of the nearest container, in which others may be parts."""
    if not rough:
        return []
    best = rough[:_FINE_FITS]
    wide = min(rough, key=lambda fit: fit.place.distance)
    return best if wide in best else [*best, wide]


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


def _fault(fit: Fit, answer: StillFit, sure: bool) -> str:
    """Why a fit is not to be used, `sure`: of a container whose distance is told; empty: it is."""
    for curve in WETTED:
        share = np.nan_to_num(fit.share(curve))
        if share < _LEAST_SHARE:
            return (
                f"the {curve.value} of the liquid shows on {100.0 * share:.0f} % of its length; "
                "the whole container must be in the image, sharp and unobstructed"
            )
    level = np.nanmax([fit.share(Curve.FRONT), fit.share(Curve.REAR), 0.0])
    if max(level, min(fit.share(curve) for curve in WETTED)) < CLEAR_SHARE:
        return (
            f"the sides and the still level show on {100.0 * level:.0f} % of their length at "
            "most; a plain background, dyed liquid or a clean glass would show more, or --scale "
            "takes two clicks"
        )
    if level < _LEAST_SHARE:
        return (
            f"the still level shows on {100.0 * level:.0f} % of its length; the liquid must be at "
            "rest and stand out from what is above it"
        )
    if not answer.residual <= _LOST_RESIDUAL:
        return (
            f"the container's edges lie {answer.residual:.2f} px rms from the best pose, more "
            f"than {_LOST_RESIDUAL:g}; check the intrinsic parameters and the dimensions, or take "
            "the picture before a plain background"
        )
    if not sure and not _is_corroborated(fit):
        return (
            f"two sides and a level {1e3 * fit.place.distance:.0f} mm away fit, but neither the "
            "glass above the level nor the floor is where it should be: something else than the "
            "container, as a label or a reflection; take the picture from elsewhere or before a "
            "plain background, or tell --distance"
        )
    worst = max(answer.height_stddev.values())
    if not worst <= _LOST_HEIGHT:
        return (
            f"it determines heights to {1e3 * worst:.1f} mm only, {1e3 * _LOST_HEIGHT:g} mm are "
            "needed; the container must fill more of the image, and a camera a little above the "
            "level sees both of its lines"
        )
    return ""


def _is_corroborated(fit: Fit) -> bool:
    """Whether a curve that the pose does not rest on is where it should be, if it can be seen.

    A wall of no thickness shows no glass.
    """
    if fit.cup.wall_thickness == 0.0:
        return True
    glass = [fit.share(curve) for curve in EMPTY]
    floor = fit.share(Curve.BASE)
    known = [share for share in glass if np.isfinite(share)]
    if not known and not np.isfinite(floor):
        return True
    return max(known, default=0.0) >= _LEAST_GLASS or floor >= _LEAST_FLOOR


def _check_rival(view: CupView, best: Fit, rival: Fit) -> None:
    """Refuse where two different poses explain the image equally well."""
    if rival.score < _RIVAL * best.score or rival.rms > _RIVAL_RESIDUAL * best.rms:
        return
    try:
        other = view_at(rival.camera, rival.cup, rival.place)
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
            f"still image: two poses fit equally well, {poses}; tell which by --distance, or take "
            "a picture with the floor in it, a board, or fewer other things"
        )


def _check_enclosed(best: Fit, fits: list[Fit]) -> None:
    """Refuse what stands between the sides of another container: a part of that, or behind it.

    The other one need not be good enough to be used: of clear glass with droplets little is seen.
    """
    for wide in fits:
        if wide.score >= _ENCLOSING * best.score and _encloses(wide, best):
            raise SloshCameraError(
                f"still image: what fits best, {1e3 * best.place.distance:.0f} mm away, stands "
                f"between the sides of what may be the container, {1e3 * wide.place.distance:.0f} "
                "mm away: a label, a reflection, or another glass seen through it; tell which by "
                "--distance, or take away what is on the container and behind it"
            )


def _encloses(wide: Fit, narrow: Fit) -> bool:
    """Whether a fit is clearly wider than another one and has its middle between its sides."""
    outer, inner = (view_at(fit.camera, fit.cup, fit.place) for fit in (wide, narrow))
    if width_of(outer) < _WIDER * width_of(inner):
        return False
    (left, right), ends = sides_of(outer), sides_of(inner)
    middle = 0.5 * (ends[0][0] + ends[1][0])
    return bool(left[0] < middle < right[0])


def _result(fit: Fit, camera: PinholeCamera, azimuth: float) -> StillFit:
    lens = replace(fit.camera, distortion=camera.distortion)
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


def _checked(curve: Curve, samples: int, residual: FloatArray) -> CurveCheck:
    near = residual[np.abs(residual) < INLIER]
    rms = float(np.sqrt(np.mean(near**2))) if near.size else float("nan")
    offset = float(np.median(residual)) if residual.size else float("nan")
    return CurveCheck(curve.value, near.size / samples, offset, rms)


def _height_stddev(view: CupView, fit: Fit, wall: Wall) -> float:
    """Largest standard error of a height, by the covariance of all that was fitted [m]."""
    told = Told(fit.camera, fit.cup)
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


def _doubtful(fit: Fit) -> float:
    """Factor of the standard errors where curves contradict each other, or edges their curve."""
    return float(np.nanmax([fit.tension, fit.rms / _USUAL_RESIDUAL, 1.0]))


def _heights(view: CupView, truth: CupView, wall: Wall) -> FloatArray:
    """Heights that a view reads where another one sees points of the wall [m]."""
    arc = AZIMUTH + (_ARC if wall is Wall.FRONT else np.pi - _ARC)
    azimuth, height = np.tile(arc, len(HEIGHTS)), np.repeat(HEIGHTS, arc.size)
    return view.on_wall(truth.project_wall(azimuth, height, wall), wall)[1]
