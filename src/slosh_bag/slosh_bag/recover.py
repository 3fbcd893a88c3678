"""Recovers the intact messages of an unfinished or damaged bag."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from mcap.records import Channel, Header, Schema
from mcap.stream_reader import StreamReader

from slosh_bag.bag_writer import PROFILE, BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_facts import DERIVED
from slosh_bag.mcap_files.bag_facts import NAME as FACTS
from slosh_bag.mcap_files.bag_folder import bag_folder, check_no_other, folder_facts, ordered_files
from slosh_bag.mcap_files.bag_metadata import Qos
from slosh_bag.mcap_files.bag_types import BagTypes
from slosh_bag.mcap_files.checksum import CHECKSUM, checksum_of
from slosh_bag.mcap_files.chunks import Chunk, sequence_of
from slosh_bag.mcap_files.mcap_walk import McapWalk
from slosh_bag.reader import DAMAGE
from slosh_base.files import check_outside, new_folder
from slosh_base.files.errors import YamlError
from slosh_base.files.yaml_document import parse_yaml

Progress = Callable[[int], object]
_PART = 1 << 20


@dataclass(frozen=True, slots=True)
class Recovery:
    """Result of a recovery: number of recovered messages and of bytes left out.

    Attributes:
        bag: the new bag.
        counts: messages by topic.
        notes: what could not be recovered, one line each; empty: the bag was whole.
    """

    bag: Path
    counts: dict[str, int]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class NotedQos(Qos):
    """Publishers' QoS as stored in the damaged bag, unchanged.

    Attributes:
        noted: the text in the channel.
    """

    noted: str = ""

    def documents(self) -> list[dict[str, Any]]:
        """Returns the stored profiles as mappings; empty if they cannot be parsed."""
        try:
            documents = parse_yaml(self.noted, "QoS profiles").value
        except YamlError:
            documents = None
        whole = isinstance(documents, list) and all(isinstance(item, dict) for item in documents)
        return documents if whole else []

    def text(self) -> str:
        """Returns the stored text of the QoS profiles unchanged."""
        return self.noted


class NotedDefinitions(Definitions):
    """Message definitions and hashes as stored in a bag, independent of installed packages.

    Args:
        types: of the bag; None: they are noted as they are found.
    """

    def __init__(self, types: BagTypes | None = None) -> None:
        super().__init__()
        self.types = types or BagTypes()
        self._hashes: dict[str, str] = {}

    def note_hash(self, message_type: str, channel: Channel) -> None:
        """Stores the type hash that a channel's metadata contains, for the message type."""
        self._hashes.setdefault(message_type, channel.metadata.get("topic_type_hash", ""))

    def schema(self, message_type: str) -> tuple[str, bytes] | None:
        """Returns a message type's schema as stored in the bag, whatever its language.

        Raises:
            SloshBagError: it has none, or several that differ.
        """
        if not message_type:
            return None
        schema = self.types.schema(message_type)
        return schema.encoding, schema.data

    def hash(self, message_type: str) -> str:
        """Returns the type hash stored in the bag, or else the hash of the definition.

        It is empty for a type with several definitions: each channel knows its own.
        """
        if self.types.is_ambiguous(message_type):
            return ""
        if not self._hashes.get(message_type):
            try:
                store = self.types.typestore(message_type)
                self._hashes[message_type] = str(store.hash_rihs01(message_type))
            except DAMAGE:
                return ""
        return self._hashes[message_type]


def recover_bag(path: Path, folder: Path, progress: Progress = lambda size: None) -> Recovery:
    """Writes a new bag with all intact chunks of an unfinished or damaged bag.

    Definitions, QoS profiles and facts are those of the bag itself.

    Args:
        path: the bag's folder, or one MCAP file.
        folder: the new bag's folder; it must be new or empty.
        progress: is told how many bytes were read since it was told last.

    Raises:
        SloshBagError: nothing in the bag can be read.
        SloshFileError: the folder holds something, or lies in the bag.
        OSError: the new bag cannot be written.
    """
    files, notes = ordered_files(path, damaged=True)
    path = bag_folder(path)
    if len(files) == 1:
        check_no_other(files[0])
        if not files[0].stat().st_size:
            raise SloshBagError(f"{files[0]}: the file is empty; copy it again")
    check_outside(folder, [path])
    with new_folder(folder) as room:
        copy = _Copy(room, _facts(path, files, notes), notes, _profile(files[0]))
        with copy.writer as writer:
            for file in files:
                copy.add(file, progress)
            counts = dict(writer.counts)
            if not sum(counts.values()):
                reason = "".join(f"; {note}" for note in copy.notes[:1])
                raise SloshBagError(f"{path}: no message in it can be read{reason}")
    return Recovery(folder, counts, tuple(dict.fromkeys(copy.notes)))


def _facts(path: Path, files: list[Path], notes: list[str]) -> dict[str, str]:
    """Returns the bag metadata from intact records, or else from metadata.yaml."""
    facts: dict[str, str] = {}
    for file in files:
        walk = McapWalk(file, lenient=True)
        for _ in walk.chunks():
            pass
        for record in walk.found.metadata:
            noted = dict(record.metadata)
            if record.name == FACTS and noted.pop(CHECKSUM, None) == checksum_of(noted):
                facts.update(noted)
    if not facts:
        facts = folder_facts(path)
        if facts:
            notes.append(f"{path}: facts about the bag taken from metadata.yaml, unchecked")
    return facts


