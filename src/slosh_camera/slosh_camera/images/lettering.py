"""Writes text on dark plates in images, readable on any background."""

from __future__ import annotations

import cv2

from slosh_camera.images.colour import Image

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
