"""Writes one MCAP file that stays readable if writing is interrupted at any byte.

`mcap`'s own writer forgets what it has counted, and where, when a write fails: its file cannot be
finished any more. Here a write that fails leaves file and bookkeeping as they were before it.
Messages are put together without an object each, and compression has its level as a parameter:
both cost a recorder most of its time (benchmarks/bench_recorder.py). Records are those of `mcap`.
"""

from __future__ import annotations

import contextlib
import os
import struct
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

from slosh_bag.mcap_files.bag_metadata import SERIALIZATION
from slosh_bag.mcap_files.checksum import with_checksum

CHUNK_BYTES = 2**20
"""A chunk ends with the message that makes it as long as this, before compression [bytes]."""
FAST, SMALL = -1, 3
"""Levels of zstd: on numbers -1 is six times faster than 3 and its files are 5 % larger; on
images with noise or JPEG, which do not get smaller, it gives up forty times sooner."""
_WORTH = 0.97  # a chunk that does not get smaller than this is stored as it is
_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_HEADER = 22
_INDEX = struct.Struct("<BQHI")
_CHUNK = struct.Struct("<BQQQQII")
_U64 = struct.Struct("<Q")
_RECORD = struct.Struct("<BQ")
_CRC = 4


@dataclass(slots=True)
class _OpenChunk:
    """The chunk that is being filled: its records and the offsets of its messages."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0
    entries: dict[int, list[int]] = field(default_factory=dict)
    count: int = 0
    start_ns: int = 0
    end_ns: int = 0

    def append(self, *parts: bytes) -> None:
        self.parts += parts
        self.size += sum(map(len, parts))


class McapFile:
    """An MCAP file that is being written.

    `flush` and `finish` raise OSError where the system refuses to write. The file then ends where
    it ended before, the messages that are not in it are still pending, and they may be called
    again.

    Args:
        path: a file that does not exist yet.
        profile: the profile in its header.
        level: level of zstd.

    Raises:
        OSError: it cannot be made.
    """

    def __init__(self, path: Path, profile: str, level: int = SMALL) -> None:
        self.path = path
        self.size = 0
        self._compressor = zstandard.ZstdCompressor(level=level)
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunk = _OpenChunk()
        self._indexes: list[bytes] = []
        self._attachments: list[AttachmentIndex] = []
        self._counts: dict[int, int] = {}
        self._start_ns: int | None = None
        self._end_ns = 0
        self._crc = 0
        # Not for everybody's eyes: what a cell carries, and its images, may be a secret.
        self._stream = open(path, "xb", buffering=0, opener=_open_for_group)  # noqa: SIM115
        try:
            self._append(MCAP0_MAGIC + _record(Header(profile, "slosh_bag")))
        except OSError:
            self.remove()
            raise

    @property
    def count(self) -> int:
        """Number of messages written to the file."""
        return sum(self._counts.values())

    @property
    def pending(self) -> int:
        """Number of messages that are not yet written to the file."""
        return self._chunk.count

    @property
    def full(self) -> bool:
        """Whether the current chunk has reached its target size."""
        return self._chunk.size >= CHUNK_BYTES

    @property
    def span(self) -> tuple[int, int]:
        """First and last log time of the messages in the file [ns]; zeros if there are none."""
        return (0, 0) if self._start_ns is None else (self._start_ns, self._end_ns)

    def add_schema(self, name: str, data: bytes, encoding: str = "ros2msg") -> int:
        """Adds a message type and returns its schema id."""
        schema = Schema(id=len(self._schemas) + 1, name=name, encoding=encoding, data=data)
        self._schemas.append(schema)
        self._chunk.append(_record(schema))
        return len(self._schemas)

    def add_channel(
        self, topic: str, schema: int, metadata: dict[str, str], encoding: str = SERIALIZATION
    ) -> int:
        """Adds a topic and returns its channel id; schema 0 means messages without a type."""
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding=encoding,
            schema_id=schema,
            metadata=metadata,
        )
        self._channels.append(channel)
        self._chunk.append(_record(channel))
        return len(self._channels)

    def add(self, channel: int, sequence: int, log_ns: int, publish_ns: int, data: bytes) -> None:
        """Adds a message to the current chunk; call `flush` when the chunk is `full`."""
        chunk = self._chunk
        length = _MESSAGE_HEADER + len(data)
        head = _MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence, log_ns, publish_ns)
        if not chunk.count:
            chunk.start_ns = chunk.end_ns = log_ns
        elif log_ns > chunk.end_ns:
            chunk.end_ns = log_ns
        elif log_ns < chunk.start_ns:
            chunk.start_ns = log_ns
        entries = chunk.entries.get(channel)
        if entries is None:
            entries = chunk.entries[channel] = []
        entries += (log_ns, chunk.size)
        chunk.parts += (head, data)
        chunk.size += len(head) + len(data)
        chunk.count += 1

    def flush(self) -> None:
        """Passes all messages to the operating system, so that they survive a killed process.

        A chunk without messages is kept back: Jazzy's reader rejects a file that begins with one.
        """
        chunk = self._chunk
        if not chunk.count:
            return
        content = b"".join(chunk.parts)
        packed, compression = self._compressor.compress(content), "zstd"
        if len(packed) > _WORTH * len(content):
            packed, compression = content, ""
        name = compression.encode()
        length = _CHUNK.size - 9 + len(name) + 8 + len(packed)
        head = _CHUNK.pack(
            Opcode.CHUNK,
            length,
            chunk.start_ns,
            chunk.end_ns,
            len(content),
            zlib.crc32(content),
            len(name),
        )
        record = b"".join((head, name, _U64.pack(len(packed)), packed))
        start, position = self.size, self.size + len(record)
        offsets, indexes = dict[int, int](), list[bytes]()
        for channel, entries in chunk.entries.items():
            offsets[channel] = position
            indexes.append(_message_index(channel, entries))
            position += len(indexes[-1])
        self._append(b"".join((record, *indexes)))
        self._chunk = _OpenChunk()
        self._note(chunk)
        index = ChunkIndex(
            message_start_time=chunk.start_ns,
            message_end_time=chunk.end_ns,
            chunk_start_offset=start,
            chunk_length=len(record),
            message_index_offsets=offsets,
            message_index_length=position - start - len(record),
            compression=compression,
            compressed_size=len(packed),
            uncompressed_size=len(content),
        )
        # As bytes: a day's recording has millions, and they stay in memory until the file's end.
        self._indexes.append(_record(index))

    @property
    def counts(self) -> dict[int, int]:
        """Number of messages of each channel that were written to the file."""
        return self._counts.copy()

    @property
    def waiting(self) -> dict[int, int]:
        """Number of messages of each channel that are not yet written to the file."""
        return {channel: len(entries) // 2 for channel, entries in self._chunk.entries.items()}

    def discard(self) -> dict[int, int]:
        """Removes messages that are not yet written; returns their number for each channel."""
        counts = self.waiting
        self._chunk = _OpenChunk()
        return counts

    def attach(self, index: AttachmentIndex, content: Iterable[bytes]) -> None:
        """Copies an attachment of another file.

        Args:
            index: what is known of it; its place does not count.
            content: of its record, with the checksum, in parts.
        """
        self.flush()
        length = index.length + _CRC
        place = replace(index, offset=self.size, length=_RECORD.size + length)
        self._append(_RECORD.pack(Opcode.ATTACHMENT, length))
        for part in content:
            self._append(part)
        self._attachments.append(place)

    def finish(self, metadata: Mapping[str, str], others: Iterable[Metadata] = ()) -> None:
        """Writes the remaining messages, all metadata and the summary; closes the file.

        Args:
            metadata: of the bag.
            others: metadata records of other programs.
        """
        self.flush()
        own = [Metadata("slosh", with_checksum({k: text})) for k, text in metadata.items()]
        facts, where = RecordBuilder(), list[MetadataIndex]()
        for record in (*own, *others):
            start = facts.count
            record.write(facts)
            where.append(MetadataIndex(self.size + start, facts.count - start, record.name))
        body = facts.end()
        end = _record(DataEnd(zlib.crc32(body, self._crc)))
        self._append(body + end + self._summary(self.size + len(body) + len(end), where))
        self._stream.close()

    def close(self) -> None:
        """Closes the file without writing a summary."""
        self._stream.close()

    def remove(self) -> None:
        """Deletes the MCAP file."""
        self._stream.close()
        self.path.unlink(missing_ok=True)

    def _note(self, chunk: _OpenChunk) -> None:
        for channel, entries in chunk.entries.items():
            self._counts[channel] = self._counts.get(channel, 0) + len(entries) // 2
        if self._start_ns is None:
            self._start_ns, self._end_ns = chunk.start_ns, chunk.end_ns
        self._start_ns = min(self._start_ns, chunk.start_ns)
        self._end_ns = max(self._end_ns, chunk.end_ns)

    def _append(self, content: bytes) -> None:
        """Appends the bytes completely, or leaves the file unchanged if that fails."""
        left = memoryview(content)
        try:
            while left:
                left = left[self._stream.write(left) :]
        except OSError:
            with contextlib.suppress(OSError):
                self._stream.truncate(self.size)
                self._stream.seek(self.size)
            raise
        self._crc = zlib.crc32(content, self._crc)
        self.size += len(content)

    def _summary(self, start: int, metadata: list[MetadataIndex]) -> bytes:
        """Returns the bytes of the summary and footer for a summary that starts at `start`."""
        first, last = self.span
        statistics = Statistics(
            message_count=self.count,
            schema_count=len(self._schemas),
            channel_count=len(self._channels),
            attachment_count=len(self._attachments),
            metadata_count=len(metadata),
            chunk_count=len(self._indexes),
            message_start_time=first,
            message_end_time=last,
            channel_message_counts=self._counts,
        )
        groups = {
            Opcode.SCHEMA: [_record(schema) for schema in self._schemas],
            Opcode.CHANNEL: [_record(channel) for channel in self._channels],
            Opcode.STATISTICS: [_record(statistics)],
            Opcode.CHUNK_INDEX: self._indexes,
            Opcode.ATTACHMENT_INDEX: [_record(index) for index in self._attachments],
            Opcode.METADATA_INDEX: [_record(index) for index in metadata],
        }
        content, offsets = b"", b""
        for opcode, records in groups.items():
            group = b"".join(records)
            if group:
                offsets += _record(SummaryOffset(opcode, start + len(content), len(group)))
            content += group
        tail = start + len(content)
        crc = zlib.crc32(content + offsets + struct.pack("<BQQQ", Opcode.FOOTER, 20, start, tail))
        footer = Footer(summary_start=start, summary_offset_start=tail, summary_crc=crc)
        return b"".join((content, offsets, _record(footer), MCAP0_MAGIC))


def _open_for_group(path: str, flags: int) -> int:
    return os.open(path, flags, 0o640)


def _record(record: Any) -> bytes:
    """Encodes a record object of the mcap library as bytes."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())


def _message_index(channel: int, entries: list[int]) -> bytes:
    """Encodes a message index: log times and offsets of a channel's messages in a chunk."""
    length = 8 * len(entries)
    head = _INDEX.pack(Opcode.MESSAGE_INDEX, length + 6, channel, length)
    return head + struct.pack(f"<{len(entries)}Q", *entries)
