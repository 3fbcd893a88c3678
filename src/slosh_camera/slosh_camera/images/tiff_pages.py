"""Lists the pictures of a TIFF file that holds several, such as a stack of a scientific camera."""

from __future__ import annotations

import struct
from pathlib import Path

from slosh_camera.images.image_size import tiff_directories, too_large

TIFF_ENDINGS = (".tif", ".tiff")


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
            pages = list(tiff_directories(file))
    except (OSError, struct.error, KeyError):
        return []
    first = pages[0].size if pages else None
    if first is None or too_large(first.width, first.height):
        return []
    return [n for n, page in enumerate(pages) if not page.reduced and page.size == first]
