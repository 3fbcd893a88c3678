"""Pose of an ArUco or ChArUco board in an image, and the container pose that follows from it.

Ubuntu 24.04 has OpenCV 4.6, whose calls differ from those of 4.7 and later. Both draw the same
boards and number their corners in the same frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.calibrate.fit import Hint
from slosh_camera.calibrate.pose import place_of
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.camera import PinholeCamera, Pose
from slosh_camera.optics.cup import Cup
from slosh_camera.optics.lens import EQUIDISTANT

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]


FORMAT = "charuco:COLSxROWS:SQUARE:MARKER[:DICT] or aruco:COLSxROWS:MARKER:GAP[:DICT]"
_DEFAULT_DICTIONARY = "4X4_50"
_MAX_SIDE = 50
_LEAST_CORNERS = 4
# A board and a container that differ by more than this contradict each other [m, rad].
_CONTRADICTION = (0.006, 0.03, 0.03)
_STEP = 1e-6


@dataclass(frozen=True, slots=True)
class Board:
    """A printed board of markers and its dimensions.

    Attributes:
        charuco: a chessboard with markers in its white squares; otherwise a grid of markers.
        columns: squares, or markers, in a row.
        rows: squares, or markers, in a column.
        size: side of a square, or of a marker [m].
        inner: side of a marker in its square, or gap between two markers [m].
        dictionary: name of OpenCV's dictionary, without DICT_.
    """

    charuco: bool
    columns: int
    rows: int
    size: float
    inner: float
    dictionary: str = _DEFAULT_DICTIONARY

    def __post_init__(self) -> None:
        """Raises SloshCameraError for impossible board dimensions."""
        least = 2 if self.charuco else 1
        if not (least <= self.columns <= _MAX_SIDE and least <= self.rows <= _MAX_SIDE):
            raise SloshCameraError(
                f"board: {self.columns} x {self.rows}, both must be {least} to {_MAX_SIDE}"
            )
        if not (np.isfinite(self.size) and self.size > 0.0):
            raise SloshCameraError(f"board: {self.size} m, must be positive")
        if not (np.isfinite(self.inner) and self.inner > 0.0):
            raise SloshCameraError(f"board: {self.inner} m, must be positive")
        if self.charuco and self.inner >= self.size:
            raise SloshCameraError(
                f"board: its markers of {self.inner} m do not fit into squares of {self.size} m"
            )

    def opencv(self) -> tuple[Any, Any]:
        """Returns OpenCV's objects for the board and for its marker dictionary.

        Raises:
            SloshCameraError: there is no such dictionary, or it has too few markers.
        """
        markers = dictionary_of(self.dictionary)
        fields = self.columns * self.rows
        needed, there = fields // 2 if self.charuco else fields, len(markers.bytesList)
        if needed > there:
            raise SloshCameraError(
                f"board: needs {needed} markers, DICT_{self.dictionary} has {there}"
            )
        shape = (self.columns, self.rows)
        return board_of(self.charuco, shape, self.size, self.inner, markers), markers


def parse_board(text: str) -> Board:
    """Parses the description of a board, such as charuco:7x5:0.02:0.015:4X4_50.

    Raises:
        SloshCameraError: the text is none of a board's.
    """
    kind, *parts = text.split(":")
    counts = parts[0].lower().split("x") if parts else []
    if kind not in ("charuco", "aruco") or len(parts) not in (3, 4) or len(counts) != 2:
        raise SloshCameraError(f"board: {text!r} is not {FORMAT}")
    try:
        columns, rows = (int(count) for count in counts)
        size, inner = float(parts[1]), float(parts[2])
    except ValueError:
        raise SloshCameraError(f"board: {text!r} is not {FORMAT}") from None
    dictionary = parts[3] if len(parts) == 4 else _DEFAULT_DICTIONARY
    return Board(kind == "charuco", columns, rows, size, inner, dictionary.removeprefix("DICT_"))


@dataclass(frozen=True, slots=True, eq=False)
class BoardFit:
    """Pose of a board that was detected in an image, with its reprojection residual [px].

    Attributes:
        pose: transform board -> camera. The board's frame is OpenCV's: origin in its top left
            corner as printed, x right, y down the page, z into the page.
        vector: (6,) the same as rotation vector and translation [rad, m].
        covariance: (6, 6) of the vector.
        corners: (N, 2) corners found [px].
        residual: rms distance between corners and pose [px].
    """

    pose: Pose
    vector: FloatArray
    covariance: FloatArray
    corners: FloatArray
    residual: float


def find_board(image: Image, camera: PinholeCamera, board: Board) -> BoardFit:
    """Detects a board in an image and estimates its pose.

    Args:
        image: (height, width) grey or (height, width, 3) blue-green-red.

    Raises:
        SloshCameraError: this OpenCV knows no boards, the board is not seen, or its pose is not
            determined.
    """
    points, corners = find_corners(image, board.charuco, *board.opencv())
    if len(points) < _LEAST_CORNERS:
        raise SloshCameraError(
            f"board: {len(points)} corners of it are seen, {_LEAST_CORNERS} are needed; check its "
            "description and the light"
        )
    points, seen, lens = _for_opencv(camera, points, corners)
    matrix = camera.matrix
    vector, residual = _solved(points, seen, matrix, lens)
    if not residual <= TUNING.board_residual:
        raise SloshCameraError(
            f"board: its corners lie {residual:.2f} px rms from the best pose, more than "
            f"{TUNING.board_residual:g}; check its description and the intrinsic parameters"
        )
    _, change = cv2.projectPoints(points, vector[:3], vector[3:], matrix, lens)
    slope = np.asarray(change, np.float64)[:, :6] / max(residual, TUNING.board_error)
    return BoardFit(
        _pose(vector),
        vector,
        np.asarray(np.linalg.pinv(slope.T @ slope), np.float64),
        corners.reshape(-1, 2),
        residual,
    )


def _for_opencv(
    camera: PinholeCamera, points: FloatArray, corners: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Returns points, corners and distortion in the form that OpenCV's pose solvers need.

    They know no fisheye lens: its corners are moved to where a pinhole sees them.
    """
    if camera.distortion_model != EQUIDISTANT:
        return points, corners, np.array(camera.distortion)
    pinhole = camera.without_distortion()
    straight = pinhole.project(camera.rays(corners.reshape(-1, 2)))
    known = np.all(np.isfinite(straight), axis=1)
    return points[known], straight[known].reshape(-1, 1, 2), np.array(pinhole.distortion)


