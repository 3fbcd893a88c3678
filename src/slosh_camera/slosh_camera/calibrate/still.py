"""Calibration from a still image of a round container: its pose, how sure it is, or a refusal."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import (
    AZIMUTH,
    distances,
    look_for_curves,
    view_at,
    width_of,
)
from slosh_camera.calibrate.doubt import KNOWN, QUANTITIES, Doubt, Told
from slosh_camera.calibrate.edges import edge_image
from slosh_camera.calibrate.fit import NO_HINT, Fit, Hint, fit_place
from slosh_camera.calibrate.pose import CameraPlace, place_of
from slosh_camera.calibrate.refusals import (
    check_enclosed,
    check_rival,
    find_fault,
    is_corroborated,
)
from slosh_camera.calibrate.search import Candidate, find_candidates
from slosh_camera.calibrate.still_fit import StillFit, still_fit
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup, CupView
from slosh_camera.optics.lens import EQUIDISTANT

FloatArray = NDArray[np.float64]
FloatMap = NDArray[np.float32]
Image = NDArray[np.uint8]

_CANDIDATES, _FINE_FITS = 6, 3
# The coarse search takes so many columns at least, and less than twice as many.
_SEARCH_WIDTH = 800
# Rough fits that differ by less than this, relative to the distance or [rad], are one.
_ALIKE = 0.02
# How well a distance is known that is told, as a part of it.
_TOLD_DISTANCE = 0.1


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
    answers = [still_fit(fit, camera, azimuth) for fit in ranked]
    sure = distance is not None
    faults = [find_fault(fit, answer, sure) for fit, answer in zip(ranked, answers, strict=True)]
    if all(faults):
        raise SloshCameraError(f"still image: {faults[0]}")
    best = faults.index("")
    view = view_at(ranked[best].camera, ranked[best].cup, ranked[best].place)
    if not sure:
        # Also one that scores higher, but that neither glass nor floor speaks for.
        for rival, fault in zip(ranked, faults, strict=True):
            if rival is not ranked[best] and (not fault or not is_corroborated(rival)):
                check_rival(view, ranked[best], rival)
        check_enclosed(ranked[best], ranked)
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
    return still_fit(fit, view.camera, azimuth)


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
    if not camera.distorts:
        return image, camera
    maps = _undistort_maps(camera)
    straight = cv2.remap(image, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(straight, dtype=np.uint8), camera.without_distortion()


def _undistort_maps(camera: PinholeCamera) -> tuple[FloatMap, FloatMap]:
    """Where each pixel of the undistorted image lies in the camera's own."""
    matrix, lens = camera.matrix, np.array(camera.distortion)
    turn, kind = np.eye(3), cv2.CV_32FC1
    if camera.distortion_model == EQUIDISTANT:
        maps = cv2.fisheye.initUndistortRectifyMap(matrix, lens, turn, matrix, camera.size, kind)
    else:
        maps = cv2.initUndistortRectifyMap(matrix, lens, None, matrix, camera.size, kind)
    across, down = (np.asarray(one, dtype=np.float32) for one in maps)
    return across, down


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
