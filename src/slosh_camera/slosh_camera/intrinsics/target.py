"""What pictures for intrinsic parameters show: a chessboard, or a board of markers."""

from __future__ import annotations

import re
from dataclasses import dataclass

import cv2
import numpy as np

from slosh_base.types import Array
from slosh_camera.calibrate.aruco import find_corners
from slosh_camera.calibrate.board import FORMAT, Board, parse_board
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image, to_gray

CHESSBOARD_FORMAT = "COLSxROWS"
_LEAST_SIDE, _MOST_SIDE = 3, 50
_LONGEST_SQUARE = 1.0
_CHESSBOARD = re.compile(r"(\d{1,3})x(\d{1,3})", re.IGNORECASE)
_FLAGS = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY


@dataclass(frozen=True, slots=True)
class Chessboard:
    """A printed chessboard.

    Attributes:
        columns: inner corners in a row: one less than squares.
        rows: inner corners in a column.
        square: side of a square [m].
    """

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        """Refuse a board that cannot be."""
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
    """A board as a command line tells it.

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
    """Corners of the board that an image shows.

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
