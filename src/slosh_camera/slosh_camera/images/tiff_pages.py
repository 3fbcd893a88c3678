"""Lists the pictures of a TIFF file that holds several, such as a stack of a scientific camera."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from slosh_camera.images.image_size import too_large

TIFF_ENDINGS = (".tif", ".tiff")
_SUBFILE, _WIDTH, _HEIGHT, _TILE_WIDTH, _TILE_HEIGHT = 254, 256, 257, 322, 323
_FORMS = {3: "H", 4: "I", 16: "Q"}
_MOST = 100_000
"""Pages of a file, at most; more is a loop or damage."""
_MOST_TAGS = 4096


class _Layout(NamedTuple):
    """Byte order, and the forms of offsets, counts of tags and a tag's value."""

    order: str
    offset: str
    count: str
    entry: int
    value: int


def tiff_pages(path: Path) -> list[int]:
    """Returns the numbers of the pictures in a TIFF file, from 0.

    Thumbnails, masks and pages of another size than the first one are none.

    Args:
        path: any image file.

    Returns:
        The numbers; empty for other, damaged and too large ones, of which decoding tells more.
    """
    if path.suffix.lower() not in TIFF_ENDINGS:
        return []
    try:
        with path.open("rb") as file:
            pages = list(_pages(file))
    except (OSError, struct.error, KeyError):
        return []
    if not pages or too_large(*pages[0][0]):
        return []
    return [n for n, (size, reduced) in enumerate(pages) if not reduced and size == pages[0][0]]


def _pages(file: BinaryIO) -> Iterator[tuple[tuple[int, int], bool]]:
    """Yields size of each page [px], and whether it is a thumbnail or a mask."""
    order = {b"II": "<", b"MM": ">"}[file.read(2)]
    (version,) = struct.unpack(f"{order}H", file.read(2))
    if version == 43:  # BigTIFF
        file.seek(8)
        layout = _Layout(order, "Q", "Q", 20, 12)
    else:
        layout = _Layout(order, "I", "H", 12, 8)
    at, seen = _one(file, order + layout.offset), set()
    while at and at not in seen and len(seen) < _MOST:
        seen.add(at)
        file.seek(at)
        tags = dict(_tags(file, layout))
        at = _one(file, order + layout.offset)
        wide = max(tags.get(_WIDTH, 0), tags.get(_TILE_WIDTH, 0))
        high = max(tags.get(_HEIGHT, 0), tags.get(_TILE_HEIGHT, 0))
        yield (wide, high), bool(tags.get(_SUBFILE, 0) & 0b101)


def _tags(file: BinaryIO, layout: _Layout) -> Iterator[tuple[int, int]]:
    """Yields a page's tags of one whole number each; leaves the file behind the last one."""
    count = _one(file, layout.order + layout.count)
    if count > _MOST_TAGS:
        raise struct.error
    for _ in range(count):
        entry = file.read(layout.entry)
        tag, kind = struct.unpack_from(f"{layout.order}HH", entry)
        if kind in _FORMS:
            yield tag, struct.unpack_from(layout.order + _FORMS[kind], entry, layout.value)[0]


def _one(file: BinaryIO, form: str) -> int:
    (value,) = struct.unpack(form, file.read(struct.calcsize(form)))
    return int(value)
