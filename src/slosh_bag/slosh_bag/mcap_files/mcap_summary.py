"""Reads the summary at the end of an MCAP file and checks whether it is reliable."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, MetadataIndex, Schema, Statistics

from slosh_bag.mcap_files.chunk_scan import MOST_DEFINITIONS
from slosh_bag.mcap_files.chunks import RECORD_HEADER, DamageError, parse

MAGIC = b"\x89MCAP0\r\n"
_FOOTER = struct.Struct("<BQQQI")
_HEADER = struct.Struct("<BQ")
END = _FOOTER.size + len(MAGIC)
_SLICE = 1 << 20
MOST_TAKEN = 2 * MOST_DEFINITIONS
"""Records of a summary that are kept, at most; with more it counts as damaged."""


@dataclass(slots=True)
class FileSummary:
    """The summary at the end of an MCAP file.

    Attributes:
        start: where the summary begins; 0: the file has none.
        trusted: its checksum is right, so that the rest here can be relied on.
        damaged: its checksum is wrong.
        schemas, channels: by their ids.
        counts: messages by channel id; None: not noted.
        metadata, attachments: where the file's records of these kinds are.
    """

    start: int
    trusted: bool = False
    damaged: bool = False
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] | None = None
    metadata: list[MetadataIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)

    @property
    def tells_topics(self) -> bool:
        """Whether the summary contains topics, types and counts, which are optional."""
        return self.trusted and self.counts is not None and self.knows(self.counts)

    def knows(self, channels: Iterable[int]) -> bool:
        """Whether the summary defines all given channels and their schemas."""
        found = [self.channels.get(channel) for channel in channels]
        schemas = {0, *self.schemas}
        return all(one is not None and one.schema_id in schemas for one in found)


def read_summary(stream: BinaryIO, size: int) -> FileSummary | None:
    """Reads the summary of a file, or returns None if the file is unfinished or truncated.

    Args:
        stream: the file.
        size: its length [bytes].

    Returns:
        The summary, empty where it is damaged or has no checksum; None: the file has no end, it
        is cut off or was never finished.
    """
    if size < len(MAGIC) + END:
        return None
    stream.seek(size - END)
    end = stream.read(END)
    opcode, length, start, _, crc = _FOOTER.unpack_from(end)
    if end[_FOOTER.size :] != MAGIC or opcode != Opcode.FOOTER or length != _FOOTER.size - 9:
        return None
    summary = FileSummary(start)
    if not start or not crc:
        return summary
    summary.damaged = True
    if not len(MAGIC) <= start <= size - END:
        return summary
    # The index of the chunks grows with the file: it is read through, and not kept.
    actual = 0
    stream.seek(start)
    left = size - END - start
    while left:
        part = stream.read(min(left, _SLICE))
        if not part:
            return summary
        actual, left = zlib.crc32(part, actual), left - len(part)
    if zlib.crc32(end[: _FOOTER.size - 4], actual) != crc:
        return summary
    return _records(stream, start, size - END) or summary


def _records(stream: BinaryIO, start: int, end: int) -> FileSummary | None:
    """Reads the summary's records, or returns None if they are not contiguous."""
    summary = FileSummary(start, trusted=True)
    try:
        for count, record in enumerate(summary_records(stream, start, end, _TAKEN)):
            if count == MOST_TAKEN:
                return None
            _take(summary, record)
    except DamageError:
        return None
    return summary


def summary_records(
    stream: BinaryIO, start: int, end: int, kinds: Mapping[int, Any]
) -> Iterator[Any]:
    """Yields the summary's records of the given types.

    Args:
        stream: the file.
        start, end: of the summary in it.
        kinds: mcap's types by opcode; other records are passed over.

    Raises:
        DamageError: the records do not follow each other up to the end.
    """
    position = start
    while position < end:
        stream.seek(position)
        header = stream.read(RECORD_HEADER)
        if len(header) < RECORD_HEADER:
            raise DamageError("a summary that is cut off")
        opcode, length = _HEADER.unpack(header)
        position += RECORD_HEADER + length
        if position > end:
            raise DamageError("a record beyond the summary's end")
        if opcode in kinds:
            yield parse(kinds[opcode], stream.read(length))


_TAKEN = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.STATISTICS: Statistics,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
}


def _take(
    summary: FileSummary,
    record: Schema | Channel | Statistics | MetadataIndex | AttachmentIndex,
) -> None:
    if isinstance(record, Schema):
        summary.schemas[record.id] = record
    elif isinstance(record, Channel):
        summary.channels[record.id] = record
    elif isinstance(record, Statistics):
        counts = record.channel_message_counts
        summary.counts = {channel: count for channel, count in counts.items() if count}
    elif isinstance(record, MetadataIndex):
        summary.metadata.append(record)
    else:
        summary.attachments.append(record)
