"""Decodes images in messages and files to arrays of 8-bit grey levels or colours.

An image is (height, width) grey or (height, width, 3) blue, green, red. Where the pixels of a
message are stored that way with 8 bits, or with other gaps or another order between them, the
array is a read-only view of the message's own memory: nothing is copied.
"""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image
from slosh_camera.images.headers import JPEG, PNG, WEBP, check_size, tiff_pages, webp_damage
from slosh_camera.images.jpeg_file import jpeg_damage

Bytes = NDArray[np.uint8]

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
# Length and kind before what a chunk holds, the sum behind it.
_BEFORE, _BEHIND = 8, 4


class _Layout(NamedTuple):
    """Memory layout of a pixel encoding: bytes per pixel and order of the channels."""

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
    "8UC4": _Layout(4, slice(0, 3)),
    "rgba8": _Layout(4, slice(2, None, -1)),
}
# Of 16 bits; the name without them tells the order of the colours.
_DEEP = {
    "mono16": "mono8", "16UC1": "mono8", "bgr16": "bgr8", "16UC3": "bgr8", "rgb16": "rgb8",
    "bgra16": "bgra8", "16UC4": "bgra8", "rgba16": "rgba8",
}  # fmt: skip
# ROS names the pattern by its first two rows, OpenCV by what begins at the second row and column.
_BAYER = {
    "bayer_rggb": cv2.COLOR_BayerBG2BGR,
    "bayer_bggr": cv2.COLOR_BayerRG2BGR,
    "bayer_gbrg": cv2.COLOR_BayerGR2BGR,
    "bayer_grbg": cv2.COLOR_BayerGB2BGR,
}
_BAYER_NAMES = tuple(f"{pattern}{bits}" for bits in (8, 16) for pattern in _BAYER)
# Two bytes a pixel: brightness and, by turns, one of two colour differences.
_YUV_PACKED = {
    "yuv422": cv2.COLOR_YUV2BGR_UYVY,
    "uyvy": cv2.COLOR_YUV2BGR_UYVY,
    "yuv422_yuy2": cv2.COLOR_YUV2BGR_YUY2,
    "yuyv": cv2.COLOR_YUV2BGR_YUY2,
}
# A plane of brightness, and one of half its height with both colour differences, or two of a
# quarter of its size.
_YUV_PLANES = {
    "nv12": cv2.COLOR_YUV2BGR_NV12,
    "nv21": cv2.COLOR_YUV2BGR_NV21,
    "i420": cv2.COLOR_YUV2BGR_I420,
    "yuv420": cv2.COLOR_YUV2BGR_I420,
    "yv12": cv2.COLOR_YUV2BGR_YV12,
}
_THREE_PLANES = ("i420", "yuv420", "yv12")
# OpenCV gives black for less than a pixel with all its neighbours.
_LEAST_BAYER = 3
_DEPTHS = (8, 10, 12, 14, 16)
"""Bits of a camera's converter."""
ENCODINGS = (*_LAYOUTS, *_DEEP, *_BAYER_NAMES, *_YUV_PACKED, *_YUV_PLANES)
"""Encodings of sensor_msgs/Image that can be read."""
_NAMES = {
    **{name.lower(): name for name in ENCODINGS},
    # Of GenICam, whose names begin with the first row of the pattern.
    **{f"mono{bits}": "mono16" for bits in (10, 12, 14)},
    **{
        f"bayer{start}{bits}": f"bayer_{pattern}{8 if bits == 8 else 16}"
        for start, pattern in (("rg", "rggb"), ("bg", "bggr"), ("gb", "gbrg"), ("gr", "grbg"))
        for bits in _DEPTHS
    },
}
"""Encodings by their names in small letters."""
_COMPRESSED = ("jpeg", "jpg", "png", "webp")


