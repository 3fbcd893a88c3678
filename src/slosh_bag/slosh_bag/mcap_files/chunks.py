"""The messages of an MCAP chunk as arrays, decompressed and checked."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunk_scan import (
    BAD_LENGTH,
    BAD_RECORD,
    BAD_TIME,
    CUT,
    MOST_DEFINITIONS,
    MOST_MESSAGES,
    TOO_MANY,
    WHOLE,
    scan,
)
from slosh_bag.unpacking import MOST_UNPACKED, UnpackingError, unpack
from slosh_base.types import Integers

Bytes = NDArray[np.uint8]

RECORD_HEADER = 9
"""Opcode and length before the content of each record [bytes]."""
CHUNK_START = 56
"""Enough of a chunk's content to read its header [bytes]."""
_CREDIBLE = 2**31  # chunks that say to be larger are damaged [bytes]
_CHUNK = struct.Struct("<QQQII")

_PROBLEMS = {
    CUT: "a record reaches beyond the chunk's end",
    BAD_LENGTH: "a message is shorter than its header",
    BAD_TIME: "a message's time lies beyond the year 2262",
    BAD_RECORD: "a record that is not allowed in a chunk",
}


class DamageError(SloshBagError):
    """Error of damaged bytes; the message describes the damage, without its position."""


class TooLargeError(DamageError):
    """Error of MCAP data that would need too much memory to read."""


@dataclass(frozen=True, slots=True, eq=False)
class MessageBlock:
    """The messages of one topic within one chunk, in the order of their log times.

    Attributes:
        topic: their topic.
        message_type: e.g. 'slosh_msgs/msg/FreeSurface'.
        log_ns, publish_ns: when each was received and sent, (N,) [ns].
        start, length: where each one's CDR bytes lie in the buffer, (N,) [bytes].
        buffer: the chunk's uncompressed bytes.
    """

    topic: str
    message_type: str
    log_ns: Integers
    publish_ns: Integers
    start: Integers
    length: Integers
    buffer: Bytes

    def __len__(self) -> int:
        return len(self.start)

    def data(self, index: int) -> bytes:
        """Returns the CDR bytes of one message."""
        start = int(self.start[index])
        return self.buffer[start : start + int(self.length[index])].tobytes()

    def take(self, rows: Any) -> MessageBlock:
        """Returns a block that contains only the messages selected by indices, slice or mask.

        Args:
            rows: indexes, a slice or a mask.
        """
        return replace(
            self,
            log_ns=self.log_ns[rows],
            publish_ns=self.publish_ns[rows],
            start=self.start[rows],
            length=self.length[rows],
        )


class ChunkHeader(NamedTuple):
    """Header of an MCAP chunk: times, sizes and checksum.

    Attributes:
        start_ns, end_ns: least and greatest log time in it [ns]; 0 and 0 where it is empty.
        size: of its bytes before compression.
        crc: their CRC-32; 0: not noted.
        compression: 'zstd', 'lz4' or ''.
        content: where the compressed bytes begin, after the record's own header [bytes].
        stored: number of compressed bytes; what follows them in the record is not the chunk's.
    """

    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    content: int
    stored: int


@dataclass(frozen=True, slots=True, eq=False)
class Chunk:
    """The records of one MCAP chunk, or consecutive records outside chunks.

    Attributes:
        position: where it begins in the file [bytes].
        stored: how many bytes it takes there.
        raw: its uncompressed bytes.
        channel, log_ns, publish_ns, start, length: of each message, in the order of log times;
            where these are equal, in the order of the file.
        schemas, channels: the definitions among the records.
        checked: its bytes agree with a CRC.
    """

    position: int
    stored: int
    raw: bytes
    channel: Integers
    log_ns: Integers
    publish_ns: Integers
    start: Integers
    length: Integers
    schemas: tuple[Schema, ...]
    channels: tuple[Channel, ...]
    checked: bool

    def __len__(self) -> int:
        return len(self.start)

    @property
    def buffer(self) -> Bytes:
        """The chunk's uncompressed bytes as an array."""
        return np.frombuffer(self.raw, np.uint8)

    def take(self, rows: Any) -> Chunk:
        """Returns a chunk that contains only the messages selected by indices, slice or mask.

        Args:
            rows: indexes, a slice or a mask.
        """
        return replace(
            self,
            channel=self.channel[rows],
            log_ns=self.log_ns[rows],
            publish_ns=self.publish_ns[rows],
            start=self.start[rows],
            length=self.length[rows],
        )


def sequence_of(chunk: Chunk, start: int) -> int:
    """Returns the sequence number in the header of a message.

    Args:
        chunk: that holds it.
        start: where its data begin in the chunk [bytes].
    """
    return int.from_bytes(chunk.raw[start - 20 : start - 16], "little")


class StrictStream(ReadDataStream):
    """A stream over a record's content that never returns fewer bytes than requested."""

    def __init__(self, content: bytes) -> None:
        super().__init__(io.BytesIO(content))

    def read(self, length: int) -> bytes:
        """Reads exactly `length` bytes; raises an error if fewer are left.

        Raises:
            EndOfFile: there are fewer.
        """
        content = self._stream.read(length)
        self._count += len(content)
        if len(content) < length:
            raise EndOfFile
        return bytes(content)


