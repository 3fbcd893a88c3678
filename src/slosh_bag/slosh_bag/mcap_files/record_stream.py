"""Reads an MCAP file record by record, never beyond the original end of the file."""

from __future__ import annotations

import struct
import zlib
from typing import BinaryIO

from slosh_bag.mcap_files.chunks import RECORD_HEADER, DamageError

_HEADER = struct.Struct("<BQ")
_WINDOW = 1 << 20


class CutOffError(DamageError):
    """Error of a record that extends beyond the file's end."""


class RecordStream:
    """Reads a file sequentially and computes the checksum of the bytes read.

    Args:
        stream: the file.
        size: its length, beyond which nothing is read even if it grows [bytes].
        checked: compute the checksum.

    Attributes:
        position: where the next byte is read.
        crc: CRC-32 of all bytes before the record that was begun last; 0 where not computed.
    """

    def __init__(self, stream: BinaryIO, size: int, *, checked: bool = True) -> None:
        self.position = 0
        self.crc = 0
        self._stream = stream
        self._size = size
        self._checked = checked
        self._running = 0
        stream.seek(0)

    @property
    def left(self) -> int:
        """Number of bytes from the current position to the file's end."""
        return self._size - self.position

    def begin(self) -> tuple[int, int]:
        """Reads the header of the next record and returns its opcode and length.

        Raises:
            CutOffError: the file ends before.
        """
        self.crc = self._running
        opcode, length = _HEADER.unpack(self.take(RECORD_HEADER))
        return opcode, length

    def take(self, length: int) -> bytes:
        """Reads the next bytes of the current record.

        Raises:
            CutOffError: the file ends before.
        """
        if length > self.left:
            raise CutOffError("a record is cut off")
        content = self._stream.read(length)
        if len(content) < length:
            raise CutOffError("a record is cut off")
        if self._checked:
            self._running = zlib.crc32(content, self._running)
        self.position += length
        return content

    def peek(self, length: int) -> bytes:
        """Returns up to `length` of the next bytes without moving the position."""
        content = self._stream.read(min(length, self.left))
        self._stream.seek(self.position)
        return content

    def skip(self, length: int, *, checked: bool = False) -> int:
        """Skips bytes and returns their CRC-32, or 0 if checksums are disabled.

        Args:
            length: how many.
            checked: compute the CRC-32 in any case.

        Raises:
            CutOffError: the file ends before.
        """
        if length > self.left:
            raise CutOffError("a record is cut off")
        if not (self._checked or checked):
            self.jump(self.position + length)
            return 0
        crc = 0
        while length:
            part = self.take(min(length, _WINDOW))
            crc, length = zlib.crc32(part, crc), length - len(part)
        return crc

    def back(self) -> None:
        """Moves back to the start of the record whose header was just read."""
        self._running = self.crc
        self.jump(self.position - RECORD_HEADER)

    def jump(self, position: int) -> None:
        """Moves to a position in the file, which makes the checksum invalid."""
        self.position = position
        self._stream.seek(position)
