"""Reads the size of an image file from its header, before it is decoded.

A file of some kilobytes can claim a billion pixels. A decoder fills them first and tells later.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator
from typing import NamedTuple

from slosh_camera.errors import SloshCameraError

MOST_PIXELS = 40_000_000
"""Pixels of an image, at most: a progressive JPEG of as many takes 480 MB while it is turned."""
_MOST_WORK = 500_000_000  # pixels times scans: a progressive JPEG goes over all of them in each
_MOST_SEGMENTS = 10_000
JPEG, PNG = b"\xff\xd8", b"\x89PNG"
_MARKER = re.compile(rb"\xff+([^\xff])", re.DOTALL)
_SCAN, _END = 0xDA, 0xD9
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_ALONE = {0x00, 0x01, *range(0xD0, 0xD9)}  # markers without a content
_TIFF_FORMS = {3: "H", 4: "I", 16: "Q"}  # the types that hold a size
_TIFF_SIZES = (256, 257, 322, 323)  # tags: width and height of the image, of a tile


class Size(NamedTuple):
    """Width and height of an image [px], and number of scans (passes) its decoding takes."""

    width: int
    height: int
    scans: int = 1


def check_size(data: bytes) -> None:
    """Raises an error for an image that needs too much memory or time to decode.

    Args:
        data: the file's bytes.

    Raises:
        SloshCameraError: it is too large, or of a kind whose size cannot be told.
    """
    read = next((read for start, read in _READERS.items() if data.startswith(start)), None)
    try:
        size = read(data) if read else None
    except (struct.error, IndexError):
        size = None
    if size is None:
        raise SloshCameraError(
            f"image: {len(data)} bytes are not a complete image file: no PNG, JPEG, BMP or TIFF"
        )
    told = too_large(size.width, size.height)
    if told:
        raise SloshCameraError(f"image: {told}")
    if size.width * size.height * size.scans > _MOST_WORK:
        raise SloshCameraError(
            f"image: claims {size.width} x {size.height} pixels in {size.scans} scans; "
            "save it with fewer"
        )


def too_large(width: int, height: int) -> str:
    """Returns an error text if an image has too many pixels; empty if it is acceptable."""
    if width * height <= MOST_PIXELS:
        return ""
    most = MOST_PIXELS // 1_000_000
    return f"claims {width} x {height} pixels, more than {most} million; make it smaller"


def _segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Yields marker code and content position of each JPEG segment before the pixel data."""
    at = 2
    for _ in range(_MOST_SEGMENTS):
        match = _MARKER.search(data, at)  # libjpeg, too, passes over what is between segments
        if match is None:
            return
        code, at = match[1][0], match.end()
        yield code, at
        if code in (_SCAN, _END):
            return
        if code not in _ALONE:
            at += max(2, int.from_bytes(data[at : at + 2], "big"))


def _jpeg(data: bytes) -> Size | None:
    for code, at in _segments(data):
        if code in _FRAMES:
            height, width = struct.unpack_from(">HH", data, at + 3)
            return Size(width, height, data.count(bytes((0xFF, _SCAN))))
    return None


def _png(data: bytes) -> Size:
    return Size(*struct.unpack_from(">II", data, 16))


def _bmp(data: bytes) -> Size:
    (header,) = struct.unpack_from("<I", data, 14)
    form = "<HH" if header == 12 else "<ii"  # 12: that of OS/2
    width, height = struct.unpack_from(form, data, 18)
    return Size(abs(width), abs(height))


def _tiff(data: bytes) -> Size | None:
    """Returns the size of a TIFF file's first image, or of its tiles if they are larger."""
    order = "<" if data.startswith(b"II") else ">"
    (version,) = struct.unpack_from(f"{order}H", data, 2)
    if version == 43:  # BigTIFF
        (start,) = struct.unpack_from(f"{order}Q", data, 8)
        (count,) = struct.unpack_from(f"{order}Q", data, start)
        start, entry, value = start + 8, 20, 12
    else:
        (start,) = struct.unpack_from(f"{order}I", data, 4)
        (count,) = struct.unpack_from(f"{order}H", data, start)
        start, entry, value = start + 2, 12, 8
    sizes: dict[int, int] = {}
    for at in range(start, start + min(count, 65535) * entry, entry):
        tag, kind = struct.unpack_from(f"{order}HH", data, at)
        if tag in _TIFF_SIZES and kind in _TIFF_FORMS:
            (sizes[tag],) = struct.unpack_from(order + _TIFF_FORMS[kind], data, at + value)
    if not {256, 257} <= sizes.keys():
        return None
    return Size(max(sizes[256], sizes.get(322, 0)), max(sizes[257], sizes.get(323, 0)))


_READERS: dict[bytes, Callable[[bytes], Size | None]] = {
    JPEG: _jpeg,
    PNG: _png,
    b"BM": _bmp,
    b"II": _tiff,
    b"MM": _tiff,
}
