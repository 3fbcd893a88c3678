"""Images as messages and files carry them, as arrays of 8-bit grey levels or colours.

An image is (height, width) grey or (height, width, 3) blue, green, red. Where the pixels of a
message are stored that way, or with other gaps or another order between them, the array is a
read-only view of the message's own memory: nothing is copied.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import GrayImage, Image
from slosh_camera.images.image_size import JPEG, PNG, check_size
from slosh_camera.images.jpeg_file import jpeg_damage
from slosh_camera.images.png_file import png_damage


class _Layout(NamedTuple):
    """How an encoding stores a pixel: its bytes, and where blue, green, red or grey lie."""

    pixel_bytes: int
    places: slice | int


_GRAY = _Layout(1, 0)
_LAYOUTS = {
    "mono8": _GRAY,
    "8UC1": _GRAY,
    "bgr8": _Layout(3, slice(0, 3)),
    "8UC3": _Layout(3, slice(0, 3)),
    "rgb8": _Layout(3, slice(None, None, -1)),
    "bgra8": _Layout(4, slice(0, 3)),
    "rgba8": _Layout(4, slice(2, None, -1)),
    "mono16": _Layout(2, 1),
}
# ROS names the pattern by its first two rows, OpenCV by what begins at the second row and column.
_BAYER = {
    "bayer_rggb8": cv2.COLOR_BayerBG2BGR,
    "bayer_bggr8": cv2.COLOR_BayerRG2BGR,
    "bayer_gbrg8": cv2.COLOR_BayerGR2BGR,
    "bayer_grbg8": cv2.COLOR_BayerGB2BGR,
}
# OpenCV gives black for less than a pixel with all its neighbours.
_LEAST_BAYER = 3
ENCODINGS = (*_LAYOUTS, *_BAYER)
"""Encodings of sensor_msgs/Image that can be read."""
_COMPRESSED = ("jpeg", "jpg", "png")


def to_image(
    encoding: str, height: int, width: int, step: int, data: Any, *, big_endian: bool = False
) -> Image:
    """Image from the fields of a sensor_msgs/Image.

    Args:
        encoding: one of ENCODINGS.
        height: number of rows.
        width: number of columns.
        step: length of a row [bytes], padding included.
        data: the rows, any buffer of bytes.
        big_endian: byte order of mono16, of which the upper byte is taken.

    Returns:
        (height, width) for mono and (height, width, 3) for colour encodings: a read-only view of
        `data`, with strides as the encoding needs them. Only Bayer patterns are converted.

    Raises:
        SloshCameraError: another encoding, an empty image, or sizes that do not fit together.
    """
    layout = _GRAY if encoding in _BAYER else _LAYOUTS.get(encoding)
    if layout is None:
        known = ", ".join(ENCODINGS)
        raise SloshCameraError(f"image: encoding {encoding!r} is not supported, use {known}")
    if height < 1 or width < 1:
        raise SloshCameraError(f"image: is empty, {width} x {height} pixels")
    if step < width * layout.pixel_bytes:
        raise SloshCameraError(
            f"image: step {step} is shorter than a row of {width} pixels in {encoding}"
        )
    array = _bytes(data)
    if array.size != height * step:
        raise SloshCameraError(
            f"image: {array.size} bytes do not match {height} rows of step {step}"
        )
    places = 0 if encoding == "mono16" and big_endian else layout.places
    pixels = np.ndarray(
        (height, width, layout.pixel_bytes), np.uint8, array, strides=(step, layout.pixel_bytes, 1)
    )[..., places]
    if encoding in _BAYER:
        return _without_pattern(pixels, encoding)
    pixels.setflags(write=False)
    return pixels


def decode_compressed(image_format: str, data: Any) -> Image:
    """Image from the fields of a sensor_msgs/CompressedImage.

    Args:
        image_format: format as image_transport writes it, such as "jpeg" or
            "bgr8; jpeg compressed bgr8".
        data: the file's bytes, any buffer.

    Returns:
        (height, width) of a grey file, (height, width, 3) of one in colour; of 16 bits the upper
        8, transparency is left out.

    Raises:
        SloshCameraError: neither JPEG nor PNG, no data, data that are cut or damaged, or that
            claim too many pixels.
    """
    words = image_format.lower().replace(";", " ").split()
    if not any(word in _COMPRESSED for word in words):
        raise SloshCameraError(f"image: format {image_format!r} is not supported, use jpeg or png")
    array = _bytes(data)
    if array.size and not array[:4].tobytes().startswith((JPEG, PNG)):
        raise SloshCameraError(f"image: {array.size} bytes are not a complete JPEG or PNG file")
    return _decode(array, image_format)


def read_image(path: str | Path) -> Image:
    """Image from a PNG, JPEG, BMP or TIFF file; as decode_compressed.

    Raises:
        SloshCameraError: the file cannot be read, or is no whole image; the text names it.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise SloshCameraError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        return _decode(np.frombuffer(data, np.uint8), Path(path).suffix[1:] or "an image")
    except SloshCameraError as error:
        raise SloshCameraError(f"{path}: {error}") from None


def _without_pattern(pixels: GrayImage, encoding: str) -> Image:
    height, width = pixels.shape
    if min(height, width) < _LEAST_BAYER:
        raise SloshCameraError(f"image: {width} x {height} pixels are too few for {encoding}")
    return np.asarray(cv2.cvtColor(pixels, _BAYER[encoding]), dtype=np.uint8)


def _decode(array: Image, kind: str) -> Image:
    if array.size == 0:
        raise SloshCameraError("image: is empty, 0 bytes")
    check_size(array.tobytes())
    damage = _damage(array)
    if damage:
        raise SloshCameraError(
            f"image: {array.size} bytes are not a complete image file: {damage}"
        )
    try:
        # Grey stays grey, colour stays colour, both of 8 bits, turned as the file says.
        image = cv2.imdecode(array, cv2.IMREAD_ANYCOLOR)
    except cv2.error:
        image = None
    if image is None:
        raise SloshCameraError(f"image: {array.size} bytes could not be decoded as {kind}")
    return np.asarray(image, dtype=np.uint8)


def _bytes(data: Any) -> Image:
    try:
        return np.frombuffer(data, dtype=np.uint8)
    except (TypeError, ValueError, BufferError) as error:
        raise SloshCameraError("image: data is not a contiguous buffer of bytes") from error


def _damage(array: Image) -> str:
    """Why a JPEG or PNG file is not whole; of other formats the decoder must know."""
    signature = array[: len(PNG)].tobytes()
    if signature.startswith(JPEG):
        return jpeg_damage(array)
    return png_damage(array) if signature.startswith(PNG) else ""
