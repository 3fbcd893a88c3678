"""Decompresses parts of files from other programs, with a size limit.

Some kilobytes of zeros packed are gigabytes unpacked. So what is let in is bounded first, and
unpacking stops there.
"""

from __future__ import annotations

import bz2
from collections.abc import Callable

import lz4.frame
import zstandard

from slosh_bag.errors import SloshBagError

MOST_UNPACKED = 200_000_000
"""Of a chunk or a message, at most: enough for an image of 50 megapixels in colour [bytes]."""

Stored = bytes | memoryview


class UnpackingError(SloshBagError):
    """Error of data that cannot be decompressed."""


def unpack(compression: str, stored: Stored, size: int | None = None) -> bytes:
    """Decompresses data with a named compression method, up to a size limit.

    Args:
        compression: empty, lz4, zstd or bz2.
        stored: the packed bytes.
        size: how many they must be unpacked, no more than MOST_UNPACKED; None: any number up to
            that.

    Raises:
        UnpackingError: they are damaged, or not as many.
    """
    most = MOST_UNPACKED if size is None else size
    try:
        _check_noted(_noted(compression, stored), size)
        raw = _UNPACKERS[compression](stored, most)
    except (
        zstandard.ZstdError,
        RuntimeError,
        ValueError,
        EOFError,
        OSError,
        MemoryError,
    ) as error:
        if isinstance(error, UnpackingError):
            raise
        raise UnpackingError(f"that {compression} cannot unpack") from None
    if len(raw) > most:
        raise UnpackingError(f"that unpacks to more than {most} bytes")
    if size is not None and len(raw) != size:
        raise UnpackingError(f"of {len(raw)} instead of {size} bytes")
    return raw


def _plain(stored: Stored, most: int) -> bytes:
    return bytes(stored) if len(stored) <= most else bytes(stored[: most + 1])


def _lz4(stored: Stored, most: int) -> bytes:
    unpacker = lz4.frame.LZ4FrameDecompressor()
    raw = bytes(unpacker.decompress(stored, max_length=most + 1))
    if len(raw) <= most and not unpacker.eof:
        raise EOFError
    return raw


def _zstd(stored: Stored, most: int) -> bytes:
    if _noted("zstd", stored) > 0:
        return zstandard.ZstdDecompressor().decompress(stored)
    parts, total = [], 0
    with zstandard.ZstdDecompressor().stream_reader(stored, read_across_frames=True) as reader:
        while total <= most and (part := reader.read(most + 1 - total)):
            parts.append(part)
            total += len(part)
    return b"".join(parts)


def _bz2(stored: Stored, most: int) -> bytes:
    """Decompresses concatenated bzip2 streams, up to a size limit."""
    parts, left, total = [], bytes(stored), 0
    while left and total <= most:
        unpacker = bz2.BZ2Decompressor()
        parts.append(unpacker.decompress(left, max_length=most + 1 - total))
        total += len(parts[-1])
        if total <= most and not unpacker.eof:
            raise EOFError
        left = unpacker.unused_data
    return b"".join(parts)


def _noted(compression: str, stored: Stored) -> int:
    """Returns the decompressed size stored in compressed data, or 0 or less if there is none."""
    if compression == "lz4":
        return int(lz4.frame.get_frame_info(stored)["content_size"])
    return zstandard.frame_content_size(stored) if compression == "zstd" else 0


def _check_noted(noted: int, size: int | None) -> None:
    """Raises an error if the stored decompressed size is wrong or too large."""
    if noted > 0 and noted != (noted if size is None else size):
        raise UnpackingError("with a damaged size")
    if noted > MOST_UNPACKED:
        raise UnpackingError(f"that unpacks to {noted} bytes, more than {MOST_UNPACKED}")


_UNPACKERS: dict[str, Callable[[Stored, int], bytes]] = {
    "": _plain,
    "lz4": _lz4,
    "zstd": _zstd,
    "bz2": _bz2,
}
