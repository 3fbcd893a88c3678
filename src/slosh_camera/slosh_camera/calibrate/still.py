"""Calibrates the camera's pose from an image of a round container with liquid at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.curves import (
    AZIMUTH,
    Curve,
    distances,
    look_for_curves,
    view_at,
    width_of,
)
from slosh_camera.calibrate.edges import EdgeImage, edge_image
from slosh_camera.calibrate.fit import NO_HINT, Hint, PlaceFit, fit_place
from slosh_camera.calibrate.level import asked, check_exchange, check_line, levels_of
from slosh_camera.calibrate.outline import find_outline
from slosh_camera.calibrate.pose import (
    KNOWN,
    QUANTITIES,
    CameraPlace,
    GivenDeviations,
    GivenView,
    place_of,
)
from slosh_camera.calibrate.refusals import (
    check_enclosed,
    check_rival,
    find_fault,
    is_corroborated,
    level_fault,
)
from slosh_camera.calibrate.search import CandidatePlace, find_candidates
from slosh_camera.calibrate.still_fit import StillFit, still_fit
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera
from slosh_camera.optics.cup import Cup, CupView, Wall
from slosh_camera.optics.lens import EQUIDISTANT

FloatArray = NDArray[np.float64]
FloatMap = NDArray[np.float32]
Image = NDArray[np.uint8]


def calibrate_by_edges(
    image: Image,
    camera: PinholeCamera,
    cup: Cup,
    azimuth: float = AZIMUTH,
    hint: Hint = NO_HINT,
    doubt: GivenDeviations = KNOWN,
    distance: float | None = None,
    level: tuple[float, float] | None = None,
) -> StillFit:
    """Estimates the camera's pose from the edges of a container and its liquid at rest.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red, liquid at rest.
        azimuth: at which the camera stands about the container's axis [rad]; the picture of a
            round container does not show it.
        hint: what a board tells in addition.
        doubt: how far camera and container may be off; what is in doubt is estimated.
        distance: of the camera from the container's axis, to a tenth [m]; None: unknown.
        level: a pixel on the contact line of the still level, to a pixel or two; None: unknown.

    Raises:
        SloshCameraError: the image does not fit the camera, or does not determine the pose.
    """
    check_size(image, camera)
    straight, pinhole = undistorted(image, camera)
    if level is not None:
        hint = replace(hint, level=_straight_pixel(level, camera))
    if distance is not None:
        hint = hint.with_distance(distance, TUNING.told_distance * distance)
    task = _Task(straight, pinhole, GivenView(pinhole, cup, doubt), azimuth, hint, distance)
    # A large picture is most often a photograph, with more edges than a container has.
    answer = _by_outline(task) if _shrink(pinhole) > 1 and not cup.taper else None
    answer = answer or _by_edges(task)
    if hint.level is None:
        _check_level(task, answer)
    return _for_lens(answer, camera, 1)


@dataclass(frozen=True, slots=True, eq=False)
class _Task:
    """An undistorted image, and what is known of its camera pose in advance."""

    image: Image
    camera: PinholeCamera
    told: GivenView
    azimuth: float
    hint: Hint
    distance: float | None

    @property
    def sure(self) -> bool:
        """Whether the user gave the camera's distance, so that a fit must be the container."""
        return self.distance is not None


def _by_outline(task: _Task) -> StillFit | None:
    """Estimates the pose from the container's sides first; returns None if that fails.

    Raises:
        SloshCameraError: two lines may be the level.
    """
    shrink = _shrink(task.camera)
    small = _smaller(task, shrink)
    edges, told = edge_image(small.image), small.told
    outline = find_outline(edges, told.camera, told.cup, small.hint.level)
    if outline is None:
        return None
    # The level that was told is that of the curves already.
    hint = replace(task.hint, level=None)
    fit = fit_place(edges, told, outline.place, hint, found=outline.curves)
    answer = _sound(fit, small)
    if answer is None:
        return None
    answer = _for_lens(answer, task.camera, shrink)
    # Edges of the whole picture and both lines of the level tell more, where they are clear.
    finer = _sound(fit_place(edge_image(task.image), task.told, answer.place, hint), task)
    if finer is None or _level_moves(answer.view, finer.view) > TUNING.same_level:
        return answer
    return finer


