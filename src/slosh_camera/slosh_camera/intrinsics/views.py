"""Board types, and selection of the images that are useful for calibration."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np

from slosh_base.types import Array
from slosh_camera.calibrate.aruco import find_corners
from slosh_camera.calibrate.board import FORMAT, Board, parse_board
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image, to_gray
from slosh_camera.intrinsics.tuning import TUNING

CHESSBOARD_FORMAT = "COLSxROWS"
_LEAST_SIDE, _MOST_SIDE = 3, 50
_LONGEST_SQUARE = 1.0
_CHESSBOARD = re.compile(r"(\d{1,3})x(\d{1,3})", re.IGNORECASE)
_FLAGS = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """An image with the calibration board that was detected in it.

    Attributes:
        name: of the picture.
        points: (N, 3) corners on the board [m].
        pixels: (N, 2) corners in the picture [px].
    """

    name: str
    points: Array
    pixels: Array


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A calibration image that is not used, with the reason.

    Attributes:
        name: of the picture.
        reason: in words.
    """

    name: str
    reason: str


@dataclass(frozen=True, slots=True)
class Views:
    """The usable and unusable calibration images of one camera.

    Attributes:
        size: width and height of all of them [px].
        used: boards.
        left_out: the others.
    """

    size: tuple[int, int]
    used: tuple[View, ...]
    left_out: tuple[LeftOut, ...]


def find_views(pictures: Iterable[tuple[str, Image]], target: Target) -> Views:
    """Detects the calibration board in images and selects those useful for calibration.

    Args:
        pictures: names and images.
        target: the board.

    Returns:
        Boards that are found, and pictures that are left out.

    Raises:
        SloshCameraError: pictures of different size, the board in none, or in too few.
    """
    size: tuple[int, int] | None = None
    first = ""
    used: list[View] = []
    left_out: list[LeftOut] = []
    smaller = 0
    for name, image in pictures:
        here = (int(image.shape[1]), int(image.shape[0]))
        if size is None:
            size, first = here, name
        if here != size:
            raise SloshCameraError(
                f"{name}: {here[0]} x {here[1]} pixels, but {first} has {size[0]} x {size[1]}; "
                "all pictures must be of one camera at one resolution"
            )
        view = View(name, *corners_of(image, target))
        reason = _reason(view, used, size[0])
        if reason:
            left_out.append(LeftOut(name, reason))
            # Who counts squares in place of corners sees the board nowhere.
            smaller += (
                not used and len(left_out) <= TUNING.least_views and _shows_less(image, target)
            )
        else:
            used.append(view)
    if size is None:
        raise SloshCameraError(f"pictures: none; at least {TUNING.least_views} are needed")
    _check_enough(used, left_out, target, smaller > 0)
    return Views(size, tuple(used), tuple(left_out))


def _reason(view: View, used: list[View], width: int) -> str:
    """Returns why an image is not useful for calibration; empty if it is useful."""
    if not len(view.pixels):
        return "the board is not found: all of it must be seen, sharp and evenly lit"
    if len(view.pixels) < TUNING.least_corners:
        return f"{len(view.pixels)} corners are seen, {TUNING.least_corners} are needed"
    spread = np.linalg.svd(view.points[:, :2] - view.points[:, :2].mean(axis=0), compute_uv=False)
    if spread[1] < TUNING.flat * spread[0]:
        return "the corners that are seen lie on one line"
    for other in used:
        if _shift(view, other) < TUNING.same_pose * width:
            return f"the same pose as {other.name}"
    return ""


def _shift(view: View, other: View) -> float:
    """Returns the RMS shift of the corners two images share [px]; inf if they share none."""
    places = {tuple(point): pixel for point, pixel in zip(other.points, other.pixels, strict=True)}
    ways = [
        pixel - places[tuple(point)]
        for point, pixel in zip(view.points, view.pixels, strict=True)
        if tuple(point) in places
    ]
    return float(np.sqrt(np.mean(np.sum(np.square(ways), axis=1)))) if ways else float("inf")


