"""Reads bags, including truncated ones and those of a killed recorder."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.exceptions import McapError
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore
from zstandard import ZstdError

from slosh_bag.columns.cdr_columns import ColumnReader
from slosh_bag.columns.cdr_values import decode_values, has_wide_text
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_facts import read_facts
from slosh_bag.mcap_files.bag_folder import bag_files, bag_folder, folder_facts, ordered_files
from slosh_bag.mcap_files.bag_types import BagTypes
from slosh_bag.mcap_files.chunks import Chunk, MessageBlock
from slosh_bag.mcap_files.found import Found
from slosh_bag.mcap_files.mcap_index import Index, Window, indexed_chunks, read_index
from slosh_bag.mcap_files.mcap_merge import ChunkSpan, gathered, in_log_order
from slosh_bag.mcap_files.mcap_summary import FileSummary, read_summary
from slosh_bag.mcap_files.mcap_walk import McapWalk, is_in_order
from slosh_bag.mcap_files.remote_path import bag_path
from slosh_bag.mcap_files.shared_file import shared_files
from slosh_base.files.nanoseconds import SECOND

__all__ = [
    "DAMAGE",
    "BagMessage",
    "BagReader",
    "TopicInfo",
    "bag_files",
    "messages_of",
    "stamp_ns",
]

# What the libraries raise on bytes that are not what was written.
DAMAGE = (
    McapError,
    SerdeError,
    TypesysError,
    ZstdError,
    struct.error,
    ValueError,
    LookupError,
    EOFError,
    OSError,
    OverflowError,
    MemoryError,
)

_BATCH = 10_000  # messages whose places are Python's numbers at a time


class BagMessage(NamedTuple):
    """A serialised message of a bag, with its topic, type and times.

    Attributes:
        topic: its topic.
        message_type: e.g. 'slosh_msgs/msg/FreeSurface'.
        log_ns, publish_ns: when it was received and sent [ns].
        data: CDR bytes.
    """

    topic: str
    message_type: str
    log_ns: int
    publish_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """Type and number of messages of a bag's topic."""

    message_type: str
    count: int | None


