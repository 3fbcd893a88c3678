"""Images as grey levels and as colours; text on dark plates in them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""(height, width) grey or (height, width, 3) blue, green, red."""
GrayImage = NDArray[np.uint8]
"""(height, width)."""


def to_gray(image: Image) -> GrayImage:
    """Converts an image to grey levels; returns a grey image unchanged.

    Args:
        image: (height, width) or (height, width, 3) blue, green, red.

    Returns:
        (height, width).
    """
    if image.ndim == 2:
        return image
    if image.strides[2] < 0:
        # OpenCV would copy a reversed view before it converts it.
        return np.asarray(cv2.cvtColor(image[..., ::-1], cv2.COLOR_RGB2GRAY), dtype=np.uint8)
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def to_colour(image: Image) -> Image:
    """Converts an image to colour; returns a colour image unchanged.

    Args:
        image: (height, width) or (height, width, 3) blue, green, red.

    Returns:
        (height, width, 3) blue, green, red.
    """
    if image.ndim == 3:
        return image
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


# Colours are blue, green, red.
WHITE = (255, 255, 255)
_PLATE = (40, 40, 40)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
# Size of the letters in a picture of 480 rows; larger pictures get larger ones.
_FONT_SCALE = 0.5
_ROWS = 480


def letter_size(picture: Image) -> float:
    """Returns the scale of letters for an image; 1 for an image of 480 rows."""
    return max(float(picture.shape[0]) / _ROWS, 0.75)


def text_width(words: str, size: float = 1.0) -> int:
    """Returns the width of a text in the image [px]."""
    return int(cv2.getTextSize(words, _FONT, _FONT_SCALE * size, max(round(size), 1))[0][0])


def put_text(
    picture: Image,
    words: str,
    place: tuple[int, int],
    size: float = 1.0,
    colour: tuple[int, int, int] = WHITE,
) -> None:
    """Writes text on a dark plate; `place` is its lower left corner [px]."""
    scale, thickness = _FONT_SCALE * size, max(round(size), 1)
    (width, height), below = cv2.getTextSize(words, _FONT, scale, thickness)
    x, y = place
    rim = max(round(2 * size), 1)
    corner, other = (x - rim, y - height - rim), (x + width + rim, y + below)
    cv2.rectangle(picture, corner, other, _PLATE, -1)
    cv2.putText(picture, words, place, _FONT, scale, colour, thickness, cv2.LINE_AA)
