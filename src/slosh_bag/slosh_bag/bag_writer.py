"""Writes a bag: MCAP files and the metadata.yaml that rosbag2 needs."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import AttachmentIndex, Metadata

from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_metadata import SERIALIZATION, FileFacts, Qos, TopicFacts, save
from slosh_bag.mcap_files.mcap_file import SMALL, McapFile

__all__ = ["NEVER", "SERIALIZATION", "BagWriter", "Qos", "Split"]

PROFILE = "ros2"
_HASH = "topic_type_hash"


@dataclass(frozen=True, slots=True)
class Split:
    """Maximum size and duration of one file of a bag; zero means no limit.

    Attributes:
        size: a file that has become as large as this is followed by the next one [bytes].
        duration: log time that a file covers at most [ns].
    """

    size: int = 0
    duration: int = 0


NEVER = Split()


Schema = tuple[str, bytes]
"""Encoding and content of a type's MCAP schema."""


@dataclass(slots=True)
class _Channel:
    schema: Schema | None  # None: of the definitions here
    metadata: Mapping[str, str]
    number: int = 0  # in the present file


@dataclass(slots=True)
class _Topic:
    message_type: str
    qos: Qos
    encoding: str
    channels: list[_Channel] = field(default_factory=list)

    def sum_of(self, counts: Mapping[int, int]) -> int:
        """Returns the number of the topic's messages, of counts by channel."""
        return sum(counts.get(channel.number, 0) for channel in self.channels)