def _solved(
    points: FloatArray, corners: FloatArray, matrix: FloatArray, lens: FloatArray
) -> tuple[FloatArray, float]:
    """Returns the better of two possible poses of a board, (6,), and its residual [px]."""
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            points, corners, matrix, lens, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error as error:
        raise SloshCameraError("board: its corners seen lie on one line") from error
    found = []
    for pose in zip(turns, shifts, strict=True):
        turn, shift = cv2.solvePnPRefineLM(points, corners, matrix, lens, *pose)
        pixels, _ = cv2.projectPoints(points, turn, shift, matrix, lens)
        rms = float(np.sqrt(np.mean(np.sum((pixels.reshape(-1, 2) - corners) ** 2, axis=1))))
        found.append((np.concatenate((turn.ravel(), shift.ravel()), dtype=np.float64), rms))
    found.sort(key=lambda pair: pair[1])
    if not found or not np.all(np.isfinite(found[0][0])):
        raise SloshCameraError("board: no pose explains its corners")
    if len(found) > 1:
        same = np.allclose(found[0][0], found[1][0], atol=1e-3)
        if not same and found[1][1] < TUNING.rival_residual * max(found[0][1], TUNING.board_error):
            raise SloshCameraError(
                "board: its tilt is ambiguous, two poses fit equally well; it must be larger in "
                "the image"
            )
    return found[0]


def _pose(vector: FloatArray) -> Pose:
    rotation, _ = cv2.Rodrigues(vector[:3])
    return Pose(np.asarray(rotation, np.float64), vector[3:])


def hint_of_flat_board(fit: BoardFit, cup: Cup, base_thickness: float) -> Hint:
    """Returns the camera's height, pitch and roll from a board that lies face up.

    Args:
        base_thickness: of the container's floor [m].

    Returns:
        The camera's height, pitch and roll; where on the plane the container stands is open.

    Raises:
        SloshCameraError: the board does not lie face up.
    """
    raise_by = base_thickness + cup.fill_height

    def numbers(vector: FloatArray) -> FloatArray:
        pose = _pose(vector)
        up = -pose.rotation[:, 2]
        height = -float(up @ pose.translation) - raise_by
        return np.array([height, -np.arcsin(up[2]), np.arctan2(up[0], -up[1])])

    here = numbers(fit.vector)
    if abs(here[2]) > np.deg2rad(60.0):
        raise SloshCameraError(
            "board: does not lie flat and face up; for another pose, give its pose in the "
            "container's frame"
        )
    variance = np.diag(_carried(numbers, fit))
    least = np.array([TUNING.board_level, TUNING.board_flatness, TUNING.board_flatness])
    known, stddev = np.full(5, np.nan), np.ones(5)
    known[[1, 3, 4]] = here
    stddev[[1, 3, 4]] = np.sqrt(variance + least**2)
    return Hint(known, stddev)


def check_hint(hint: Hint, numbers: FloatArray) -> None:
    """Raises SloshCameraError if the pose fitted to the container contradicts the board's pose."""
    shift = np.abs(numbers - hint.numbers)[[1, 3, 4]]
    if np.any(shift > _CONTRADICTION):
        height, pitch, roll = 1e3 * shift[0], *np.rad2deg(shift[1:])
        raise SloshCameraError(
            f"board: contradicts the container's edges, by {height:.1f} mm of height, {pitch:.1f} "
            f"deg of pitch and {roll:.1f} deg of roll; check the board's size and the container's"
        )


def pose_by_board(fit: BoardFit, board_in_container: Pose) -> tuple[Pose, FloatArray]:
    """Computes the container's pose from a board whose pose in the container frame is known.

    Args:
        board_in_container: transform board -> container.

    Returns:
        Transform container -> camera, and the covariance (5, 5) of the camera's place.

    Raises:
        SloshCameraError: the camera is straight above the container.
    """
    rotation, origin = board_in_container.rotation, board_in_container.translation

    def pose(vector: FloatArray) -> Pose:
        board = _pose(vector)
        turn = board.rotation @ rotation.T
        return Pose(turn, board.translation - turn @ origin)

    def numbers(vector: FloatArray) -> FloatArray:
        return place_of(pose(vector))[0].numbers

    return pose(fit.vector), _carried(numbers, fit)


def _carried(function: Callable[[FloatArray], FloatArray], fit: BoardFit) -> FloatArray:
    """Returns the covariance of a function of a board's pose, by linear propagation."""
    here = function(fit.vector)
    columns = []
    for index in range(6):
        moved = fit.vector.copy()
        moved[index] += _STEP
        columns.append((function(moved) - here) / _STEP)
    slope = np.column_stack(columns)
    carried: FloatArray = slope @ fit.covariance @ slope.T
    return carried


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
