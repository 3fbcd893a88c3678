"""Limits the work of reading one file in proportion to its size."""

from __future__ import annotations

from pathlib import Path

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunk_scan import MOST_MESSAGES
from slosh_bag.mcap_files.chunks import CHUNK_START, DamageError, chunk_header

UNPACKED = 500_000_000
"""What any file may be unpacked [bytes]."""
UNPACKED_PER_BYTE = 4000
"""And for each byte of it: black images in small chunks are packed 3000 to 1."""


class ReadingBound:
    """Counts the decompressed bytes of a file and rejects excessive amounts.

    Args:
        path: the file.
        size: its size [bytes].
    """

    def __init__(self, path: Path, size: int) -> None:
        self._path, self._size = path, size
        self._unpacked = self._messages = 0

    def unpack(self, content: bytes) -> None:
        """Counts a chunk's decompressed size before the chunk is decompressed.

        Raises:
            SloshBagError: with it, it is too much.
        """
        try:
            self._unpacked += chunk_header(content[:CHUNK_START], len(content)).size
        except DamageError:
            return
        if self._unpacked > UNPACKED + UNPACKED_PER_BYTE * self._size:
            raise self._error(f"{self._unpacked // 1_000_000} MB")

    def take(self, messages: int) -> None:
        """Counts messages and rejects more messages than the file can contain.

        Raises:
            SloshBagError: with them, there are too many.
        """
        self._messages += messages
        if self._messages > MOST_MESSAGES + self._size:
            raise self._error(f"{self._messages} messages")

    def _error(self, what: str) -> SloshBagError:
        return SloshBagError(
            f"{self._path}: a file of {1e-6 * self._size:.1f} MB that unpacks to more than "
            f"{what}: no recording compresses so well; copy it again from the recorder"
        )
