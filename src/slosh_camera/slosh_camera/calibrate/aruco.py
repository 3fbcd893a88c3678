"""Wraps OpenCV's ArUco marker boards, for OpenCV 4.6 and for 4.7 and later.

Ubuntu 24.04 has 4.6. Both draw the same boards and number their corners in the same frame.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.errors import SloshCameraError

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]

# Its type information is that of one version.
_aruco: Any = getattr(cv2, "aruco", None)


def dictionary_of(name: str) -> Any:
    """Returns OpenCV's marker dictionary for a name such as 4X4_50.

    Raises:
        SloshCameraError: this OpenCV has no markers at all, or no such dictionary.
    """
    if _aruco is None or not hasattr(_aruco, "CharucoBoard"):
        raise SloshCameraError(f"board: OpenCV {cv2.__version__} is built without aruco")
    number = getattr(_aruco, f"DICT_{name}", None)
    if not isinstance(number, int):
        raise SloshCameraError(f"board: OpenCV has no dictionary DICT_{name}")
    return _aruco.getPredefinedDictionary(number)


def board_of(
    charuco: bool, fields: tuple[int, int], size: float, inner: float, dictionary: Any
) -> Any:
    """Creates OpenCV's board object from its columns and rows; lengths in metres."""
    name = "CharucoBoard" if charuco else "GridBoard"
    if _is_recent():
        return getattr(_aruco, name)(fields, size, inner, dictionary)
    return getattr(_aruco, f"{name}_create")(*fields, size, inner, dictionary)


def find_corners(
    image: Image, charuco: bool, board: Any, dictionary: Any
) -> tuple[FloatArray, FloatArray]:
    """Detects a board's corners: positions (N, 3) [m] on the board, pixels (N, 2) in the image."""
    find = _find_recent if _is_recent() else _find_by_functions
    points, corners = find(image, charuco, board, dictionary)
    if points is None or corners is None or len(points) != len(corners):
        return np.empty((0, 3)), np.empty((0, 2))
    places = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    return places, np.asarray(corners, dtype=np.float64).reshape(-1, 2)


def drawn_board(board: Any, width: int, height: int) -> Image:
    """Draws a board to its edges, as an image of this size [px]."""
    draw = board.generateImage if hasattr(board, "generateImage") else board.draw
    return np.asarray(draw((width, height), marginSize=0), np.uint8)


def _is_recent() -> bool:
    return hasattr(_aruco, "CharucoDetector")


def _find_recent(image: Image, charuco: bool, board: Any, dictionary: Any) -> tuple[Any, Any]:
    if charuco:
        corners, ids, _, _ = _aruco.CharucoDetector(board).detectBoard(image)
    else:
        settings = _aruco.DetectorParameters()
        settings.cornerRefinementMethod = _aruco.CORNER_REFINE_SUBPIX
        corners, ids, _ = _aruco.ArucoDetector(dictionary, settings).detectMarkers(image)
    if ids is None or len(ids) == 0:
        return None, None
    points, pixels = board.matchImagePoints(corners, ids)
    return points, pixels


def _find_by_functions(
    image: Image, charuco: bool, board: Any, dictionary: Any
) -> tuple[Any, Any]:
    settings = _aruco.DetectorParameters_create()
    if not charuco:
        settings.cornerRefinementMethod = _aruco.CORNER_REFINE_SUBPIX
    markers, ids, _ = _aruco.detectMarkers(image, dictionary, parameters=settings)
    if ids is None or len(ids) == 0:
        return None, None
    if not charuco:
        points, pixels = _aruco.getBoardObjectAndImagePoints(board, markers, ids)
        return points, pixels
    count, corners, numbers = _aruco.interpolateCornersCharuco(markers, ids, image, board)
    if not count:
        return None, None
    return np.asarray(board.chessboardCorners)[numbers.ravel()], corners