def to_image(
    encoding: str, height: int, width: int, step: int, data: Any, *, big_endian: bool = False
) -> Image:
    """Decodes the fields of a sensor_msgs/Image.

    Of 16 bits those 8 count that the camera's converter fills: cameras with 10, 12 or 14 bits
    leave the upper ones empty, and no field of the message says so. The converter is the smallest
    one that holds the image's largest value.

    Args:
        encoding: one of ENCODINGS, in letters of any size, or GenICam's name of it.
        step: length of a row [bytes], padding included.
        data: the rows, any buffer of bytes.
        big_endian: byte order of 16-bit encodings.

    Returns:
        (height, width) for mono and (height, width, 3) for colour encodings. Of 8-bit mono and
        colour a read-only view of `data`, with strides as the encoding needs them.

    Raises:
        SloshCameraError: another encoding, an empty image, or sizes that do not fit together.
    """
    name = _NAMES.get(encoding.lower())
    if name is None:
        raise SloshCameraError(_not_supported(encoding))
    encoding = name
    if height < 1 or width < 1:
        raise SloshCameraError(f"image: is empty, {width} x {height} pixels")
    if encoding in _LAYOUTS:
        layout = _LAYOUTS[encoding]
        pixels = _rows(encoding, height, width, step, data, layout.pixel_bytes)[..., layout.places]
        pixels.setflags(write=False)
        return pixels
    if encoding in _YUV_PACKED:
        pairs = _rows(encoding, height, width, step, data, 2)
        return _converted(pairs, _YUV_PACKED[encoding], encoding, width % 2)
    if encoding in _YUV_PLANES:
        if encoding in _THREE_PLANES and step != width:
            raise SloshCameraError(
                f"image: step {step} is not the width {width}: padded planes of {encoding} cannot "
                "be told apart; publish rows without padding, or nv12"
            )
        rows = _rows(encoding, height + height // 2, width, step, data, 1)
        return _converted(rows[..., 0], _YUV_PLANES[encoding], encoding, (width | height) % 2)
    if encoding in _DEEP:
        layout = _LAYOUTS[_DEEP[encoding]]
        stored = _rows(encoding, height, width, step, data, 2 * layout.pixel_bytes)
        return to_8_bits(_words(stored, big_endian))[..., layout.places]
    return _without_pattern(encoding, height, width, step, data, big_endian)


def _not_supported(encoding: str) -> str:
    if not encoding:
        return (
            "image: the encoding is empty: the camera's driver must fill it, e.g. with mono8, "
            "bgr8 or bayer_rggb8"
        )
    if encoding.lower() in ("32fc1", "64fc1"):
        return f"image: encoding {encoding!r} holds distances, not a picture: choose another topic"
    if encoding.lower().startswith(("32fc", "64fc")):
        return (
            f"image: encoding {encoding!r} does not say which value is white: publish mono8 or "
            "bgr8, or choose another topic"
        )
    return f"image: encoding {encoding!r} is not supported, use {', '.join(ENCODINGS)}"


def _rows(encoding: str, rows: int, width: int, step: int, data: Any, pixel_bytes: int) -> Image:
    """Returns the message's pixel bytes as (rows, width, pixel_bytes), without padding."""
    if step < width * pixel_bytes:
        raise SloshCameraError(
            f"image: step {step} is shorter than a row of {width} pixels in {encoding}"
        )
    array = _bytes(data)
    if array.size != rows * step:
        raise SloshCameraError(
            f"image: {array.size} bytes do not match {rows} rows of step {step}"
        )
    return np.ndarray((rows, width, pixel_bytes), np.uint8, array, strides=(step, pixel_bytes, 1))


def _words(stored: Image, big_endian: bool) -> NDArray[np.uint16]:
    """Combines pairs of bytes to 16-bit pixel values, which halves the last axis."""
    return np.ascontiguousarray(stored).view(">u2" if big_endian else "<u2").astype(np.uint16)


def to_8_bits(pixels: NDArray[np.uint16]) -> Image:
    """Converts 16-bit pixels to 8 bits, keeping the upper bits of the depth in use (8 to 16)."""
    needed = int(pixels.max(initial=0)).bit_length()
    bits = next(depth for depth in _DEPTHS if depth >= needed)
    return np.asarray(pixels >> (bits - 8), dtype=np.uint8)


def _converted(pixels: Image, code: int, encoding: str, odd: int) -> Image:
    if odd:
        raise SloshCameraError(f"image: {encoding} needs an even number of pixels in each row")
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(pixels), code), dtype=np.uint8)


def decode_compressed(image_format: str, data: Any) -> Image:
    """Decodes the fields of a sensor_msgs/CompressedImage.

    Args:
        image_format: format as a driver writes it, such as "jpeg", "image/jpeg" or
            "bgr8; jpeg compressed bgr8"; what counts is the data.
        data: the file's bytes, any buffer.

    Returns:
        (height, width) of a grey file, (height, width, 3) of one in colour; of 16 bits those 8
        that count in `to_image`, transparency is left out.

    Raises:
        SloshCameraError: neither JPEG, PNG nor WebP, no data, data that are cut or damaged, or
            that claim too many pixels.
    """
    array = _bytes(data)
    # The data say what they are: drivers write image/jpeg, an encoding's name or nothing at all.
    if not array[:4].tobytes().startswith((JPEG, PNG, WEBP)) and array.size:
        words = image_format.lower().replace(";", " ").replace("/", " ").split()
        if "compresseddepth" in words:
            raise SloshCameraError(
                f"image: format {image_format!r} holds distances, not a picture: choose another "
                "topic"
            )
        if image_format and not any(word in _COMPRESSED for word in words):
            raise SloshCameraError(
                f"image: format {image_format!r} is not supported, use jpeg, png or webp"
            )
        raise SloshCameraError(
            f"image: {array.size} bytes are not a complete JPEG, PNG or WebP file"
        )
    return _decode(array, image_format)