class BagReader:
    """Reader of a bag: a folder with MCAP files, or a single MCAP file.

    Every reading checks the files' checksums. A file without its end, as a killed recorder or a
    cut copy leaves it, gives what is whole; what was lost is told in `warnings` when it has been
    read to its end. A file that is damaged elsewhere is an error that tells where.

    >>> from slosh_bag import BagReader
    >>> reader = BagReader("bags/c3")
    >>> sum(1 for _ in reader.messages({"/slosh/free_surface"}))
    553

    Args:
        path: folder or file; a text may be a URL of fsspec, such as s3://bucket/bag.

    Attributes:
        path: as given, or the only bag in that folder.
        files: its MCAP files, in the order in which they were written.
        warnings: one line each.
        types: as the bag, so far as it was read, defines them.
        column_reader: reads blocks by the bag's own definitions.

    Raises:
        SloshBagError: there is no readable bag.
    """

    def __init__(self, path: str | Path) -> None:
        path = bag_path(path)
        self.warnings: list[str] = []
        files, odd = ordered_files(path)
        self.files = shared_files(files)
        self.path = bag_folder(path)
        self._warn(odd)
        self.types = BagTypes()
        self.column_reader = ColumnReader(self.types.typestore)
        self._in_order: dict[Path, bool] = {}

    @property
    def typestore(self) -> Typestore:
        """Type store with all message types decoded so far."""
        return self.types.learnt

    def typestore_of(self, message_type: str) -> Typestore:
        """Returns a type store with the bag's definition of a message type.

        Raises:
            SloshBagError: the bag, so far as it was read, has no such definition.
        """
        try:
            return self.types.typestore(message_type)
        except SloshBagError as error:
            raise SloshBagError(f"{self.path}: {error}") from None

    def columns(
        self, block: MessageBlock, names: Collection[str] | None = None
    ) -> dict[str, NDArray[Any]]:
        """Returns the values of a block of messages as NumPy columns.

        Raises:
            SloshBagError: a message is not of its type, or the type has no such field.
        """
        try:
            return self.column_reader.columns(block, names)
        except SloshBagError as error:
            raise SloshBagError(f"{self.path}: {error}") from None

    def topics(self) -> dict[str, TopicInfo]:
        """Returns the bag's topics with their types and message counts.

        Raises:
            SloshBagError: as `messages`.
        """
        found: dict[str, TopicInfo] = {}
        for file in self.files:
            known = self.survey(file)
            for number, channel in known.channels.items():
                kind = _type_of(known, number)
                before = found.get(channel.topic, TopicInfo(kind, 0))
                count = (before.count or 0) + known.counts.get(number, 0)
                found[channel.topic] = TopicInfo(before.message_type or kind, count)
        return found

    def metadata(self) -> dict[str, str]:
        """Returns the metadata of the whole bag that its recorder stored.

        Raises:
            SloshBagError: they are damaged.
        """
        facts: dict[str, str] = {}
        for file in self.files:
            noted, warnings = read_facts(file)
            facts.update(noted)
            self._warn(warnings)
        if not facts:
            facts = folder_facts(self.path)
            if facts:
                self._warn(
                    [f"{self.path}: facts about the bag taken from metadata.yaml, unchecked"]
                )
        return facts

    def blocks(self, topics: Collection[str] | None = None) -> Iterator[MessageBlock]:
        """Yields the messages in blocks, one per topic and chunk, in file order.

        Much faster than `messages`. In memory is one chunk at a time. A file whose chunks overlap
        in time or follow each other in another order is read in the order of the log times, in
        parts that take the place of chunks.

        Args:
            topics: only these; None: all.

        Raises:
            SloshBagError: as `messages`.
        """
        for file in self.files:
            yield from self._blocks_of(file, topics)

    def look_up(
        self, topics: Collection[str], windows: Collection[Window] | None = None
    ) -> Iterator[MessageBlock]:
        """Yields blocks as `blocks` does, but is fast for rare topics or short time windows.

        By a file's index only the chunks that hold them are read. A file without an index that
        can be believed is read to its end.

        Args:
            topics: whose messages.
            windows: log times [ns]; of the messages at least those within come. None: all come.

        Raises:
            SloshBagError: as `messages`.
        """
        for file in self.files:
            index = read_index(file) if self._is_in_order(file) else None
            if index is None:
                yield from self._blocks_of(file, topics)
            else:
                yield from self._indexed(file, index, topics, windows)

    def _indexed(
        self, file: Path, index: Index, topics: Collection[str], windows: Collection[Window] | None
    ) -> Iterator[MessageBlock]:
        known = self._told(index.summary)
        wanted = list(_names(known, topics))
        missing = sum(known.counts.get(channel, 0) for channel in wanted)
        for chunk in indexed_chunks(file, index, wanted, windows):
            for block in _blocks(known, chunk, topics):
                missing -= len(block)
                yield block
        if windows is None and missing:
            raise SloshBagError(
                f"{file}: its index lacks {missing} messages of {', '.join(topics)} that its "
                "summary counts; `slosh recover` writes a new bag with a new index"
            )

    def _blocks_of(self, file: Path, topics: Collection[str] | None) -> Iterator[MessageBlock]:
        walk = McapWalk(file)
        if self._is_in_order(file):
            for chunk in walk.chunks():
                self._learn(chunk)
                yield from _blocks(walk.found, chunk, topics)
        else:
            merged = self._merged_rows(walk, topics)
            while part := list(islice(merged, _BATCH)):
                yield from _blocks(walk.found, gathered(part), topics)
        self._warn(walk.warnings)

    def _is_in_order(self, file: Path) -> bool:
        if file not in self._in_order:
            self._in_order[file] = is_in_order(file)
        return self._in_order[file]

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """Yields the messages file by file, each file in the order of log times.

        An unfinished or cut file gives its whole chunks, and a line in `warnings`.

        Args:
            topics: only these; None: all.

        Raises:
            SloshBagError: a file is no MCAP file, or damaged in its middle.
        """
        return (message for _, message in self.channel_messages(topics))

    def channel_messages(
        self, topics: Collection[str] | None = None
    ) -> Iterator[tuple[int, BagMessage]]:
        """Yields the messages as `messages` does, each with the id of its channel in its file.

        An unfinished or cut file gives its whole chunks, and a line in `warnings`.

        Args:
            topics: only these; None: all.

        Raises:
            SloshBagError: a file is no MCAP file, or damaged in its middle.
        """
        newest = 0
        for file in self.files:
            walk = McapWalk(file)
            if self._is_in_order(file):
                for chunk in walk.chunks():
                    self._learn(chunk)
                    yield from _messages(walk.found, chunk, topics)
            else:
                yield from self._merged(walk, topics)
            self._warn(walk.warnings)
            first, last = walk.found.first_ns, walk.found.last_ns
            if first is not None and last is not None:
                if first < newest:
                    self._warn([f"{file}: begins before the end of the file before it"])
                newest = max(newest, last)

    def decode(self, message: BagMessage) -> Any:
        """Decodes a serialised message to an object with its type's fields.

        Raises:
            SloshBagError: its bytes are not those of such a message.
        """
        store = self.typestore_of(message.message_type)
        try:
            if has_wide_text(store, message.message_type):
                return decode_values(store, message.message_type, message.data)
            return store.deserialize_cdr(message.data, message.message_type)
        except (*DAMAGE, AssertionError) as error:
            raise SloshBagError(
                f"{self.path}: {message.topic} at {message.log_ns} ns is not a valid "
                f"{message.message_type}: {_reason(error)}"
            ) from None

    def survey(self, file: Path) -> Found:
        """Returns the contents of one file, from its summary if that is reliable.

        Raises:
            SloshBagError: as `messages`.
        """
        with file.open("rb") as stream:
            summary = read_summary(stream, file.stat().st_size)
        if summary is not None and summary.tells_topics:
            return self._told(summary)
        walk = McapWalk(file)
        for chunk in walk.chunks():
            self._learn(chunk)
        self._warn(walk.warnings)
        return walk.found

    def _merged(
        self, walk: McapWalk, topics: Collection[str] | None
    ) -> Iterator[tuple[int, BagMessage]]:
        """Yields the messages of an unsorted file in the order of log times."""
        names: dict[int, tuple[str, str]] = {}
        for chunk, row in self._merged_rows(walk, topics):
            names = names or _names(walk.found, topics)
            number = int(chunk.channel[row])
            topic, kind = names[number]
            start = int(chunk.start[row])
            data = chunk.raw[start : start + int(chunk.length[row])]
            times = int(chunk.log_ns[row]), int(chunk.publish_ns[row])
            yield number, BagMessage(topic, kind, *times, data)

    def _merged_rows(
        self, walk: McapWalk, topics: Collection[str] | None
    ) -> Iterator[tuple[Chunk, int]]:
        """Yields chunk and message index in the order of log times; reads the file twice."""
        spans = []
        for chunk in walk.chunks():
            self._learn(chunk)
            if len(chunk):
                spans.append(ChunkSpan(int(chunk.log_ns[0]), chunk.position, chunk.stored))
        names = list(_names(walk.found, topics))

        def select(chunk: Chunk) -> Chunk:
            return chunk.take(np.isin(chunk.channel, names))

        yield from in_log_order(walk.path, spans, select)

    def _told(self, summary: FileSummary) -> Found:
        """Returns the contents that a file's summary lists."""
        for schema in summary.schemas.values():
            self.types.add(schema)
        return Found(summary.schemas, summary.channels, summary.counts or {})

    def _learn(self, chunk: Chunk) -> None:
        for schema in chunk.schemas:
            self.types.add(schema)

    def _warn(self, warnings: Collection[str]) -> None:
        self.warnings += [text for text in warnings if text not in self.warnings]


