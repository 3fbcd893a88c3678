"""A picture to judge intrinsic parameters by: every corner, and where the camera puts it."""

from __future__ import annotations

import cv2
import numpy as np

from slosh_camera.images.colour import Image
from slosh_camera.images.lettering import letter_size, put_text
from slosh_camera.intrinsics.coverage import GRID, seen_cells
from slosh_camera.intrinsics.solve import IntrinsicFit

# Blue, green, red.
_PAPER, _UNSEEN, _CORNER, _ARROW = (255, 255, 255), (205, 205, 255), (170, 110, 30), (40, 40, 220)
ENLARGED = 50.0
_SHIFT = 4


def draw_reprojection(fit: IntrinsicFit) -> Image:
    """Corners of all views over an empty image, each with its error enlarged.

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