def read_image(path: str | Path) -> Image:
    """Reads a PNG, JPEG, BMP, TIFF or WebP image file.

    Raises:
        SloshCameraError: the file cannot be read, is no whole image or holds several; the text
            names it.
    """
    pages = len(tiff_pages(Path(path)))
    if pages > 1:
        raise SloshCameraError(f"{path}: holds {pages} pages; save the page that is meant alone")
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise SloshCameraError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        return _decode(np.frombuffer(data, np.uint8), Path(path).suffix[1:] or "an image")
    except SloshCameraError as error:
        raise SloshCameraError(f"{path}: {error}") from None


def read_page(path: Path, number: int) -> Image:
    """Reads one page of a TIFF file.

    Args:
        number: of the page, one of `tiff_pages`.

    Raises:
        SloshCameraError: it cannot be read; the text names file and page.
    """
    name = f"{path}: page {number + 1}"
    how = cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH
    try:
        found, images = cv2.imreadmulti(str(path), number, 1, flags=how)
    except cv2.error:
        found, images = False, ()
    if not found or not len(images):
        raise SloshCameraError(f"{name}: could not be decoded")
    try:
        return _of_8_bits(images[0])
    except SloshCameraError as error:
        raise SloshCameraError(f"{name}: {error}") from None


def _without_pattern(
    encoding: str, height: int, width: int, step: int, data: Any, big_endian: bool
) -> Image:
    if min(height, width) < _LEAST_BAYER:
        raise SloshCameraError(f"image: {width} x {height} pixels are too few for {encoding}")
    if encoding.endswith("16"):
        pixels = to_8_bits(_words(_rows(encoding, height, width, step, data, 2), big_endian))
    else:
        pixels = _rows(encoding, height, width, step, data, 1)
    code = _BAYER[encoding.removesuffix("16").removesuffix("8")]
    return np.asarray(cv2.cvtColor(pixels[..., 0], code), dtype=np.uint8)


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
        image = cv2.imdecode(array, cv2.IMREAD_ANYCOLOR | cv2.IMREAD_ANYDEPTH)
    except cv2.error:
        image = None
    if image is None:
        raise SloshCameraError(f"image: {array.size} bytes could not be decoded as {kind}")
    return _of_8_bits(image)


def _of_8_bits(image: NDArray[Any]) -> Image:
    if image.dtype == np.uint16:
        return to_8_bits(np.asarray(image, np.uint16))
    if image.dtype != np.uint8:
        raise SloshCameraError(f"image: pixels of type {image.dtype}; save it with 8 or 16 bits")
    return np.asarray(image, dtype=np.uint8)


def _bytes(data: Any) -> Image:
    try:
        return np.frombuffer(data, dtype=np.uint8)
    except (TypeError, ValueError, BufferError) as error:
        raise SloshCameraError("image: data is not a contiguous buffer of bytes") from error


def _damage(array: Image) -> str:
    """Returns why a JPEG, PNG or WebP file is incomplete; empty for complete or other files."""
    signature = array[: len(PNG)].tobytes()
    if signature.startswith(JPEG):
        return jpeg_damage(array)
    if signature.startswith(WEBP):
        return webp_damage(array.tobytes())
    return png_damage(array) if signature.startswith(PNG) else ""


def png_damage(data: Bytes) -> str:
    """Returns why a PNG file is incomplete; empty if it is complete.

    Args:
        data: (N,) the file.

    Returns:
        Some words; empty where the file is whole.
    """
    view = data.data
    if view[: len(_SIGNATURE)] != _SIGNATURE:
        return "its header is damaged"
    at = len(_SIGNATURE)
    while at + _BEFORE + _BEHIND <= len(view):
        kind = bytes(view[at + 4 : at + _BEFORE])
        end = at + _BEFORE + int.from_bytes(view[at : at + 4], "big")
        if end + _BEHIND > len(view):
            break
        if zlib.crc32(view[at + 4 : end]) != int.from_bytes(view[end : end + _BEHIND], "big"):
            return f"its chunk {kind.decode('ascii', 'replace')!r} at byte {at} is damaged"
        if kind == b"IEND":
            return ""
        at = end + _BEHIND
    return "the file is cut off"
