"""Whether a PNG file is whole: its chunks carry sums of what is in them."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
# Length and kind before what a chunk holds, the sum behind it.
_BEFORE, _BEHIND = 8, 4


def png_damage(data: Bytes) -> str:
    """Why a PNG file is not whole; what is appended behind its end does not matter.

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
