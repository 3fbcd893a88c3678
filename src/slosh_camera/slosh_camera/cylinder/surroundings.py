"""Whether what is taken for liquid looks like what is beside the container.

A clear liquid shows what is behind it: the table before which its lower half is seen is also seen
to the left and to the right. A line between the two colours may then be an edge of the background,
seen through the liquid, wherever the free surface is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.appearance import Tone, percentile

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]

# Places beside the outermost scan lines, beyond the wall, in widths of the container.
_BESIDE = np.linspace(0.1, 0.25, 12)
# Part of the contrast with the background, in the channel where it is largest, up to which two
# colours are alike. Clear liquids differ from their surroundings by up to 0.09, dark ones before
# a dark table by 0.18 and more.
_ALIKE = 0.13
_LEAST_SEEN = 0.5


def looks_like_surroundings(image: Image, pixels: FloatArray, tone: Tone) -> bool:
    """Whether the liquid has the colour of what is on both sides of the container.

    Args:
        image: (height, width) or (height, width, C).
        pixels: (J, M, 2) places on scan lines that show liquid, from left to right.
        tone: of liquid and background.

    Returns:
        Whether it has; not where too little beside the container is in the image.
    """
    across = (pixels[:, -1] - pixels[:, 0])[:, np.newaxis]
    out = _BESIDE[:, np.newaxis] * across
    sides = pixels[:, :1] - out, pixels[:, -1:] + out
    return all(_is_alike(image, side, tone) for side in sides)


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
