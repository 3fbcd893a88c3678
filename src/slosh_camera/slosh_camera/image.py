"""Images as messages carry them, turned into 8-bit grey arrays."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.errors import SloshCameraError

GrayImage = NDArray[np.uint8]

_CHANNELS = {"mono8": 1, "bgr8": 3, "rgb8": 3}
_TO_GRAY = {"bgr8": cv2.COLOR_BGR2GRAY, "rgb8": cv2.COLOR_RGB2GRAY}
_COMPRESSED = ("jpeg", "jpg", "png")


def to_gray(encoding: str, height: int, width: int, step: int, data: Any) -> GrayImage:
    """Grey image from the fields of a sensor_msgs/Image.

    Args:
        encoding: mono8, bgr8 or rgb8.
        height: number of rows.
        width: number of columns.
        step: length of a row [bytes], padding included.
        data: the rows, any buffer of bytes.

    Returns:
        (height, width); for mono8 a read-only view of `data`, which is not copied.

    Raises:
        SloshCameraError: another encoding, an empty image, or sizes that do not fit together.
    """
    channels = _CHANNELS.get(encoding)
    if channels is None:
        known = ", ".join(_CHANNELS)
        raise SloshCameraError(f"image: encoding {encoding!r} is not supported, use {known}")
    if height < 1 or width < 1:
        raise SloshCameraError(f"image: is empty, {width} x {height} pixels")
    if step < width * channels:
        raise SloshCameraError(
            f"image: step {step} is shorter than a row of {width} pixels in {encoding}"
        )
    array = _bytes(data)
    if array.size != height * step:
        raise SloshCameraError(
            f"image: {array.size} bytes do not match {height} rows of step {step}"
        )
    rows = array.reshape(height, step)[:, : width * channels]
    if channels == 1:
        gray = rows.view()
        gray.setflags(write=False)
        return gray
    colour = rows.reshape(height, width, channels)
    return np.asarray(cv2.cvtColor(colour, _TO_GRAY[encoding]), dtype=np.uint8)


def decode_compressed(image_format: str, data: Any) -> GrayImage:
    """Grey image from the fields of a sensor_msgs/CompressedImage.

    Args:
        image_format: format as image_transport writes it, such as "jpeg" or
            "bgr8; jpeg compressed bgr8".
        data: the file's bytes, any buffer.

    Returns:
        (height, width).

    Raises:
        SloshCameraError: neither JPEG nor PNG, no data, or data that are cut or damaged.
    """
    words = image_format.lower().replace(";", " ").split()
    if not any(word in _COMPRESSED for word in words):
        raise SloshCameraError(f"image: format {image_format!r} is not supported, use jpeg or png")
    array = _bytes(data)
    if array.size == 0:
        raise SloshCameraError("image: is empty, 0 bytes")
    if not _is_complete(array):
        raise SloshCameraError(f"image: {array.size} bytes are not a complete JPEG or PNG file")
    try:
        gray = cv2.imdecode(array, cv2.IMREAD_GRAYSCALE)
    except cv2.error:
        gray = None
    if gray is None:
        raise SloshCameraError(f"image: {array.size} bytes could not be decoded as {image_format}")
    return np.asarray(gray, dtype=np.uint8)


def _bytes(data: Any) -> GrayImage:
    try:
        return np.frombuffer(data, dtype=np.uint8)
    except (TypeError, ValueError, BufferError) as error:
        raise SloshCameraError("image: data is not a contiguous buffer of bytes") from error


def _is_complete(array: GrayImage) -> bool:
    """Whether the file has its beginning and its end.

    OpenCV decodes a JPEG that is cut and fills the rest with grey, which is not an image.
    """
    head, tail = array[:8].tobytes(), array[-64:].tobytes()
    if head.startswith(b"\xff\xd8"):
        return b"\xff\xd9" in tail
    if head.startswith(b"\x89PNG"):
        return b"IEND" in tail
    return False
