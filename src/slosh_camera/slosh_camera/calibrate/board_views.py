"""Camera matrix and lens distortion from pictures of a board, by OpenCV's calibrateCamera."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from slosh_base.files.yaml_document import format_yaml
from slosh_base.types import Array
from slosh_camera.calibrate.board import FORMAT, Board, find_corners, parse_board
from slosh_camera.calibrate.intrinsics import lens_block
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image, to_gray
from slosh_camera.optics.camera import PinholeCamera, camera_from_info
from slosh_camera.optics.lens import COEFFICIENTS, EQUIDISTANT, PLUMB_BOB, THIN_PRISM

_CHESSBOARD = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
# A third radial coefficient makes more of noise than of most lenses; ROS leaves it out, too.
_MODEL = {
    PLUMB_BOB: cv2.CALIB_FIX_K3,
    THIN_PRISM: cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL,
}
# OpenCV 5 has one set of flags, OpenCV 4 another one for fisheye lenses.
_HOME = cv2.fisheye if hasattr(cv2.fisheye, "CALIB_FIX_SKEW") else cv2
_FISHEYE = _HOME.CALIB_RECOMPUTE_EXTRINSIC | _HOME.CALIB_FIX_SKEW
_LEAST_VIEWS, _LEAST_CORNERS, _MOST_GROUPS = 4, 6, 10
# Motion of the corners of one pose, as part of the image's width.
_SAME_POSE = 0.004
# A picture that is blurred, or a bent board: error against the median, and at least [px].
_OUTLIER, _OUTLIER_LEAST = 3.0, 0.5
_WORST_RMS, _WORST_FOCAL = 3.0, 0.05  # px, relative standard error
_TILT = "tilt the board by 20 to 40 deg in different directions, and take some from near"


class Chessboard(NamedTuple):
    """A chessboard: inner corners in a row and in a column, side of a square [m]."""

    columns: int
    rows: int
    square: float


class View(NamedTuple):
    """A picture's name, corners on the board (N, 3) [m] and in the picture (N, 2) [px]."""

    name: str
    points: Array
    pixels: Array


class CameraFit(NamedTuple):
    """A camera from pictures of a board.

    Attributes:
        stddev: standard errors of fx, fy, cx, cy [px].
        rms: distance between corners and where the camera puts them [px].
        used: the same for each picture by its name [px].
        left_out: the reason for each other picture by its name.
    """

    camera: PinholeCamera
    stddev: dict[str, float]
    rms: float
    used: dict[str, float]
    left_out: dict[str, str]


def parse_target(text: str, square: float | None) -> Chessboard | Board:
    """Parses a board: inner corners like 9x6 with the side of a square [m], or `parse_board`'s.

    Raises:
        SloshCameraError: it is no board, or the square is missing or of no use.
    """
    if ":" in text:
        if square is not None:
            raise SloshCameraError("square: a marker board's description includes its sizes")
        return parse_board(text)
    sides = text.lower().split("x")
    if len(sides) != 2 or not all(side.isdecimal() and 3 <= int(side) <= 50 for side in sides):
        raise SloshCameraError(
            f"board: {text!r} is not COLSxROWS, 3 to 50 inner corners each, or {FORMAT}"
        )
    if square is None or not square > 0.0:
        raise SloshCameraError("square: is needed with a chessboard, the side of a square in m")
    return Chessboard(int(sides[0]), int(sides[1]), square)


def corners_of(image: Image, board: Chessboard | Board) -> tuple[Array, Array]:
    """Detects a board's corners: on the board (N, 3) [m], in the image (N, 2) [px]; N may be 0."""
    if isinstance(board, Board):
        return find_corners(image, board.charuco, *board.opencv())
    size = (board.columns, board.rows)
    found, corners = cv2.findChessboardCornersSB(to_gray(image), size, flags=_CHESSBOARD)
    if not found:
        return np.empty((0, 3)), np.empty((0, 2))
    places = np.zeros((board.columns * board.rows, 3))
    places[:, :2] = np.mgrid[: board.columns, : board.rows].T.reshape(-1, 2) * board.square
    return places, np.asarray(corners, np.float64).reshape(-1, 2)


def fit_camera(
    pictures: Iterable[tuple[str, Image]], board: Chessboard | Board, lens: str = PLUMB_BOB
) -> CameraFit:
    """Estimates a camera from pictures of a board in different poses.

    The standard errors are those of the fit, or the jackknife's over pictures if they are larger:
    it knows of what a whole picture shares (blur, a bent board, a rolling shutter).

    Args:
        pictures: names and images of one camera at one resolution.
        lens: model of the distortion, one of slosh_camera.optics.lens.COEFFICIENTS.

    Raises:
        SloshCameraError: the pictures are too few, differ in size, or do not determine the camera.
    """
    used: list[View] = []
    left_out: dict[str, str] = {}
    size, first = (0, 0), ""
    for name, image in pictures:
        here = (int(image.shape[1]), int(image.shape[0]))
        if size == (0, 0):
            size, first = here, name
        if here != size:
            raise SloshCameraError(
                f"{name}: {here[0]} x {here[1]} pixels, but {first} has {size[0]} x {size[1]}; "
                "all pictures must be of one camera at one resolution"
            )
        view = View(name, *corners_of(image, board))
        reason = _reason(view, used, size[0])
        if reason:
            left_out[name] = reason
        else:
            used.append(view)
    _check_enough(used, left_out)
    matrix, coefficients, stddev, errors = _solve(used, size, lens)
    limit = max(_OUTLIER * float(np.median(errors)), _OUTLIER_LEAST)
    sharp = [view for view, error in zip(used, errors, strict=True) if error <= limit]
    if _LEAST_VIEWS <= len(sharp) < len(used):
        left_out |= {
            view.name: f"its corners lie {error:.2f} px off: blurred, or the board bent"
            for view, error in zip(used, errors, strict=True) if error > limit
        }  # fmt: skip
        used = sharp
        matrix, coefficients, stddev, errors = _solve(used, size, lens)
    stddev = np.maximum(stddev, _jackknife(used, size, lens, (matrix, coefficients)))
    rms = float(np.sqrt(np.mean(np.square(errors))))
    _check_determined(rms, float(np.max(stddev[:2] / np.diag(matrix)[:2])))
    camera = camera_from_info(matrix.ravel().tolist(), coefficients.tolist(), *size, lens)
    named = dict(zip(("fx", "fy", "cx", "cy"), stddev.tolist(), strict=True))
    by_name = {view.name: float(error) for view, error in zip(used, errors, strict=True)}
    return CameraFit(camera, named, rms, by_name, left_out)