class BagWriter:
    """Writes a bag: MCAP files and metadata.yaml; use it as a context manager.

    The folder DIR gets DIR/<name of DIR>_0.mcap, ..._1.mcap and so on, each complete in itself,
    and DIR/metadata.yaml, which is up to date whenever a file begins or ends.

    Args:
        folder: the bag's folder; it must not hold a bag already.
        definitions: where message definitions come from.
        custom: facts about the whole bag, kept in metadata.yaml and in each MCAP file.
        split: when the next file begins.
        level: level of zstd.
        profile: of the files, as their header tells it.

    Raises:
        SloshBagError: the folder holds files, or cannot be made.
    """

    def __init__(
        self,
        folder: Path,
        definitions: Definitions | None = None,
        custom: Mapping[str, str] | None = None,
        split: Split = NEVER,
        level: int = SMALL,
        profile: str = PROFILE,
    ) -> None:
        self.folder = folder
        self._profile = profile
        self._definitions = definitions or Definitions()
        self._custom = dict(custom or {})
        self._split = split
        self._level = level
        self._topics: dict[str, _Topic] = {}
        self._counts: dict[str, int] = {}
        self._schemas: dict[tuple[str, Schema | None], int] = {}  # in the present file
        self._ended: list[FileFacts] = []
        self._unfinished: list[McapFile] = []
        self._has_news = False
        self._kept: list[Metadata] = []
        self._file: McapFile | None = None
        self._began_ns: int | None = None
        self._noted = 0  # topics in metadata.yaml
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise SloshBagError(f"{folder}: exists already; choose another folder or remove it")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.resume()
        except OSError as error:
            raise SloshBagError(f"{folder}: {error.strerror}") from None

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def path(self) -> Path:
        """Path of the bag's newest file."""
        if self._file is not None:
            return self._file.path
        return self.folder / self._ended[-1].name if self._ended else self.folder

    @property
    def files(self) -> int:
        """Number of files in the bag."""
        return len(self._ended) + (self._file is not None)

    @property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic, including those not yet written to a file."""
        return self._counts.copy()  # in one step: another thread may ask

    @property
    def pending(self) -> int:
        """Number of messages that are not yet written to a file."""
        return self._file.pending if self._file else 0

    @property
    def size(self) -> int:
        """Total size of the bag's files on disk [bytes]."""
        return sum(file.size for file in self._ended) + (self._file.size if self._file else 0)

    def add_topic(
        self,
        name: str,
        message_type: str,
        qos: Qos | None = None,
        *,
        encoding: str = SERIALIZATION,
        metadata: Mapping[str, str] | None = None,
        schema: Schema | None = None,
    ) -> int:
        """Registers a topic, with its type and QoS, before its first message.

        Args:
            name: of the topic.
            message_type: e.g. 'slosh_msgs/msg/FreeSurface'; empty: its messages have none.
            qos: what its publishers offer.
            encoding: of its messages.
            metadata: what else its channels carry.
            schema: of the type, as another bag holds it; each that differs gets a channel of its
                own. None: that of the definitions here.

        Returns:
            number of the schema among the topic's, which `write` takes.

        Raises:
            SloshBagError: the type has no definition here, or the topic another type.
        """
        topic = self._topics.get(name)
        if topic is None:
            if schema is None:
                self._definitions.schema(message_type)  # refused before anything is noted
            topic = self._topics[name] = _Topic(message_type, qos or Qos(), encoding)
            self._counts[name] = 0
        elif topic.message_type != message_type:
            raise SloshBagError(f"{name}: is {topic.message_type}, not {message_type}")
        known = [channel.schema for channel in topic.channels]
        if schema in known:
            return known.index(schema)
        channel = _Channel(schema, dict(metadata or {}))
        topic.channels.append(channel)
        if self._file is not None:
            self._register(self._file, name, topic, channel)
        return len(known)

    def note(self, name: str, value: str) -> None:
        """Stores a key and value in the bag's metadata, for all files finished later."""
        self._custom[name] = value
        self._has_news = True

    def keep(self, record: Metadata) -> None:
        """Stores another program's metadata record, once, in all files finished later."""
        if record not in self._kept:
            self._kept.append(record)
            self._has_news = True

    def attach(self, index: AttachmentIndex, content: Iterable[bytes]) -> None:
        """Copies another file's attachment to the present file; see `McapFile.attach`.

        Raises:
            OSError: the system refuses to write.
        """
        (self._file or self.resume()).attach(index, content)

    def forget_deleted(self) -> int:
        """Removes deleted files from the bag's records; later messages go to a new file.

        Returns:
            messages that were in them and do not count any more; 0: all files are there.
        """
        lost = 0
        if self._file is not None and not self._file.path.exists():
            file, self._file = self._file, None
            for name, topic in self._topics.items():
                gone = topic.sum_of(file.counts) + topic.sum_of(file.waiting)
                self._counts[name] -= gone
                lost += gone
            file.close()
        for facts in [one for one in self._ended if not (self.folder / one.name).exists()]:
            self._ended.remove(facts)
            lost += facts.count
        if lost:
            self.folder.mkdir(parents=True, exist_ok=True)
        return lost

    def write(
        self,
        topic: str,
        data: bytes,
        log_ns: int,
        publish_ns: int | None = None,
        sequence: int | None = None,
        schema: int = 0,
    ) -> None:
        """Appends a serialised message to the bag.

        Args:
            topic: a topic that was added.
            data: CDR bytes, written as they are.
            log_ns: when it was received [ns].
            publish_ns: when it was sent [ns]; None: as log_ns.
            sequence: its number; None: it is counted.
            schema: number that `add_topic` returned.

        Raises:
            OSError: the system refuses to write: `abandon` the file.
        """
        file = self._file
        if file is None or self._is_full(file, log_ns):
            self._end()
            file = self.resume()
        if self._began_ns is None:
            self._began_ns = log_ns
        number = self._counts[topic]
        sent_ns = log_ns if publish_ns is None else publish_ns
        noted = number if sequence is None else sequence
        file.add(self._topics[topic].channels[schema].number, noted, log_ns, sent_ns, data)
        self._counts[topic] = number + 1
        if file.full:
            file.flush()

    def flush(self) -> None:
        """Ends the current chunk and passes all data to the operating system.

        A process that is killed afterwards loses nothing of them.

        Raises:
            OSError: the system refuses to write: `abandon` the file.
        """
        if self._file is not None:
            self._file.flush()
            if self._noted != len(self._topics):
                self._save()

    def abandon(self) -> int:
        """Ends the file after a write error, without the messages of its unfinished chunk.

        What was written before is there; messages of the last chunk are not and do not count.

        Returns:
            their number.
        """
        file, self._file = self._file, None
        if file is None:
            return 0
        lost = file.discard()
        for name, topic in self._topics.items():
            self._counts[name] -= topic.sum_of(lost)
        if file.count:
            self._ended.append(_facts(file))
            self._unfinished.append(file)
        else:
            with contextlib.suppress(OSError):
                file.remove()
        with contextlib.suppress(OSError):
            self._finish_all()
            self._save()
        return sum(lost.values())

    def resume(self) -> McapFile:
        """Continues the bag in a new file after a write error.

        Raises:
            OSError: that is not possible yet.
        """
        with contextlib.suppress(OSError):
            self._finish_all()
        name = f"{self.folder.resolve().name}_{len(self._ended)}.mcap"
        file = McapFile(self.folder / name, self._profile, self._level)
        self._schemas.clear()
        for own, topic in self._topics.items():
            for channel in topic.channels:
                self._register(file, own, topic, channel)
        self._file, self._began_ns = file, None
        self._save()
        return file

    def close(self) -> None:
        """Finishes the bag's last file and writes metadata.yaml.

        Raises:
            OSError: the system refuses to write: `abandon` the file.
        """
        if self._has_news and self._file is None:
            self.resume()  # all files have ended, or are gone: one that holds what was noted since
        if self._file is not None or self._unfinished:
            self._end()
            self._finish_all()
            self._save()

    def _end(self) -> None:
        if self._file is not None:
            self._file.finish(self._custom, self._kept)
            self._ended.append(_facts(self._file))
            self._file = None

    def _is_full(self, file: McapFile, log_ns: int) -> bool:
        split = self._split
        if self._began_ns is None:
            return False
        return bool(
            (split.size and file.size >= split.size)
            or (split.duration and log_ns - self._began_ns >= split.duration)
        )

    def _finish_all(self) -> None:
        """Finishes the files that were abandoned after a write error."""
        while self._unfinished:
            file = self._unfinished[0]
            file.finish(self._custom, self._kept)
            del self._unfinished[0]

    def _register(self, file: McapFile, name: str, topic: _Topic, channel: _Channel) -> None:
        """Registers a topic's channel in a file; each file lists all and can be read alone."""
        kind, own = topic.message_type, channel.schema
        if (kind, own) not in self._schemas:
            content = own or self._definitions.schema(kind)
            number = file.add_schema(kind, content[1], content[0]) if content else 0
            self._schemas[kind, own] = number
        told = channel.metadata.get(_HASH) if own else ""
        metadata = {
            **channel.metadata,
            "offered_qos_profiles": topic.qos.text(),
            _HASH: told or self._definitions.hash(kind),
        }
        channel.number = file.add_channel(name, self._schemas[kind, own], metadata, topic.encoding)

    def _save(self) -> None:
        topics = [
            TopicFacts(
                name,
                topic.message_type,
                self._definitions.hash(topic.message_type),
                topic.qos,
                self._counts[name],
                topic.encoding,
            )
            for name, topic in self._topics.items()
        ]
        present = [_facts(self._file)] if self._file else []
        save(self.folder, topics, [*self._ended, *present], self._custom)
        self._noted = len(topics)


def _facts(file: McapFile) -> FileFacts:
    return FileFacts(file.path.name, *file.span, file.count, file.size)