def _profile(file: Path) -> str:
    """Returns the MCAP profile name in a file's header, or that of ROS 2 if it is unreadable."""
    try:
        with file.open("rb") as stream:
            reader = StreamReader(stream, skip_magic=False, emit_chunks=True)
            first = next(iter(reader.records))
            return first.profile if isinstance(first, Header) else PROFILE
    except (*DAMAGE, StopIteration):
        return PROFILE


def _parts(stream: BinaryIO, start: int, length: int) -> Iterator[bytes]:
    """Yields the bytes of a part of a file."""
    stream.seek(start)
    while length:
        part = stream.read(min(length, _PART))
        if not part:
            raise OSError(None, "the file has become shorter", stream.name)
        length -= len(part)
        yield part


class _Target(NamedTuple):
    """Where the messages of a channel go: topic, and number of the definition among its own."""

    topic: str
    schema: int


@dataclass(slots=True)
class _Copy:
    """The recovered bag that is being written, and the losses found."""

    folder: Path
    facts: dict[str, str]
    notes: list[str]
    profile: str
    definitions: NotedDefinitions = field(default_factory=NotedDefinitions)
    writer: BagWriter = field(init=False)

    def __post_init__(self) -> None:
        self.writer = BagWriter(self.folder, self.definitions, self.facts, profile=self.profile)

    def add(self, file: Path, progress: Progress) -> None:
        """Copies the intact messages of a file to the recovered bag."""
        walk = McapWalk(file, lenient=True)
        topics: dict[int, _Target | None] = {}
        done = 0
        for chunk in walk.chunks():
            if not done:
                for schema in walk.found.schemas.values():  # those of the file's end, too
                    self.definitions.types.add(schema)
            for schema in chunk.schemas:
                self.definitions.types.add(walk.found.schemas[schema.id])
            for number in np.unique(chunk.channel).tolist():
                if number not in topics:
                    topics[number] = self.topic(file, walk, number)
            self.write(chunk, topics)
            progress(chunk.position + chunk.stored - done)
            done = chunk.position + chunk.stored
        progress(walk.size - done)
        self.keep(file, walk)
        self.tell(file, walk)

    def keep(self, file: Path, walk: McapWalk) -> None:
        """Copies attachments and metadata of other programs."""
        for record in walk.found.metadata:
            if record.name not in DERIVED:
                self.writer.keep(record)
        with file.open("rb") as stream:
            for index in walk.found.attachments:
                self.writer.attach(index, _parts(stream, index.offset, index.length + 4))

    def topic(self, file: Path, walk: McapWalk, number: int) -> _Target | None:
        """Registers the topic of a channel, with its own definition; None: it cannot be."""
        channel = walk.found.channels[number]
        topic: str = channel.topic
        schema: Schema | None = walk.found.schemas.get(channel.schema_id)
        kind = schema.name if schema else ""
        try:
            self.definitions.note_hash(kind, channel)
            qos = NotedQos(noted=channel.metadata.get("offered_qos_profiles", ""))
            metadata = dict(channel.metadata)
            own = (schema.encoding, schema.data) if schema else None
            target = self.writer.add_topic(
                topic, kind, qos, encoding=channel.message_encoding, metadata=metadata, schema=own
            )
        except SloshBagError as error:
            self.notes.append(f"{file}: {topic} left out: {error}")
            return None
        return _Target(topic, target)

    def write(self, chunk: Chunk, topics: dict[int, _Target | None]) -> None:
        """Copies the messages of a chunk to the recovered bag."""
        columns = chunk.channel, chunk.start, chunk.length, chunk.log_ns, chunk.publish_ns
        rows = zip(*(column.tolist() for column in columns), strict=True)
        for number, start, length, log_ns, publish_ns in rows:
            target = topics[number]
            if target is not None:
                data, sequence = chunk.raw[start : start + length], sequence_of(chunk, start)
                topic, schema = target
                self.writer.write(topic, data, log_ns, publish_ns, sequence, schema)

    def tell(self, file: Path, walk: McapWalk) -> None:
        """Adds notes about the messages that a file has lost."""
        found = walk.found
        for gap in found.gaps:
            span = ""
            if gap.span_ns:
                span = f", {gap.span_ns[0] * 1e-9:.3f} s to {gap.span_ns[1] * 1e-9:.3f} s"
            self.notes.append(
                f"{file}: bytes {gap.start} to {gap.end} left out{span}: {gap.reason}"
            )
        if found.unchecked:
            self.notes.append(f"{file}: messages without checksums: damage in them is not noticed")
        if found.unknown:
            self.notes.append(f"{file}: {found.unknown} records of an unknown kind left out")
        if found.orphans:
            self.notes.append(f"{file}: {found.orphans} messages left out: topics unknown")
        if walk.summary is None or walk.summary.counts is None:
            return
        for number, count in walk.summary.counts.items():
            there = found.counts.get(number, 0)
            if there != count and number in found.channels:
                topic = found.channels[number].topic
                self.notes.append(f"{file}: {there} of {count} messages of {topic} recovered")
