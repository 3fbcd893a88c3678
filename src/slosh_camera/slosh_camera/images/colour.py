"""Converts images between grey levels and colour."""

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
