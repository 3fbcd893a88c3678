"""Results of reading an MCAP file: definitions, counts, times and unreadable bytes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from mcap.records import AttachmentIndex, Channel, Metadata, Schema

from slosh_bag.mcap_files.chunk_scan import MOST_DEFINITIONS
from slosh_bag.mcap_files.chunks import Chunk

MOST_DEFINED = 50_000_000
"""Schemas and channels of a file, at most [bytes]."""


@dataclass(frozen=True, slots=True)
class UnreadBytes:
    """A range of bytes in a file that could not be read.

    Attributes:
        start, end: where they are in the file.
        reason: what is wrong with them.
        span_ns: log times of the messages in them, where a chunk's header says so [ns].
    """

    start: int
    end: int
    reason: str
    span_ns: tuple[int, int] | None = None


@dataclass(slots=True)
class Found:
    """Contents found so far in an MCAP file: types, topics, counts and times.

    Attributes:
        schemas, channels: by their ids.
        counts: messages by channel id.
        first_ns, last_ns: least and greatest log time; None: there is no message.
        metadata: the metadata records.
        attachments: intact ones; `offset` is where their content begins in the file, `length`
            that of the content before its checksum [bytes].
        chunks, loose: numbers of chunks, and of messages in none.
        unchecked: some messages, or their definitions, had no checksum of their own.
        unknown: records of an unknown kind, which were passed over.
        gaps: what could not be read.
        orphans: messages left out since the definition of their channel is lost.
        definitions, defined: number of definitions that were counted, and bytes of those kept.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    first_ns: int | None = None
    last_ns: int | None = None
    metadata: list[Metadata] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    chunks: int = 0
    loose: int = 0
    unchecked: bool = False
    unknown: int = 0
    gaps: list[UnreadBytes] = field(default_factory=list)
    orphans: int = 0
    definitions: int = 0
    defined: int = 0

    def has_room(self, definitions: Sequence[Schema | Channel], *, kept: bool) -> bool:
        """Counts schema and channel definitions; returns False if there are too many.

        Args:
            definitions: the next ones.
            kept: whether they stay in memory, so that their lengths count.
        """
        self.definitions += len(definitions)
        self.defined += sum(map(_length, definitions)) if kept else 0
        return self.definitions <= MOST_DEFINITIONS and self.defined <= MOST_DEFINED

    def add(self, chunk: Chunk) -> None:
        """Counts the messages of a chunk and updates the time range."""
        if not len(chunk):
            return
        counts = np.bincount(chunk.channel)
        for channel in np.flatnonzero(counts).tolist():
            self.counts[channel] = self.counts.get(channel, 0) + int(counts[channel])
        first, last = int(chunk.log_ns[0]), int(chunk.log_ns[-1])
        self.first_ns = first if self.first_ns is None else min(first, self.first_ns)
        self.last_ns = last if self.last_ns is None else max(last, self.last_ns)
        self.unchecked |= not chunk.checked

    def is_defined(self, channel: int) -> bool:
        """Whether a channel, and its schema if it has one, are defined."""
        known = self.channels.get(channel)
        return known is not None and (not known.schema_id or known.schema_id in self.schemas)


def _length(record: Schema | Channel) -> int:
    if isinstance(record, Schema):
        return len(record.data) + len(record.name)
    return len(record.topic) + sum(len(key) + len(text) for key, text in record.metadata.items())
