"""Reads the chunk index at the end of an MCAP file.

So that what stands in a few chunks, as a node's latched settings or one image, costs these chunks
and not the whole file, which may be hours long.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex

from slosh_bag.mcap_files.chunks import (
    RECORD_HEADER,
    Chunk,
    DamageError,
    damaged,
    whole_chunk,
)
from slosh_bag.mcap_files.mcap_summary import (
    END,
    MAGIC,
    FileSummary,
    read_summary,
    summary_records,
)

_HEADER = struct.Struct("<BQ")
_ENTRIES = {
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
}
Window = tuple[int, int]
"""First and last log time [ns]."""


class Index(NamedTuple):
    """The chunk index in a file's summary.

    Attributes:
        summary: definitions and numbers of messages.
        chunks: one entry each, in the order of the file.
    """

    summary: FileSummary
    chunks: tuple[ChunkIndex, ...]


def read_index(path: Path) -> Index | None:
    """Reads a file's chunk index, or returns None if it is incomplete or unreliable."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        summary = read_summary(stream, size)
        if summary is None or not summary.tells_topics:
            return None
        try:
            chunks, beside = _entries(stream, summary.start, size - END)
            told = (
                sum(entry.chunk_length + entry.message_index_length for entry in chunks) + beside
            )
            complete = _is_all(stream, told, summary.start)
        except (DamageError, struct.error):
            return None
    # Some writers leave out an entry's channels, or what these are.
    channels = {channel for entry in chunks for channel in entry.message_index_offsets}
    named = all(entry.message_index_offsets for entry in chunks) and summary.knows(channels)
    return Index(summary, chunks) if named and complete else None


def _is_all(stream: BinaryIO, told: int, end: int) -> bool:
    """Whether the indexed records make up the whole data section, without other messages."""
    _, header = _record_at(stream, len(MAGIC))
    start = len(MAGIC) + RECORD_HEADER + header + told
    if start >= end:
        return False
    opcode, length = _record_at(stream, start)
    return opcode == Opcode.DATA_END and start + RECORD_HEADER + length == end


def _record_at(stream: BinaryIO, position: int) -> tuple[int, int]:
    stream.seek(position)
    opcode, length = _HEADER.unpack(stream.read(RECORD_HEADER))
    return opcode, length


def _entries(stream: BinaryIO, start: int, end: int) -> tuple[tuple[ChunkIndex, ...], int]:
    """Returns the summary's chunk index entries, and the length of all other listed records."""
    found, beside = [], 0
    for entry in summary_records(stream, start, end, _ENTRIES):
        if isinstance(entry, ChunkIndex):
            found.append(entry)
        else:
            beside += entry.length
    return tuple(found), beside


def indexed_chunks(
    path: Path, index: Index, channels: Collection[int], windows: Collection[Window] | None
) -> Iterator[Chunk]:
    """Yields the chunks that contain messages of the given channels, in file order.

    Args:
        path: the file.
        index: of it.
        channels: by their numbers.
        windows: only chunks with log times in one of these; None: all.

    Raises:
        SloshBagError: such a chunk is damaged.
    """
    wanted = set(channels)
    with path.open("rb") as stream:
        for entry in index.chunks:
            if not entry.message_index_offsets.keys() & wanted:
                continue
            if windows is None or any(
                first <= entry.message_end_time and entry.message_start_time <= last
                for first, last in windows
            ):
                yield _chunk_at(path, stream, entry)


def _chunk_at(path: Path, stream: BinaryIO, entry: ChunkIndex) -> Chunk:
    position = entry.chunk_start_offset
    stream.seek(position)
    try:
        record = stream.read(entry.chunk_length)
        if record[:1] != bytes([Opcode.CHUNK]) or len(record) != entry.chunk_length:
            raise DamageError("no chunk where the index has one")
        return whole_chunk(position, record[RECORD_HEADER:], agreeing=True)
    except DamageError as error:
        raise damaged(path, position, error) from None
