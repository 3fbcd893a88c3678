"""Draws a camera's reprojection errors, and lists missing poses of the calibration board."""

from __future__ import annotations

import cv2
import numpy as np

from slosh_camera.images.colour import Image
from slosh_camera.images.lettering import letter_size, put_text
from slosh_camera.intrinsics.solve import IntrinsicFit
from slosh_camera.intrinsics.tuning import TUNING

# Blue, green, red.
_PAPER, _UNSEEN, _CORNER, _ARROW = (255, 255, 255), (205, 205, 255), (170, 110, 30), (40, 40, 220)
ENLARGED = 50.0
_SHIFT = 4

GRID = 3
_ROWS, _COLUMNS = ("top", "middle", "bottom"), ("left", "middle", "right")


def draw_reprojection(fit: IntrinsicFit) -> Image:
    """Draws the detected corners of all images, with magnified reprojection errors.

    Blue dots are the corners as seen; a red line leads from each to where the camera puts it, 50
    times as far. Short lines in all directions are noise; lines that agree with their neighbours
    are a lens that is not explained, or a board that is not flat. Ninths of the image in which no
    corner was seen are pink: there the distortion is guessed.

    Returns:
        (height, width, 3) blue-green-red of the camera's size.
    """
    width, height = fit.camera.size
    picture = np.full((height, width, 3), _PAPER, np.uint8)
    seen = seen_cells(fit)
    for row in range(GRID):
        for column in range(GRID):
            if (row, column) not in seen:
                corner = (column * width // GRID, row * height // GRID)
                end = ((column + 1) * width // GRID - 1, (row + 1) * height // GRID - 1)
                cv2.rectangle(picture, corner, end, _UNSEEN, -1)
    letters = letter_size(picture)
    for view in fit.views:
        for pixel, projected in zip(view.view.pixels, view.projected, strict=True):
            end_point = pixel + ENLARGED * (projected - pixel)
            ends = np.clip([pixel, end_point], -1e4, 1e4)
            fixed = np.round(ends * (1 << _SHIFT)).astype(np.int32)
            start, stop = ((int(x), int(y)) for x, y in fixed)
            thickness = max(round(letters), 1)
            cv2.line(picture, start, stop, _ARROW, thickness, cv2.LINE_AA, _SHIFT)
            radius = round(1.5 * letters * (1 << _SHIFT))
            cv2.circle(picture, start, radius, _CORNER, -1, cv2.LINE_AA, _SHIFT)
    words = f"{len(fit.views)} pictures, {fit.rms:.2f} px rms, errors x {ENLARGED:.0f}"
    put_text(picture, words, (round(8 * letters), height - round(12 * letters)), letters)
    return picture


def seen_cells(fit: IntrinsicFit) -> frozenset[tuple[int, int]]:
    """Returns row and column of those ninths of the image that contain detected corners."""
    width, height = fit.camera.size
    pixels = np.concatenate([view.view.pixels for view in fit.views])
    cells = np.floor((pixels + 0.5) / (width, height) * GRID).astype(int).clip(0, GRID - 1)
    return frozenset((int(row), int(column)) for column, row in cells)


def missing_poses(fit: IntrinsicFit) -> list[str]:
    """Describes which further images of the calibration board are needed; empty if none are."""
    seen = seen_cells(fit)
    unseen = [
        f"{row} {column}" if row != column else "middle"
        for i, row in enumerate(_ROWS)
        for k, column in enumerate(_COLUMNS)
        if (i, k) not in seen
    ]
    missing = [f"the board in the image's {', '.join(unseen)}"] if unseen else []
    missing += [
        f"the board tilted, its {edge} edge nearer by {TUNING.least_tilt:.0f} deg or more"
        for edge, tilt in _tilts(fit).items()
        if tilt < TUNING.least_tilt
    ]
    if _largest(fit) < TUNING.near:
        missing.append(
            f"the board from near, over more than {TUNING.near:.0%} of the image's width"
        )
    if len(fit.views) < TUNING.enough:
        missing.append(f"more pictures: {len(fit.views)} are used, {TUNING.enough} are enough")
    return missing


def _tilts(fit: IntrinsicFit) -> dict[str, float]:
    """Returns the calibration board's largest tilt towards each edge of the image [deg]."""
    normals = np.array([view.rotation[:, 2] for view in fit.views])
    normals *= np.where(normals[:, 2:] < 0.0, -1.0, 1.0)
    turn, lean = np.rad2deg(np.arctan2(normals[:, :2], normals[:, 2:])).T
    return {"left": -turn.min(), "right": turn.max(), "top": -lean.min(), "bottom": lean.max()}


def _largest(fit: IntrinsicFit) -> float:
    """Returns the largest fraction of image width or height that the board covers."""
    return max(
        float(np.max(np.ptp(view.view.pixels, axis=0) / fit.camera.size)) for view in fit.views
    )