def _reason(view: View, used: Sequence[View], width: int) -> str:
    """Returns why a picture is of no use; empty if it is of use."""
    if not len(view.pixels):
        return "the board is not found: all of it must be seen, sharp and evenly lit"
    if len(view.pixels) < _LEAST_CORNERS or np.linalg.matrix_rank(view.points, 1e-6) < 2:
        return f"{len(view.pixels)} corners are seen; {_LEAST_CORNERS} not on a line are needed"
    for other in used:
        if np.array_equal(view.points, other.points):
            shift = np.sqrt(np.mean(np.sum(np.square(view.pixels - other.pixels), axis=1)))
            if shift < _SAME_POSE * width:
                return f"the same pose as {other.name}"
    return ""


def _check_enough(used: Sequence[View], left_out: dict[str, str]) -> None:
    if len(used) < _LEAST_VIEWS:
        why = "".join(f"; {name}: {reason}" for name, reason in list(left_out.items())[:1])
        raise SloshCameraError(
            f"pictures: {len(used)} of {len(used) + len(left_out)} can be used, {_LEAST_VIEWS} "
            f"are needed, better 15, with the board in different poses{why}; inner corners of a "
            "chessboard are counted, not squares"
        )


def _check_determined(rms: float, focal_error: float) -> None:
    if not rms <= _WORST_RMS:
        raise SloshCameraError(
            f"pictures: corners lie {rms:.1f} px rms from the best camera, more than "
            f"{_WORST_RMS:g}; check the board's description and that it is flat"
        )
    if not focal_error <= _WORST_FOCAL:
        raise SloshCameraError(
            f"pictures: the focal length is uncertain by {focal_error:.0%}; {_TILT}"
        )


def _solve(
    views: Sequence[View], size: tuple[int, int], lens: str,
    start: tuple[Array, Array] | None = None,
) -> tuple[Array, Array, Array, Array]:  # fmt: skip
    """Returns matrix, coefficients, standard errors (4,) and each view's rms error [px]."""
    matrix, coefficients = start or (np.eye(3), np.zeros(COEFFICIENTS[lens]))
    found: Any
    try:
        if lens == EQUIDISTANT:
            guess = 0 if start is None else _HOME.CALIB_USE_INTRINSIC_GUESS
            found = cv2.fisheye.calibrate(
                [view.points.reshape(1, -1, 3) for view in views],
                [view.pixels.reshape(1, -1, 2) for view in views],
                size, matrix.copy(), coefficients.reshape(4, 1).copy(),
                flags=_FISHEYE | guess,
                criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 100, 1e-9),
            )  # fmt: skip
            stddev, errors = np.zeros(4), _fisheye_errors(views, *found[1:])
        else:
            guess = 0 if start is None else cv2.CALIB_USE_INTRINSIC_GUESS
            found = cv2.calibrateCameraExtended(
                [view.points.astype(np.float32).reshape(-1, 1, 3) for view in views],
                [view.pixels.astype(np.float32).reshape(-1, 1, 2) for view in views],
                size, matrix.copy(), coefficients.copy(),
                flags=guess | _MODEL.get(lens, cv2.CALIB_RATIONAL_MODEL),
            )  # fmt: skip
            stddev, errors = found[5].ravel()[:4], found[7].ravel()
    except cv2.error as error:
        raise SloshCameraError(
            f"pictures: no camera explains the boards; check the board and the lens; {_TILT}"
        ) from error
    if not np.all(np.isfinite(found[1])):
        raise SloshCameraError("pictures: no camera explains the boards in them")
    return found[1], found[2].ravel()[: COEFFICIENTS[lens]], stddev, errors


def _fisheye_errors(
    views: Sequence[View], matrix: Array, lens: Array, turns: Sequence[Array],
    shifts: Sequence[Array],
) -> Array:  # fmt: skip
    errors = []
    for view, turn, shift in zip(views, turns, shifts, strict=True):
        points = view.points.reshape(1, -1, 3)
        put, _ = cv2.fisheye.projectPoints(points, turn, shift, matrix, lens)
        errors.append(np.mean(np.sum(np.square(put.reshape(-1, 2) - view.pixels), axis=1)))
    return np.sqrt(errors)


def _jackknife(
    views: Sequence[View], size: tuple[int, int], lens: str, start: tuple[Array, Array]
) -> Array:
    """Returns jackknife standard errors (4,) of fx, fy, cx, cy [px]."""
    count = min(len(views), _MOST_GROUPS)
    found = []
    for group in range(count):
        fewer = [view for number, view in enumerate(views) if number % count != group]
        found.append(_solve(fewer, size, lens, start)[0][[0, 1, 0, 1], [0, 1, 2, 2]])
    errors: Array = np.sqrt(count - 1.0) * np.std(found, axis=0)
    return errors


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