def _check_level(task: _Task, answer: StillFit) -> None:
    """Raises SloshCameraError unless the line of a pose, and no other, may be the level."""
    shares = {curve.name: curve.share for curve in answer.curves}
    unseen = shares.get(Curve.REAR.value, 1.0) < TUNING.least_rear
    if unseen and not shares.get(Curve.BASE.value, 0.0) >= TUNING.least_share:
        raise asked("neither the rear line nor the floor is where the best fit has them")
    small = _smaller(task, _shrink(task.camera))
    place, _ = place_of(answer.view.pose)
    cup = answer.view.cup
    edges, view = edge_image(small.image), view_at(small.camera, cup, place)
    check_line(edges, view)
    front, rear = (shares.get(one.value, 0.0) for one in (Curve.FRONT, Curve.REAR))
    if min(front, rear) < (TUNING.least_share if front >= rear else TUNING.clear_share):
        check_exchange(edges, view, Curve.FRONT if front >= rear else Curve.REAR)


def _sound(fit: PlaceFit | None, task: _Task) -> StillFit | None:
    """Returns the pose and quality of a fit, or None if the fit fails the checks."""
    if fit is None:
        return None
    answer = still_fit(fit, task.camera, task.azimuth)
    return None if find_fault(fit, answer, sure=True, level_shows=True) else answer


def _level_moves(view: CupView, other: CupView) -> float:
    """Returns how far apart two poses put the front contact line's centre on the wall [m]."""
    azimuth = view.camera_azimuth
    (here,) = view.project_wall(azimuth, 0.0, Wall.FRONT)
    (there,) = other.project_wall(azimuth, 0.0, Wall.FRONT)
    return float(np.hypot(*(there - here))) * view.height_per_pixel(here, Wall.FRONT)


def _by_edges(task: _Task) -> StillFit:
    """Returns the pose that best explains the edges of the image.

    Raises:
        SloshCameraError: none does, or several do.
    """
    edges, cup = edge_image(task.image), task.told.cup

    def roughly(places: list[CameraPlace]) -> list[PlaceFit]:
        tries = [fit_place(edges, task.told, place, task.hint, rough=True) for place in places]
        return _distinct([fit for fit in tries if fit])

    rough = _worth_a_fit(roughly([candidate.place for candidate in _candidates(task)]))
    places = [fit.place for fit in rough]
    places += [_mirrored(place, cup) for place in places]
    fits = [fit_place(edges, task.told, place, task.hint) for place in places]
    ranked = _with_rivals(edges, task, [fit for fit in fits if fit])
    if not ranked:
        raise SloshCameraError(
            "still image: no round container is found; its two sides and the still level must be "
            "in the image, sharp and clear of other edges: a plain background, dyed liquid, a "
            "click on the level (--level U V), or --scale with two clicks"
        )
    answers = [still_fit(fit, task.camera, task.azimuth) for fit in ranked]
    told = task.hint.level
    shown, faults, rivalled = [], [], []
    for fit, answer in zip(ranked, answers, strict=True):
        levels = levels_of(edges, fit)
        shown.append(levels.shows or told is not None)
        fault = find_fault(fit, answer, task.sure, shown[-1])
        rivalled.append(not fault and told is None and levels.rival is not None)
        faults.append(fault or level_fault(fit, levels, told))
    if all(faults):
        clicked = "" if told is None else "; is the pixel of --level on the still level?"
        raise SloshCameraError(f"still image: {faults[0]}{clicked}")
    best = faults.index("")
    if any(rivalled[:best]):  # the other level of a better fit is often that of a worse one
        raise SloshCameraError(f"still image: {faults[rivalled.index(True)]}")
    view = view_at(ranked[best].camera, ranked[best].cup, ranked[best].place)
    if not task.sure:
        # Also one that scores higher, but that neither glass nor floor speaks for.
        for rival, fault in zip(ranked, faults, strict=True):
            if rival is not ranked[best] and (not fault or not is_corroborated(rival)):
                check_rival(view, ranked[best], rival)
        check_enclosed(ranked[best], ranked)
    return replace(answers[best], level_shows=shown[best])


