"""Uses the container's surroundings as the expected background behind clear liquid.

A clear liquid shows what is behind it: the table before which its lower half is seen is also seen
to the left and to the right. A line between the two colours may then be an edge of the background,
seen through the liquid, wherever the free surface is.

Through the empty glass above the liquid the same is seen. So what ends above a surface may be as
dark as what is beside the container, and is background all the same.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba.types import boolean, float32, float64, int64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import GIVEN_3, entry_point, given
from slosh_camera.cylinder.appearance import Tone, percentile
from slosh_camera.cylinder.tuning import TUNING

Image = NDArray[np.uint8]
Single = NDArray[np.float32]
FloatArray = NDArray[np.float64]

# Places beside the outermost scan lines, beyond the wall, in widths of the container.
_BESIDE = np.linspace(0.1, 0.25, 12)
# Of these places three tell what is behind the container.
_FEW = 5


def looks_like_surroundings(image: Image, pixels: FloatArray, tone: Tone) -> bool:
    """Whether the liquid has the colour of the surroundings on both sides of the container.

    Args:
        image: (height, width) or (height, width, C).
        pixels: (J, M, 2) places on scan lines that show liquid, from left to right.
        tone: of liquid and background.

    Returns:
        Whether it has; not where too little beside the container is in the image.
    """
    return all(_is_alike(image, side, tone) for side in _sides(pixels))


class Backdrop:
    """Expected background above the liquid, interpolated from both sides of the container."""

    def __init__(self, pixels: FloatArray, size: tuple[int, int]) -> None:
        """Stores the image positions to the left and right of the container.

        What is far behind goes on straight across the container, in pixels; a row of the scan
        lines, which is a height on the front wall, does not.

        Args:
            pixels: (J, M, 2) places on the scan lines, from left to right.
            size: width and height of the images.
        """
        across = np.mean(pixels[:, -1] - pixels[:, 0], axis=0)
        width = float(np.hypot(*across))
        along = across / width
        down = np.array([-along[1], along[0]])
        depth, place = pixels @ down, pixels @ along
        first = int(np.floor(np.min(depth)))
        levels = np.arange(first, int(np.ceil(np.max(depth))) + 1)
        ends = [_place_at(levels, depth[:, line], place[:, line]) for line in (0, -1)]
        out = width * _BESIDE[::_FEW]
        beside = np.stack((ends[0][:, None] - out, ends[1][:, None] + out), axis=1)
        places = np.rint(beside[..., None] * along + levels[:, None, None, None] * down)
        self._columns, self._rows = np.moveaxis(places.astype(np.int64), -1, 0)
        inside = (self._columns >= 0) & (self._columns < size[0])
        inside &= (self._rows >= 0) & (self._rows < size[1])
        self._seen = np.mean(inside, axis=2) >= TUNING.least_beside
        np.clip(self._columns, 0, size[0] - 1, out=self._columns)
        np.clip(self._rows, 0, size[1] - 1, out=self._rows)
        self._level = np.rint(depth).astype(np.int64) - first
        left, right = (end[self._level] for end in ends)
        share = (place - left) / np.maximum(right - left, 1.0)
        self._share = np.clip(share, 0.0, 1.0).astype(np.float32)

    def reduced(self, image: Image, tone: Tone) -> Single:
        """Returns the expected background of the wall on the colour axis; 1 where unknown."""
        seen = image[self._rows, self._columns].reshape(*self._rows.shape, -1)
        level = _middle(seen @ tone.axis, float(tone.axis @ tone.liquid), self._seen)
        level = cv2.erode(level, np.ones((2 * TUNING.bent_rows + 1, 1), np.uint8))
        return np.asarray(_across(level, self._level, self._share))


@entry_point(float32[:, ::1](GIVEN_3, float64, given(boolean, 2)))
def _middle(seen, liquid, known):  # type: ignore[no-untyped-def]
    """Returns the median background levels beside the container, left and right, at most 1.

    1 where nothing is known.
    """
    level = np.ones(known.shape, np.float32)
    for j in range(known.shape[0]):
        for side in range(known.shape[1]):
            a, b, c = seen[j, side, 0], seen[j, side, 1], seen[j, side, 2]
            if known[j, side]:
                level[j, side] = min(max(min(a, b), min(max(a, b), c)) - liquid, 1.0)
    return level


@entry_point(float32[:, ::1](given(float32, 2), given(int64, 2), given(float32, 2)))
def _across(ends, level, share):  # type: ignore[no-untyped-def]
    """Interpolates image values of the unrolled wall between left and right surroundings."""
    rows, lines = level.shape
    values = np.empty((rows, lines), np.float32)
    for j in range(rows):
        for i in range(lines):
            left, right = ends[level[j, i], 0], ends[level[j, i], 1]
            values[j, i] = left + (right - left) * share[j, i]
    return values


def _place_at(levels: NDArray[np.int64], depth: FloatArray, place: FloatArray) -> FloatArray:
    """Interpolates image positions over depth, constant beyond the ends of the table."""
    order = np.argsort(depth)
    return np.interp(levels, depth[order], place[order])


def _sides(pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns image positions to the left and right of the outermost scan lines."""
    across = (pixels[:, -1] - pixels[:, 0])[:, np.newaxis]
    out = _BESIDE[:, np.newaxis] * across
    return pixels[:, :1] - out, pixels[:, -1:] + out


def _is_alike(image: Image, places: FloatArray, tone: Tone) -> bool:
    """Whether most of the image at the given positions has the liquid's colour."""
    columns, rows = np.rint(places[..., 0]).astype(int), np.rint(places[..., 1]).astype(int)
    height, width = image.shape[:2]
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    if np.mean(inside) < TUNING.least_beside:
        return False
    seen = image[rows[inside], columns[inside]]
    colour = percentile(seen.reshape(len(seen), -1), 50.0)
    return float(np.max(np.abs(colour - tone.liquid))) < TUNING.colours_alike * tone.contrast
