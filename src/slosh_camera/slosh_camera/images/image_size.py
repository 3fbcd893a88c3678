"""Reads the size of an image file from its header, before it is decoded.

A file of some kilobytes can claim a billion pixels. A decoder fills them first and tells later.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Callable, Iterator
from typing import BinaryIO, NamedTuple

from slosh_camera.errors import SloshCameraError

MOST_PIXELS = 40_000_000
"""Pixels of an image, at most: a progressive JPEG of as many takes 480 MB while it is turned."""
_MOST_WORK = 500_000_000  # pixels times scans: a progressive JPEG goes over all of them in each
_MOST_SEGMENTS = 10_000
JPEG, PNG, WEBP = b"\xff\xd8", b"\x89PNG", b"RIFF"
_MARKER = re.compile(rb"\xff+([^\xff])", re.DOTALL)
_SCAN, _END = 0xDA, 0xD9
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_ALONE = {0x00, 0x01, *range(0xD0, 0xD9)}  # markers without a content
_TIFF_FORMS = {3: "H", 4: "I", 16: "Q"}  # the types that hold a size
_SUBFILE, _WIDTH, _HEIGHT = 254, 256, 257
_WEBP_SIDE = 0x3FFF  # bits of a width or height
_WEBP_MOVES = 0b10  # of the flags
_TILES = ((_WIDTH, 322), (_HEIGHT, 323))  # tags: of the image, of a tile
_MOST_PAGES = 100_000
"""Pages of a TIFF file, at most; more is a loop or damage."""
_MOST_TAGS = 4096


class Size(NamedTuple):
    """Width and height of an image [px], and number of scans (passes) its decoding takes."""

    width: int
    height: int
    scans: int = 1


class TiffDirectory(NamedTuple):
    """What a TIFF file tells of one of its pages.

    Attributes:
        size: of the image, or of its tiles if they are larger; None: not told.
        reduced: whether it is a thumbnail or a mask.
    """

    size: Size | None
    reduced: bool


class _TiffLayout(NamedTuple):
    """Byte order; forms of offsets and numbers of tags; length of a tag, place of its value."""

    order: str
    offset: str
    number: str
    entry: int
    value: int


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
            f"image: {len(data)} bytes are not a complete image file: no PNG, JPEG, BMP, TIFF or "
            "WebP"
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


def _webp(data: bytes) -> Size | None:
    kind = data[8:16]
    if kind == b"WEBPVP8X":
        width, height = (int.from_bytes(data[at : at + 3], "little") + 1 for at in (24, 27))
    elif kind == b"WEBPVP8L":
        (both,) = struct.unpack_from("<I", data, 21)
        width, height = (both & _WEBP_SIDE) + 1, (both >> 14 & _WEBP_SIDE) + 1
    elif kind == b"WEBPVP8 ":
        width, height = (one & _WEBP_SIDE for one in struct.unpack_from("<HH", data, 26))
    else:
        return None
    return Size(width, height)


def webp_damage(data: bytes) -> str:
    """Returns why a WebP file cannot be read as a whole picture; empty if it can."""
    if int.from_bytes(data[4:8], "little") + 8 > len(data):
        return "the file is cut off"
    moves = data[12:16] == b"VP8X" and data[20] & _WEBP_MOVES
    return "it holds a film; save one of its pictures" if moves else ""


def _tiff(data: bytes) -> Size | None:
    return next(tiff_directories(io.BytesIO(data)), TiffDirectory(None, False)).size


def tiff_directories(file: BinaryIO) -> Iterator[TiffDirectory]:
    """Yields the pages of a TIFF file.

    Args:
        file: at its begin.

    Raises:
        struct.error: it is cut.
        KeyError: it is none.
    """
    order = {b"II": "<", b"MM": ">"}[file.read(2)]
    (version,) = struct.unpack(f"{order}H", file.read(2))
    if version == 43:  # BigTIFF
        file.seek(8)
        layout = _TiffLayout(order, "Q", "Q", 20, 12)
    else:
        layout = _TiffLayout(order, "I", "H", 12, 8)
    at, seen = _one(file, order + layout.offset), set[int]()
    while at and at not in seen and len(seen) < _MOST_PAGES:
        seen.add(at)
        file.seek(at)
        tags = dict(_tags(file, layout))
        size = None
        if {_WIDTH, _HEIGHT} <= tags.keys():
            wide, high = (max(tags[one], tags.get(tile, 0)) for one, tile in _TILES)
            size = Size(wide, high)
        yield TiffDirectory(size, bool(tags.get(_SUBFILE, 0) & 0b101))
        at = _one(file, order + layout.offset)


def _tags(file: BinaryIO, layout: _TiffLayout) -> Iterator[tuple[int, int]]:
    """Yields a page's tags of one whole number each; leaves the file behind the last one."""
    count = _one(file, layout.order + layout.number)
    if count > _MOST_TAGS:
        raise struct.error
    for _ in range(count):
        entry = file.read(layout.entry)
        tag, kind = struct.unpack_from(f"{layout.order}HH", entry)
        if kind in _TIFF_FORMS:
            yield tag, struct.unpack_from(layout.order + _TIFF_FORMS[kind], entry, layout.value)[0]


def _one(file: BinaryIO, form: str) -> int:
    (value,) = struct.unpack(form, file.read(struct.calcsize(form)))
    return int(value)


_READERS: dict[bytes, Callable[[bytes], Size | None]] = {
    JPEG: _jpeg,
    PNG: _png,
    b"BM": _bmp,
    b"II": _tiff,
    b"MM": _tiff,
    WEBP: _webp,
}
