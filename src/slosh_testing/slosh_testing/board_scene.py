"""Renders calibration boards before a known camera by ray tracing, without slosh_camera's code."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]
Place = tuple[float, float, float, float, float]


class BoardCamera(NamedTuple):
    """A simulated camera: image size, focal lengths, principal point [px], and lens distortion.

    The lens has k1, k2, p1, p2, k3, a rational one k4, k5, k6 too; a fisheye has four numbers.
    """

    size: tuple[int, int]
    focal: tuple[float, float]
    centre: tuple[float, float]
    lens: tuple[float, ...]

    @property
    def matrix(self) -> FloatArray:
        """Camera matrix K, (3, 3) [px]."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


CAMERA = BoardCamera(
    (640, 480), (620.0, 618.0), (331.0, 236.0), (-0.21, 0.09, 0.001, -0.0008, 0.0)
)
SIZE, MATRIX, LENS = CAMERA.size, CAMERA.matrix, np.array(CAMERA.lens)
# Turn about x and y [deg], centre right and down as parts of the view, distance [m].
POSES: list[Place] = [
    (0, 0, 0.0, 0.0, 0.30), (25, 0, -0.3, -0.3, 0.42), (-25, 5, 0.3, 0.3, 0.42),
    (0, 25, 0.35, -0.3, 0.45), (5, -25, -0.35, 0.3, 0.45), (30, 20, 0.0, 0.25, 0.4),
    (-20, -30, 0.1, -0.3, 0.4), (-35, 10, -0.3, 0.0, 0.42), (15, -35, 0.3, 0.0, 0.42),
    (20, 30, -0.3, 0.3, 0.5), (-15, 20, 0.35, 0.35, 0.5), (10, 10, -0.35, -0.35, 0.5),
]  # fmt: skip
# The centre of each pixel is averaged over so many samples a side.
_FINE = 2


def pose(
    board_size: tuple[float, float],
    about_x: float,
    about_y: float,
    right: float,
    down: float,
    distance: float,
    camera: BoardCamera = CAMERA,
) -> tuple[FloatArray, FloatArray]:
    """Returns rotation and translation, board to camera, of a board placed before the camera."""
    about = (np.deg2rad([about_x, 0.0, 0.0]), np.deg2rad([0.0, about_y, 0.0]))
    turns = [np.asarray(cv2.Rodrigues(turn)[0], np.float64) for turn in about]
    turn = turns[0] @ turns[1]
    half = 0.5 * np.array(camera.size) / camera.focal
    middle = distance * np.array([right * half[0], down * half[1], 1.0])
    return turn, middle - turn @ np.array([0.5 * board_size[0], 0.5 * board_size[1], 0.0])


def rays_of(pixels: FloatArray, camera: BoardCamera = CAMERA) -> FloatArray:
    """Returns the viewing directions (N, 3) of pixels (N, 2), by fixed-point iteration."""
    seen = (pixels - camera.centre) / camera.focal
    if len(camera.lens) == 4:
        return _fisheye_rays(seen, camera.lens)
    k1, k2, p1, p2, k3, k4, k5, k6 = (*camera.lens, 0.0, 0.0, 0.0)[:8]
    ideal = seen.copy()
    for _ in range(20 if len(camera.lens) == 5 else 60):
        x, y = ideal.T
        r2 = x * x + y * y
        tangential = np.column_stack(
            (2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
        )
        radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        ideal = (seen - tangential) / radial[:, None]
    return np.column_stack((ideal, np.ones(len(ideal))))


def _fisheye_rays(seen: FloatArray, lens: tuple[float, ...]) -> FloatArray:
    goal = np.hypot(*seen.T)
    angle = goal.copy()
    for _ in range(60):
        angle = goal / (1.0 + sum(k * angle ** (2 * n + 2) for n, k in enumerate(lens)))
    scale = np.where(goal > 0.0, np.tan(angle) / np.maximum(goal, 1e-300), 1.0)
    return np.column_stack((seen * scale[:, None], np.ones(len(seen))))


@cache
def all_rays(camera: BoardCamera = CAMERA) -> FloatArray:
    """Returns the viewing directions of all sub-pixel samples of the image, row by row."""
    width, height = camera.size
    steps = (np.arange(_FINE * width) + 0.5) / _FINE - 0.5
    u, v = np.meshgrid(steps, steps[: _FINE * height])
    return rays_of(np.column_stack((u.ravel(), v.ravel())), camera)


def render(
    page: Image,
    scale: float,
    rotation: FloatArray,
    translation: FloatArray,
    seed: int = 0,
    camera: BoardCamera = CAMERA,
) -> Image:
    """Renders the camera's image of a flat printed page that lies in the board's plane.

    Args:
        page: (H, W) grey levels of the board alone; its corner is the board's origin.
        scale: of the page [px/m].
        rotation, translation: board -> camera.
        seed: of the noise.
        camera: that takes it.
    """
    wide = cv2.copyMakeBorder(page, 100, 100, 100, 100, cv2.BORDER_CONSTANT, value=255)
    width, height = camera.size
    rays = all_rays(camera)
    depth = rotation[:, 2] @ translation / (rays @ rotation[:, 2])
    places = (rays * depth[:, None] - translation) @ rotation[:, :2]
    spots = (
        (places * scale - 0.5 + 100).astype(np.float32).reshape(_FINE * height, _FINE * width, 2)
    )
    fine = cv2.remap(wide, spots[..., 0], spots[..., 1], cv2.INTER_LINEAR, borderValue=(120,))
    image = cv2.resize(fine, camera.size, interpolation=cv2.INTER_AREA).astype(float)
    image = 20.0 + 0.8 * cv2.GaussianBlur(image, (0, 0), 0.7)
    image += np.random.default_rng(seed).normal(0.0, 2.0, image.shape)
    return np.asarray(np.clip(image, 0, 255), np.uint8)


def chessboard_page(columns: int, rows: int, square: float, scale: float) -> Image:
    """Draws a chessboard page; its first inner corner is one square off the page's corner."""
    side = round(square * scale)
    cells = (np.indices((rows + 1, columns + 1)).sum(axis=0) % 2) * 255
    return np.kron(cells, np.ones((side, side))).astype(np.uint8)


def chessboard_pictures(
    columns: int = 8,
    rows: int = 5,
    square: float = 0.02,
    poses: Sequence[Place] = POSES,
    camera: BoardCamera = CAMERA,
) -> list[Image]:
    """Renders images of a chessboard in many poses."""
    scale = 4000.0
    page = chessboard_page(columns, rows, square, scale)
    size = ((columns + 1) * square, (rows + 1) * square)
    return [
        render(page, scale, *pose(size, *where, camera), k, camera)
        for k, where in enumerate(poses)
    ]