def parse(kind: Any, content: bytes) -> Any:
    """Parses a record's content to one of the mcap library's record classes.

    Args:
        kind: the type.
        content: of the record; bytes after its fields are those of a later version, and ignored.

    Raises:
        DamageError: the content is not that of such a record.
    """
    try:
        return kind.read(StrictStream(content))
    except (McapError, ValueError, EOFError, struct.error, OverflowError, MemoryError):
        raise DamageError(f"no valid {kind.__name__} record") from None


def chunk_header(start: bytes, record_length: int) -> ChunkHeader:
    """Parses the header of a chunk.

    Args:
        start: the first 48 bytes of the record's content, or all where it is shorter.
        record_length: of the record's content [bytes].

    Raises:
        DamageError: these are not the bytes of a chunk.
    """
    if len(start) < _CHUNK.size:
        raise DamageError("a chunk without its header")
    start_ns, end_ns, size, crc, name_length = _CHUNK.unpack_from(start)
    content = _CHUNK.size + name_length + 8
    if name_length > 4 or len(start) < content:
        raise DamageError("a chunk with a damaged header")
    name = start[_CHUNK.size : content - 8]
    (stored,) = struct.unpack_from("<Q", start, content - 8)
    if content + stored > record_length or size > _CREDIBLE or end_ns < start_ns:
        raise DamageError("a chunk with a damaged header")
    if size > MOST_UNPACKED:
        raise TooLargeError(
            f"a chunk of {size} bytes, more than {MOST_UNPACKED}; write it with smaller chunks"
        )
    if name not in (b"zstd", b"lz4", b""):
        raise DamageError(f"a chunk compressed with {name.decode('latin-1')!r}, which is unknown")
    return ChunkHeader(start_ns, end_ns, size, crc, name.decode(), content, stored)


def read_chunk(position: int, header: ChunkHeader, content: bytes) -> Chunk:
    """Decompresses an MCAP chunk and finds the records in it.

    Args:
        position: of its record in the file.
        header: what it says of itself.
        content: of the record.

    Raises:
        DamageError: its bytes are not what was written.
    """
    stored = memoryview(content)[header.content : header.content + header.stored]
    raw = _unpacked(header, stored)
    if header.crc and zlib.crc32(raw) != header.crc:
        raise DamageError("a chunk whose checksum (CRC) is wrong")
    messages, others, end, state = scan(np.frombuffer(raw, np.uint8), False)
    if state == TOO_MANY:
        raise TooLargeError(
            f"a chunk of more than {MOST_MESSAGES} messages or {MOST_DEFINITIONS} definitions; "
            "write it with smaller chunks"
        )
    if state != WHOLE:
        raise DamageError(f"in a chunk, {end} bytes from its start: {_PROBLEMS[state]}")
    place = position, RECORD_HEADER + len(content)
    return _chunk(place, raw, messages, others, bool(header.crc))


def whole_chunk(position: int, content: bytes, *, agreeing: bool = False) -> Chunk:
    """Parses a chunk's header and decompresses its records.

    Args:
        position: of its record in the file.
        content: of the record.
        agreeing: refuse one whose header tells other times than its messages have.

    Raises:
        DamageError: its bytes are not what was written.
    """
    header = chunk_header(content[:CHUNK_START], len(content))
    chunk = read_chunk(position, header, content)
    if agreeing and not agrees(header, chunk):
        raise DamageError("a chunk with other times than its messages")
    return chunk


def damaged(path: Path, position: int, error: DamageError) -> SloshBagError:
    """Creates the error for damage that is not at the end of a file."""
    return SloshBagError(
        f"{path}: damaged at byte {position}: {error}; `slosh recover` writes a new bag with "
        "all intact messages"
    )


def agrees(header: ChunkHeader, chunk: Chunk) -> bool:
    """Whether a chunk's first and last message times equal those in its header."""
    if not len(chunk):
        return True
    return bool(header.start_ns == chunk.log_ns[0] and header.end_ns == chunk.log_ns[-1])


def read_loose(position: int, window: bytes) -> Chunk:
    """Reads consecutive records that are outside chunks.

    Args:
        position: of the first in the file.
        window: the file's bytes from there.

    Returns:
        The schemas, channels and messages that follow each other; a chunk of no bytes where the
        first is another record or reaches beyond the window.

    Raises:
        DamageError: a record is not what was written.
    """
    messages, others, end, state = scan(np.frombuffer(window, np.uint8), True)
    if state in (BAD_LENGTH, BAD_TIME):
        raise DamageError(_PROBLEMS[state])
    return _chunk((position, int(end)), window[:end], messages, others, False)


def _chunk(
    place: tuple[int, int], raw: bytes, messages: Integers, others: Integers, checked: bool
) -> Chunk:
    log_ns = messages[1]
    if (log_ns[1:] < log_ns[:-1]).any():
        messages = messages[:, np.argsort(log_ns, kind="stable")]
    schemas, channels = [], []
    for opcode, start, length in others.T.tolist():
        content = raw[start : start + length]
        if opcode == Opcode.SCHEMA:
            schemas.append(parse(Schema, content))
        else:
            channels.append(parse(Channel, content))
    position, stored = place
    return Chunk(
        position,
        stored,
        raw,
        channel=messages[0],
        log_ns=messages[1],
        publish_ns=messages[2],
        start=messages[3],
        length=messages[4],
        schemas=tuple(schemas),
        channels=tuple(channels),
        checked=checked,
    )


def _unpacked(header: ChunkHeader, stored: memoryview) -> bytes:
    try:
        return unpack(header.compression, stored, header.size)
    except UnpackingError as error:
        raise DamageError(f"a chunk {error}") from None
