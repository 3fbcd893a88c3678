"""Reads EXIF data of image files: focal length and orientation of the camera."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slosh_camera.errors import SloshCameraError
from slosh_camera.images.tuning import TUNING

_ORIENTATION, _EXIF_BLOCK = 0x0112, 0x8769
_WIDTH, _HEIGHT, _FOCAL_35 = 0xA002, 0xA003, 0xA405
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
    focal, width, height = (inner.get(tag, 0) for tag in (_FOCAL_35, _WIDTH, _HEIGHT))
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
