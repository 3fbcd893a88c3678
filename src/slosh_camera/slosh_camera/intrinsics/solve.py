"""Estimates intrinsic camera parameters with standard deviations from calibration images."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from slosh_base.files.yaml_document import format_yaml
from slosh_base.types import Array
from slosh_camera.calibrate.intrinsics import lens_block
from slosh_camera.errors import SloshCameraError
from slosh_camera.intrinsics.tuning import TUNING
from slosh_camera.intrinsics.views import LeftOut, View, Views
from slosh_camera.optics.camera import PinholeCamera, camera_from_info
from slosh_camera.optics.lens import (
    COEFFICIENTS,
    EQUIDISTANT,
    PLUMB_BOB,
    RATIONAL_POLYNOMIAL,
    THIN_PRISM,
)

# A third radial coefficient of plumb_bob makes more of noise than of most lenses; ROS leaves it
# out, too.
_FLAGS = {
    PLUMB_BOB: cv2.CALIB_FIX_K3,
    RATIONAL_POLYNOMIAL: cv2.CALIB_RATIONAL_MODEL,
    THIN_PRISM: cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL,
}
# OpenCV 5 has one set of flags, OpenCV 4 another one for fisheye lenses.
_FISHEYE_HOME = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2
_FISHEYE_FLAGS = _FISHEYE_HOME.CALIB_RECOMPUTE_EXTRINSIC | _FISHEYE_HOME.CALIB_FIX_SKEW
# OpenCV's fisheye solver starts anew from scratch and needs no fewer steps than these.
_FISHEYE_STEPS = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-9)
_NAMES = ("fx", "fy", "cx", "cy")
_MOST_GROUPS = 20


@dataclass(frozen=True, slots=True, eq=False)
class SolvedView:
    """An image of a calibration board, with the corner positions that the estimate predicts.

    Attributes:
        view: the board as seen.
        rotation: (3, 3) board -> camera; the board's z is into the page.
        projected: (N, 2) where its corners should be [px].
        rms: of the corners' distances from there [px].
    """

    view: View
    rotation: Array
    projected: Array
    rms: float


@dataclass(frozen=True, slots=True, eq=False)
class IntrinsicFit:
    """A camera estimated from images of a calibration board.

    Attributes:
        camera: intrinsic parameters.
        stddev: standard errors of fx, fy, cx, cy, by name [px].
        rms: distance between corners and their places over all views [px].
        views: that were used.
        left_out: pictures that were not.
    """

    camera: PinholeCamera
    stddev: dict[str, float]
    rms: float
    views: tuple[SolvedView, ...]
    left_out: tuple[LeftOut, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    model: str
    matrix: Array
    lens: Array
    stddev: Array
    rms: float
    turns: Sequence[Array]
    shifts: Sequence[Array]
    view_rms: Array

    @property
    def numbers(self) -> Array:
        """Focal lengths and principal point: fx, fy, cx, cy [px]."""
        return self.matrix[[0, 1, 0, 1], [0, 1, 2, 2]]

    @property
    def coefficients(self) -> list[float]:
        """Distortion coefficients of the lens."""
        return [float(value) for value in self.lens.ravel()[: COEFFICIENTS[self.model]]]


def solve_intrinsics(views: Views, lens: str = PLUMB_BOB) -> IntrinsicFit:
    """Estimates a camera's matrix and lens distortion from images of a calibration board.

    The standard errors are the larger of two: what the scatter of the corners makes of the fit,
    and how much the fit changes when pictures are left out in turn (jackknife). The latter knows
    of what a whole picture shares: blur, a bent board, a shutter that rolls.

    Args:
        views: of one camera.
        lens: model of the distortion, one of slosh_camera.optics.lens.COEFFICIENTS. Of plumb_bob
            k1, k2, p1 and p2 are fitted.

    Returns:
        The camera.

    Raises:
        SloshCameraError: no camera explains the views, or they leave the focal length open.
    """
    used, left_out = list(views.used), list(views.left_out)
    found = _solved(used, views.size, lens)
    while True:
        worst = int(np.argmax(found.view_rms))
        limit = max(TUNING.outlier * float(np.median(found.view_rms)), TUNING.outlier_least)
        if found.view_rms[worst] <= limit or len(used) <= TUNING.least_views:
            break
        reason = f"its corners lie {found.view_rms[worst]:.2f} px off: blurred, or the board bent"
        left_out.append(LeftOut(used.pop(worst).name, reason))
        found = _solved(used, views.size, lens)
    stddev = np.maximum(found.stddev, _jackknife(used, views.size, found))
    _check_determined(found, stddev)
    camera = camera_from_info(found.matrix.ravel().tolist(), found.coefficients, *views.size, lens)
    named = dict(zip(_NAMES, (float(value) for value in stddev), strict=True))
    return IntrinsicFit(camera, named, found.rms, _solved_views(used, found), tuple(left_out))


def _solved(
    used: Sequence[View], size: tuple[int, int], model: str, start: _Solution | None = None
) -> _Solution:
    solve = _fisheye if model == EQUIDISTANT else _polynomial
    try:
        found = solve(used, size, model, start)
    except cv2.error as error:
        raise SloshCameraError(
            "pictures: no camera explains the boards in them; check the board's description and "
            "the lens, and tilt the board by 20 to 40 deg in different directions"
        ) from error
    if not np.all(np.isfinite(found.matrix)) or not np.isfinite(found.rms):
        raise SloshCameraError("pictures: no camera explains the boards in them")
    return found


def _polynomial(
    used: Sequence[View], size: tuple[int, int], model: str, start: _Solution | None
) -> _Solution:
    points = [view.points.astype(np.float32) for view in used]
    pixels = [view.pixels.astype(np.float32).reshape(-1, 1, 2) for view in used]
    matrix = np.eye(3) if start is None else start.matrix.copy()
    lens = np.zeros(COEFFICIENTS[model]) if start is None else start.lens.copy()
    flags = _FLAGS[model] if start is None else _FLAGS[model] | cv2.CALIB_USE_INTRINSIC_GUESS
    rms, k, d, turns, shifts, stddev, _, view_rms = cv2.calibrateCameraExtended(
        points, pixels, size, matrix, lens, flags=flags
    )
    matrix, lens, errors, each = (
        np.asarray(value, np.float64) for value in (k, d, stddev[:4], view_rms)
    )
    return _Solution(
        model, matrix, lens, errors.ravel(), float(rms), _vectors(turns), _vectors(shifts),
        each.ravel(),
    )  # fmt: skip


def _fisheye(
    used: Sequence[View], size: tuple[int, int], model: str, start: _Solution | None
) -> _Solution:
    """Runs OpenCV's fisheye calibration, which gives no standard deviations."""
    points = [view.points.reshape(1, -1, 3) for view in used]
    pixels = [view.pixels.reshape(1, -1, 2) for view in used]
    matrix = np.eye(3) if start is None else start.matrix.copy()
    lens = np.zeros((4, 1)) if start is None else start.lens.copy()
    guess = 0 if start is None else _FISHEYE_HOME.CALIB_USE_INTRINSIC_GUESS
    rms, k, d, turns, shifts = cv2.fisheye.calibrate(
        points, pixels, size, matrix, lens, flags=_FISHEYE_FLAGS | guess, criteria=_FISHEYE_STEPS
    )
    matrix, lens = np.asarray(k, np.float64), np.asarray(d, np.float64)
    found = _Solution(
        model, matrix, lens, np.zeros(4), float(rms), _vectors(turns), _vectors(shifts),
        np.zeros(len(used)),
    )  # fmt: skip
    poses = zip(used, found.turns, found.shifts, strict=True)
    each = [_rms(view, _projected(found, view, turn, shift)) for view, turn, shift in poses]
    return replace(found, view_rms=np.array(each))


