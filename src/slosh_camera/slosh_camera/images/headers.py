"""Reads size, pages and EXIF data of an image file from its headers, before it is decoded.

A file of some kilobytes can claim a billion pixels. A decoder fills them first and tells later.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from slosh_camera.errors import SloshCameraError
from slosh_camera.images.tuning import TUNING

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


TIFF_ENDINGS = (".tif", ".tiff")


def tiff_pages(path: Path) -> list[int]:
    """Returns the numbers of the pictures in a TIFF file, from 0.

    Thumbnails, masks and pages of another size than the first one are none.

    Returns:
        The numbers; empty for other, damaged and too large ones, of which decoding tells more.
    """
    if path.suffix.lower() not in TIFF_ENDINGS:
        return []
    try:
        with path.open("rb") as file:
            pages = list(tiff_directories(file))
    except (OSError, struct.error, KeyError):
        return []
    first = pages[0].size if pages else None
    if first is None or too_large(first.width, first.height):
        return []
    return [n for n, page in enumerate(pages) if not page.reduced and page.size == first]


_ORIENTATION, _EXIF_BLOCK = 0x0112, 0x8769
_EXIF_WIDTH, _EXIF_HEIGHT, _FOCAL_35 = 0xA002, 0xA003, 0xA405
# Types of one number: 16 and 32 bits.
_FORMATS = {3: "H", 4: "I"}
# Diagonal of a frame of 35 mm film [mm]; CIPA DCG-001 compares lenses by the angle across it.
_DIAGONAL = float(np.hypot(36.0, 24.0))
_PNG = b"\x89PNG\r\n\x1a\n"


@dataclass(frozen=True, slots=True)
class Exif:
    """Values read from the EXIF data of an image.

    Attributes:
        orientation: how the picture is turned for display, 1 (not at all) to 8.
        focal_length: equivalent for 35 mm film [mm]; None: not told.
        size: width and height as the camera took the picture [px]; None: not told.
    """

    orientation: int = 1
    focal_length: float | None = None
    size: tuple[int, int] | None = None

    def field_of_view(self, width: int, height: int) -> float:
        """Returns the horizontal field of view of an image of a given size [rad].

        Raises:
            SloshCameraError: no focal length is told, or the picture is a part of the camera's.
        """
        if self.focal_length is None:
            raise SloshCameraError("EXIF: contains no focal length in 35 mm equivalents")
        if self.size is not None:
            now, then = (max(pair) / min(pair) for pair in ((width, height), self.size))
            if abs(now / then - 1.0) > TUNING.same_ratio:
                raise SloshCameraError(
                    f"EXIF: the focal length is for a picture of {self.size[0]} x "
                    f"{self.size[1]} pixels, but this picture is a part of it with {width} x "
                    f"{height}"
                )
        focal = self.focal_length * float(np.hypot(width, height)) / _DIAGONAL
        return 2.0 * float(np.arctan(0.5 * width / focal))


def read_exif(path: str | Path) -> Exif:
    """Reads the EXIF data of an image file; missing values are marked as unknown.

    Raises:
        SloshCameraError: the file cannot be read; the text names it.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise SloshCameraError(f"{path}: cannot be read: {error.strerror}") from error
    try:
        block = _block(data)
        return _parsed(block) if block else Exif()
    except (struct.error, KeyError):
        return Exif()


def _block(data: bytes) -> bytes:
    """Returns the TIFF structure that holds the EXIF data; empty if there is none."""
    if data.startswith(_PNG):
        place = len(_PNG)
        while place + 8 <= len(data):
            length, kind = struct.unpack_from(">I4s", data, place)
            if kind == b"eXIf":
                return data[place + 8 : place + 8 + length]
            place += length + 12
        return b""
    place = 2 if data.startswith(b"\xff\xd8") else len(data)
    while place + 4 <= len(data) and data[place] == 0xFF and data[place + 1] != 0xDA:
        (length,) = struct.unpack_from(">H", data, place + 2)
        if data[place + 1] == 0xE1 and data[place + 4 : place + 10] == b"Exif\0\0":
            return data[place + 10 : place + 2 + length]
        place += 2 + length
    return b""


def _parsed(block: bytes) -> Exif:
    order = {b"II": "<", b"MM": ">"}[block[:2]]
    main = _entries(block, order, struct.unpack_from(order + "I", block, 4)[0])
    inner = _entries(block, order, main[_EXIF_BLOCK]) if _EXIF_BLOCK in main else {}
    focal, width, height = (inner.get(tag, 0) for tag in (_FOCAL_35, _EXIF_WIDTH, _EXIF_HEIGHT))
    orientation = main.get(_ORIENTATION, 1)
    return Exif(
        orientation if 1 <= orientation <= 8 else 1,
        float(focal) if focal else None,
        (width, height) if width and height else None,
    )


def _entries(block: bytes, order: str, start: int) -> dict[int, int]:
    """Returns the integer values of an EXIF directory by tag."""
    (count,) = struct.unpack_from(order + "H", block, start)
    found = {}
    for index in range(count):
        place = start + 2 + 12 * index
        tag, kind, size = struct.unpack_from(order + "HHI", block, place)
        if kind in _FORMATS and size == 1:
            (found[tag],) = struct.unpack_from(order + _FORMATS[kind], block, place + 8)
    return found