def messages_of(block: MessageBlock) -> Iterator[BagMessage]:
    """Yields the messages of a block as BagMessage objects."""
    times = zip(block.log_ns.tolist(), block.publish_ns.tolist(), strict=True)
    for row, (log_ns, publish_ns) in enumerate(times):
        yield BagMessage(block.topic, block.message_type, log_ns, publish_ns, block.data(row))


def _type_of(found: Found, number: int) -> str:
    """Returns the message type of a channel; empty if it has no schema."""
    schema = found.schemas.get(found.channels[number].schema_id)
    return schema.name if schema else ""


def _names(found: Found, topics: Collection[str] | None) -> dict[int, tuple[str, str]]:
    """Returns topic and message type of each requested channel, by channel id."""
    return {
        number: (channel.topic, _type_of(found, number))
        for number, channel in found.channels.items()
        if topics is None or channel.topic in topics
    }


def stamp_ns(message: Any) -> int:
    """Returns the stamp in a decoded message's header [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def _blocks(found: Found, chunk: Chunk, topics: Collection[str] | None) -> Iterator[MessageBlock]:
    wanted: dict[tuple[str, str], list[int]] = {}
    for number, name in _names(found, topics).items():
        wanted.setdefault(name, []).append(number)
    for (topic, kind), numbers in wanted.items():
        rows = np.flatnonzero(
            chunk.channel == numbers[0] if len(numbers) == 1 else np.isin(chunk.channel, numbers)
        )
        if len(rows):
            part = chunk.take(rows)
            yield MessageBlock(
                topic, kind, part.log_ns, part.publish_ns, part.start, part.length, part.buffer
            )


def _messages(
    found: Found, chunk: Chunk, topics: Collection[str] | None
) -> Iterator[tuple[int, BagMessage]]:
    names, raw = _names(found, topics), chunk.raw
    columns = chunk.channel, chunk.log_ns, chunk.publish_ns, chunk.start, chunk.length
    for first in range(0, len(chunk), _BATCH):
        batch = (column[first : first + _BATCH].tolist() for column in columns)
        for number, log_ns, publish_ns, start, length in zip(*batch, strict=True):
            if number in names:
                topic, kind = names[number]
                data = raw[start : start + length]
                yield number, BagMessage(topic, kind, log_ns, publish_ns, data)


def _reason(error: BaseException) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