def _projected(found: _Solution, view: View, turn: Array, shift: Array) -> Array:
    """Returns the corner positions that a camera predicts for an image (N, 2) [px]."""
    if found.model == EQUIDISTANT:
        points = view.points.reshape(1, -1, 3)
        pixels, _ = cv2.fisheye.projectPoints(points, turn, shift, found.matrix, found.lens)
    else:
        pixels, _ = cv2.projectPoints(view.points, turn, shift, found.matrix, found.lens)
    return np.asarray(pixels, np.float64).reshape(-1, 2)


def _rms(view: View, projected: Array) -> float:
    return float(np.sqrt(np.mean(np.sum((projected - view.pixels) ** 2, axis=1))))


def _vectors(values: Iterable[Any]) -> list[Array]:
    return [np.asarray(value, np.float64) for value in values]


def _jackknife(used: Sequence[View], size: tuple[int, int], whole: _Solution) -> Array:
    """Returns jackknife standard deviations (4,) of fx, fy, cx, cy [px]."""
    count = min(len(used), _MOST_GROUPS)
    found = np.array(
        [
            _solved(
                [v for k, v in enumerate(used) if k % count != group], size, whole.model, whole
            ).numbers
            for group in range(count)
        ]
    )
    errors: Array = np.sqrt((count - 1) * np.mean((found - found.mean(axis=0)) ** 2, axis=0))
    return errors


def _check_determined(found: _Solution, stddev: Array) -> None:
    if found.rms > TUNING.worst_rms:
        raise SloshCameraError(
            f"pictures: corners lie {found.rms:.1f} px rms from the best camera, more than "
            f"{TUNING.worst_rms:g}; check the board's description and that it is flat"
        )
    share = float(np.max(stddev[:2] / found.numbers[:2]))
    if not share <= TUNING.worst_focal:
        raise SloshCameraError(
            f"pictures: the focal length is uncertain by {share:.0%}; tilt the board by 20 to "
            "40 deg in different directions, and take some pictures from near"
        )


def _solved_views(used: Sequence[View], found: _Solution) -> tuple[SolvedView, ...]:
    solved = []
    for view, turn, shift, rms in zip(
        used, found.turns, found.shifts, found.view_rms, strict=True
    ):
        rotation = np.asarray(cv2.Rodrigues(turn)[0], np.float64)
        projected = _projected(found, view, turn, shift)
        solved.append(SolvedView(view, rotation, projected, float(rms)))
    return tuple(solved)


def format_camera(camera: PinholeCamera, name: str) -> str:
    """Formats the camera as `ost.yaml`, which `read_known_camera` reads without loss."""
    projection = np.column_stack((camera.matrix, np.zeros(3)))
    document = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": camera.matrix.ravel().tolist()},
        **lens_block(camera),
        "rectification_matrix": {"rows": 3, "cols": 3, "data": np.eye(3).ravel().tolist()},
        "projection_matrix": {"rows": 3, "cols": 4, "data": projection.ravel().tolist()},
    }
    return format_yaml(document, sort_keys=False, default_flow_style=None, width=99)