def check_pose(
    image: Image, view: CupView, covariance: FloatArray, reach: float = 0.05
) -> StillFit:
    """Rates a camera pose found by other means by the container's edges in the image.

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
    fit = PlaceFit(pinhole, view.cup, place, every, 1.0, seen, residuals, float("nan"))
    return still_fit(fit, view.camera, azimuth)


def check_size(image: Image, camera: PinholeCamera) -> None:
    """Raises SloshCameraError if the image's size differs from the camera's."""
    if image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise SloshCameraError(
            f"still image: is {image.ndim}-dimensional {image.dtype}, needs 8-bit grey or colour"
        )
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise SloshCameraError(
            f"still image: has {width} x {height} pixels, the camera is calibrated for "
            f"{camera.width} x {camera.height}"
            + (", turned by 90 degrees" if (height, width) == camera.size else "")
        )


def undistorted(image: Image, camera: PinholeCamera) -> tuple[Image, PinholeCamera]:
    """Returns the undistorted image and the camera without distortion."""
    if not camera.distorts:
        return image, camera
    maps = _undistort_maps(camera)
    straight = cv2.remap(image, *maps, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(straight, dtype=np.uint8), camera.without_distortion()


def _undistort_maps(camera: PinholeCamera) -> tuple[FloatMap, FloatMap]:
    """Returns the original image position of each pixel of the undistorted image."""
    matrix, lens = camera.matrix, np.array(camera.distortion)
    turn, kind = np.eye(3), cv2.CV_32FC1
    if camera.distortion_model == EQUIDISTANT:
        maps = cv2.fisheye.initUndistortRectifyMap(matrix, lens, turn, matrix, camera.size, kind)
    else:
        maps = cv2.initUndistortRectifyMap(matrix, lens, None, matrix, camera.size, kind)
    across, down = (np.asarray(one, dtype=np.float32) for one in maps)
    return across, down


def _with_rivals(edges: EdgeImage, task: _Task, fits: list[PlaceFit]) -> list[PlaceFit]:
    """Adds fits that start from alternative liquid levels, and sorts all fits by score."""
    ranked = sorted(fits, key=lambda fit: -fit.score)
    if task.hint.level is not None:
        return ranked
    starts = []
    for fit in ranked[: TUNING.retried]:
        rival = levels_of(edges, fit).rival
        if rival is not None:
            starts += _at_level(fit, rival.height)
    more = [fit_place(edges, task.told, start, task.hint) for start in starts]
    return sorted((*ranked, *(fit for fit in more if fit)), key=lambda fit: -fit.score)


def _at_level(fit: PlaceFit, height: float) -> list[CameraPlace]:
    """Returns camera poses for a liquid level that is a given distance higher [m]."""
    place, radius = fit.place, fit.cup.radius
    moved = replace(place, height=place.height - height)
    # The rear line appears on the front wall so much above the contact line.
    above = -height * (place.distance + radius) / (2.0 * radius)
    if not 0.0 < -height < radius:
        return [moved]
    near = place.distance - radius
    turn = float(np.arctan2(above, near) - np.arctan2(moved.height, near))
    return [moved, replace(moved, height=above, pitch=place.pitch + turn)]


def _candidates(task: _Task) -> list[CandidatePlace]:
    small = _smaller(task, _shrink(task.camera))
    edges, camera, cup = edge_image(small.image), small.camera, task.told.cup
    level = small.hint.level
    if task.distance is None:
        return find_candidates(edges, camera, cup, TUNING.candidates, level)
    # Of many, those about as far away as is told.
    many = find_candidates(edges, camera, cup, 4 * TUNING.candidates, level)
    reach = 3 * TUNING.told_distance * task.distance
    near = [c for c in many if abs(c.place.distance - task.distance) < reach]
    return near[: TUNING.candidates]


def _shrink(camera: PinholeCamera) -> int:
    return max(max(camera.size) // TUNING.search_size, 1)


def _smaller(task: _Task, shrink: int) -> _Task:
    """Returns the calibration task for a version of the image with fewer pixels."""
    if shrink == 1:
        return task
    old = task.camera
    width, height = old.width // shrink, old.height // shrink
    part = task.image[: height * shrink, : width * shrink]
    image = np.asarray(cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    cx, cy = ((place + 0.5) / shrink - 0.5 for place in (old.cx, old.cy))
    camera = PinholeCamera(width, height, old.fx / shrink, old.fy / shrink, cx, cy)
    hint = task.hint
    if hint.level is not None:
        u, v = ((place + 0.5) / shrink - 0.5 for place in hint.level)
        hint = replace(hint, level=(u, v))
    return replace(
        task, image=image, camera=camera, told=replace(task.told, camera=camera), hint=hint
    )


def _for_lens(answer: StillFit, camera: PinholeCamera, shrink: int) -> StillFit:
    """Converts a result from the undistorted, reduced image to the original camera."""
    found = answer.view.camera
    lens = replace(camera, fx=found.fx * shrink, fy=found.fy * shrink)
    curves = tuple(
        replace(curve, offset=curve.offset * shrink, rms=curve.rms * shrink)
        for curve in answer.curves
    )
    view = CupView(lens, answer.view.pose, answer.view.cup)
    return replace(answer, view=view, residual=answer.residual * shrink, curves=curves)


def _straight_pixel(pixel: tuple[float, float], camera: PinholeCamera) -> tuple[float, float]:
    """Converts a pixel of the original image to the undistorted image.

    Raises:
        SloshCameraError: it is outside the image.
    """
    u, v = pixel
    if not (-0.5 <= u <= camera.width - 0.5 and -0.5 <= v <= camera.height - 0.5):
        raise SloshCameraError(
            f"level: ({u:g}, {v:g}) is outside the image of {camera.width} x {camera.height} "
            "pixels"
        )
    (ray,) = camera.rays(np.array([pixel], dtype=np.float64))
    return float(camera.fx * ray[0] + camera.cx), float(camera.fy * ray[1] + camera.cy)


def _worth_a_fit(rough: list[PlaceFit]) -> list[PlaceFit]:
    """Returns the coarse fits to refine: the best ones and the one with the nearest camera."""
    if not rough:
        return []
    best = rough[: TUNING.fine_fits]
    wide = min(rough, key=lambda fit: fit.place.distance)
    return best if wide in best else [*best, wide]


def _mirrored(place: CameraPlace, cup: Cup) -> CameraPlace:
    """Mirrors a camera pose to the other side of the liquid level.

    From above the rear line is often the stronger and passes for the contact line of a camera
    below.
    """
    reach = np.copysign(cup.radius, place.height)
    was = np.arctan2(place.height, place.distance + reach)
    becomes = np.arctan2(-place.height, place.distance - reach)
    return replace(place, height=-place.height, pitch=place.pitch + float(becomes - was))


def _distinct(fits: list[PlaceFit]) -> list[PlaceFit]:
    """Returns the fits with different poses, best first."""
    kept: list[PlaceFit] = []
    for fit in sorted(fits, key=lambda fit: -fit.score):
        far = TUNING.alike * fit.place.distance
        size = np.array([far, far, TUNING.alike, TUNING.alike, TUNING.alike])
        if all(np.any(np.abs(fit.place.numbers - k.place.numbers) > size) for k in kept):
            kept.append(fit)
    return kept
