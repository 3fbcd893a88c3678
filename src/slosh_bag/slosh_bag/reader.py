"""Reads bags: finished ones, and what a killed recorder or a cut file leaves of one."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore
from zstandard import ZstdError

from slosh_bag.errors import SloshBagError

MAGIC = b"\x89MCAP0\r\n"
FOREIGN = (b"#ROSBAG", b"SQLite f")
"""How ROS 1 bags and rosbag2's SQLite files begin."""
IMPORT_HINT = "slosh import rosbag makes one of it"
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


class BagMessage(NamedTuple):
    """A message of a bag.

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
    """A topic of a bag: its type and, where the file is finished, its number of messages."""

    message_type: str
    count: int | None


class BagReader:
    """A bag: a folder with MCAP files, or one MCAP file.

    Args:
        path: folder or file.

    Raises:
        SloshBagError: there is no readable bag.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files = bag_files(path)
        self.warnings: list[str] = []
        self._typestore: Typestore = get_typestore(Stores.ROS2_JAZZY)
        self._known: set[str] = set()

    @property
    def typestore(self) -> Typestore:
        """The definitions by which messages are decoded: those of messages that were read."""
        return self._typestore

    def topics(self) -> dict[str, TopicInfo]:
        """The topics, with counts where every file is finished."""
        found: dict[str, TopicInfo] = {}
        for file in self.files:
            with file.open("rb") as stream:
                summary = _summary(stream)
            if summary is None:
                counted: dict[str, TopicInfo] = {}
                for message in self._stream(file, None):
                    before = counted.get(message.topic)
                    count = 1 + (before.count or 0 if before else 0)
                    counted[message.topic] = TopicInfo(message.message_type, count)
            else:
                counted = _counted(file, summary)
            for topic, info in counted.items():
                before = found.get(topic)
                total = (info.count or 0) + ((before.count or 0) if before else 0)
                found[topic] = TopicInfo(info.message_type, total)
        return found

    def metadata(self) -> dict[str, str]:
        """The facts about the whole bag that its writer noted."""
        facts: dict[str, str] = {}
        for file in self.files:
            with file.open("rb") as stream:
                if _summary(stream) is None:
                    continue
                stream.seek(0)
                try:
                    records = list(make_reader(stream).iter_metadata())
                except DAMAGE as error:
                    raise SloshBagError(f"{file}: damaged metadata: {_reason(error)}") from None
            for record in records:
                if record.name == "slosh":
                    facts.update(record.metadata)
        return facts

    def messages(self, topics: Collection[str] | None = None) -> Iterator[BagMessage]:
        """The messages in the order of their log times.

        An unfinished or cut file gives its whole chunks, and a line in `warnings`.

        Args:
            topics: only these; None: all.

        Raises:
            SloshBagError: a file is no MCAP file, or damaged in its middle.
        """
        for file in self.files:
            with file.open("rb") as stream:
                finished = _summary(stream) is not None
                if not finished:
                    yield from self._stream(file, topics)
                    continue
                stream.seek(0)
                yield from self._indexed(file, stream, topics)

    def decode(self, message: BagMessage) -> Any:
        """The message as an object with the fields of its type.

        Raises:
            SloshBagError: its bytes are not those of such a message.
        """
        try:
            return self._typestore.deserialize_cdr(message.data, message.message_type)
        except (*DAMAGE, AssertionError) as error:
            raise SloshBagError(
                f"{self.path}: {message.topic} at {message.log_ns} ns is no "
                f"{message.message_type}: {_reason(error)}"
            ) from None

    def _indexed(
        self, file: Path, stream: Any, topics: Collection[str] | None
    ) -> Iterator[BagMessage]:
        wanted = None if topics is None else list(topics)
        try:
            reader = make_reader(stream, validate_crcs=True)
            for schema, channel, record in reader.iter_messages(topics=wanted):
                if schema is not None:
                    self._learn(schema)
                    yield _message(schema, channel, record)
        except DAMAGE as error:
            raise SloshBagError(f"{file}: damaged: {_reason(error)}") from None

    def _stream(self, file: Path, topics: Collection[str] | None) -> Iterator[BagMessage]:
        """The whole chunks of an unfinished file."""
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        newest = 0
        with file.open("rb") as stream:
            try:
                for record in StreamReader(stream, validate_crcs=True).records:
                    if isinstance(record, Schema):
                        schemas[record.id] = record
                        self._learn(record)
                    elif isinstance(record, Channel):
                        channels[record.id] = record
                    elif isinstance(record, Message):
                        channel = channels[record.channel_id]
                        newest = max(newest, record.log_time)
                        if topics is None or channel.topic in topics:
                            yield _message(schemas[channel.schema_id], channel, record)
            except DAMAGE as error:
                reason = _reason(error)
            else:
                reason = "no footer"
        self.warnings.append(
            f"{file}: unfinished ({reason}); read up to {newest * 1e-9:.3f} s, the rest is lost"
        )

    def _learn(self, schema: Schema) -> None:
        """Takes the definition of a type from the bag itself."""
        if schema.name in self._known:
            return
        self._known.add(schema.name)
        if schema.name in self._typestore.fielddefs:
            return
        try:
            types = get_types_from_msg(schema.data.decode(), schema.name)
        except TypesysError:
            raise SloshBagError(f"the definition of {schema.name!r} cannot be read") from None
        missing = {
            name: spec for name, spec in types.items() if name not in self._typestore.fielddefs
        }
        self._typestore.register(missing)


def bag_files(path: Path) -> list[Path]:
    """The MCAP files of a bag, in the order of their names.

    Raises:
        SloshBagError: there are none, or one is not an MCAP file.
    """
    if path.is_dir():
        files = sorted(path.glob("*.mcap"))
        if not files:
            foreign = any(path.glob("*.db3*")) or any(path.glob("*.bag"))
            hint = f"; {IMPORT_HINT}" if foreign else ""
            raise SloshBagError(f"{path}: no .mcap file in this folder{hint}")
    elif path.is_file():
        files = [path]
    else:
        raise SloshBagError(f"{path}: no such file or folder")
    for file in files:
        with file.open("rb") as stream:
            start = stream.read(len(MAGIC))
        if not start:
            raise SloshBagError(f"{file}: empty file")
        if start != MAGIC:
            hint = f"; {IMPORT_HINT}" if start.startswith(FOREIGN) else ""
            raise SloshBagError(f"{file}: not an MCAP file{hint}")
    return files


def _summary(stream: Any) -> Any:
    """The file's summary; None where the file has no end."""
    try:
        return make_reader(stream).get_summary()
    except DAMAGE:
        return None


def _counted(file: Path, summary: Any) -> dict[str, TopicInfo]:
    """The topics of a finished file, from its summary."""
    counts = summary.statistics.channel_message_counts if summary.statistics else {}
    try:
        return {
            channel.topic: TopicInfo(
                summary.schemas[channel.schema_id].name, counts.get(channel.id, 0)
            )
            for channel in summary.channels.values()
        }
    except KeyError:
        raise SloshBagError(f"{file}: damaged: a channel without its schema") from None


def _message(schema: Schema, channel: Channel, record: Message) -> BagMessage:
    return BagMessage(
        channel.topic, schema.name, record.log_time, record.publish_time, record.data
    )


def _reason(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
