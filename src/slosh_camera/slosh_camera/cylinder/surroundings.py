"""What is beside the container: it goes on behind it.

A clear liquid shows what is behind it: the table before which its lower half is seen is also seen
to the left and to the right. A line between the two colours may then be an edge of the background,
seen through the liquid, wherever the free surface is.

Through the empty glass above the liquid the same is seen. So what ends above a surface may be as
dark as what is beside the container, and is background all the same.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.appearance import Tone, percentile

Image = NDArray[np.uint8]
Single = NDArray[np.float32]
FloatArray = NDArray[np.float64]

# Places beside the outermost scan lines, beyond the wall, in widths of the container.
_BESIDE = np.linspace(0.1, 0.25, 12)
# Part of the contrast with the background, in the channel where it is largest, up to which two
# colours are alike. Clear liquids differ from their surroundings by up to 0.09, dark ones before
# a dark table by 0.18 and more.
_ALIKE = 0.13
_LEAST_SEEN = 0.5
# Of these places three tell what is behind the container.
_FEW = 5
# Rows by which what is behind the glass may be seen higher or lower than beside it.
_BENT = 4


def looks_like_surroundings(image: Image, pixels: FloatArray, tone: Tone) -> bool:
    """Whether the liquid has the colour of what is on both sides of the container.

    Args:
        image: (height, width) or (height, width, C).
        pixels: (J, M, 2) places on scan lines that show liquid, from left to right.
        tone: of liquid and background.

    Returns:
        Whether it has; not where too little beside the container is in the image.
    """
    return all(_is_alike(image, side, tone) for side in _sides(pixels))


class Backdrop:
    """What should be seen above the liquid, by what is on both sides of the container."""

    def __init__(self, pixels: FloatArray, size: tuple[int, int]) -> None:
        """Keep the places that are looked at.

        Args:
            pixels: (J, M, 2) places on the scan lines, from left to right.
            size: width and height of the images.
        """
        places = np.rint(np.stack(_sides(pixels), axis=1)[:, :, ::_FEW]).astype(np.int64)
        self._columns, self._rows = places[..., 0], places[..., 1]
        inside = (self._columns >= 0) & (self._columns < size[0])
        inside &= (self._rows >= 0) & (self._rows < size[1])
        self._seen = np.mean(inside, axis=2) >= _LEAST_SEEN
        np.clip(self._columns, 0, size[0] - 1, out=self._columns)
        np.clip(self._rows, 0, size[1] - 1, out=self._rows)
        self._across = np.linspace(0.0, 1.0, pixels.shape[1], dtype=np.float32)

    def reduced(self, image: Image, tone: Tone) -> Single:
        """(J, M) on the axis from liquid to background: at most 1, and 1 where it is not known."""
        seen = image[self._rows, self._columns].reshape(*self._rows.shape, -1)
        # The middle one of three.
        level = np.sort(seen @ tone.axis, axis=2)[:, :, 1] - tone.axis @ tone.liquid
        level = np.where(self._seen, np.minimum(level, 1.0), 1.0).astype(np.float32)
        lowest = cv2.erode(level, np.ones((2 * _BENT + 1, 1), np.uint8))
        left, right = lowest[:, :1], lowest[:, 1:]
        return np.asarray(left + (right - left) * self._across, dtype=np.float32)


def _sides(pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places (J, N, 2) to the left and to the right of the outermost scan lines."""
    across = (pixels[:, -1] - pixels[:, 0])[:, np.newaxis]
    out = _BESIDE[:, np.newaxis] * across
    return pixels[:, :1] - out, pixels[:, -1:] + out


def _is_alike(image: Image, places: FloatArray, tone: Tone) -> bool:
    """Whether most of an image at places (J, N, 2) has the liquid's colour."""
    columns, rows = np.rint(places[..., 0]).astype(int), np.rint(places[..., 1]).astype(int)
    height, width = image.shape[:2]
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    if np.mean(inside) < _LEAST_SEEN:
        return False
    seen = image[rows[inside], columns[inside]]
    colour = percentile(seen.reshape(len(seen), -1), 50.0)
    return float(np.max(np.abs(colour - tone.liquid))) < _ALIKE * tone.contrast