def _shows_less(image: Image, target: Target) -> bool:
    """Whether a chessboard with one square less in each direction is visible."""
    if not isinstance(target, Chessboard) or min(target.columns, target.rows) < 4:
        return False
    less = Chessboard(target.columns - 1, target.rows - 1, target.square)
    return len(corners_of(image, less)[1]) > 0


def _check_enough(
    used: list[View], left_out: list[LeftOut], target: Target, is_smaller: bool
) -> None:
    count = len(used) + len(left_out)
    if not used:
        hint = "check its description, the focus and the light"
        if is_smaller and isinstance(target, Chessboard):
            hint = (
                f"a board of {target.columns - 1}x{target.rows - 1} is: inner corners are "
                "counted, not squares"
            )
        raise SloshCameraError(f"board: is found in none of {count} pictures; {hint}")
    if len(used) < TUNING.least_views:
        why = f"; {left_out[0].name}: {left_out[0].reason}" if left_out else ""
        raise SloshCameraError(
            f"pictures: {len(used)} of {count} can be used, {TUNING.least_views} are needed, "
            f"better 15, with the board in different poses{why}"
        )


@dataclass(frozen=True, slots=True)
class Chessboard:
    """A printed chessboard and its dimensions.

    Attributes:
        columns: inner corners in a row: one less than squares.
        rows: inner corners in a column.
        square: side of a square [m].
    """

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        """Raises SloshCameraError for impossible board dimensions."""
        sides = (self.columns, self.rows)
        if not all(_LEAST_SIDE <= side <= _MOST_SIDE for side in sides):
            raise SloshCameraError(
                f"board: {self.columns} x {self.rows} inner corners, both must be "
                f"{_LEAST_SIDE} to {_MOST_SIDE}"
            )
        if not (np.isfinite(self.square) and self.square > 0.0):
            raise SloshCameraError(f"square: {self.square:g} m, must be positive")
        if self.square > _LONGEST_SQUARE:
            raise SloshCameraError(
                f"square: {self.square:g} m: did you mean {1e-3 * self.square:g} "
                f"({self.square:g} mm)?"
            )


Target = Chessboard | Board


def parse_target(text: str, square: float | None) -> Target:
    """Parses the description of a calibration board on the command line.

    Args:
        text: inner corners of a chessboard like 9x6, or a board of markers as `parse_board`
            takes it.
        square: side of a chessboard's square [m]; None: not given.

    Raises:
        SloshCameraError: the text is none of a board's, or the square is missing or of no use.
    """
    match = _CHESSBOARD.fullmatch(text)
    if match is None:
        if ":" not in text:
            raise SloshCameraError(f"board: {text!r} is not {CHESSBOARD_FORMAT} or {FORMAT}")
        if square is not None:
            raise SloshCameraError(
                "square: is for chessboards only; the description of a "
                "marker board includes its sizes"
            )
        return parse_board(text)
    if square is None:
        raise SloshCameraError("square: is needed with a chessboard, the side of a square in m")
    return Chessboard(int(match[1]), int(match[2]), square)


def corners_of(image: Image, target: Target) -> tuple[Array, Array]:
    """Detects the corners of the calibration board in an image.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red.
        target: the board.

    Returns:
        Places on the board (N, 3) [m] and in the image (N, 2) [px]; N is 0 where it is not seen.
        Of a chessboard all corners or none are found.
    """
    if isinstance(target, Board):
        return find_corners(image, target.charuco, *target.opencv())
    size = (target.columns, target.rows)
    found, corners = cv2.findChessboardCornersSB(to_gray(image), size, flags=_FLAGS)
    if not found:
        return np.empty((0, 3)), np.empty((0, 2))
    places = np.zeros((target.columns * target.rows, 3))
    places[:, :2] = np.mgrid[: target.columns, : target.rows].T.reshape(-1, 2) * target.square
    return places, np.asarray(corners, np.float64).reshape(-1, 2)
