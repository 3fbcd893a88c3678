"""Storage backends for bags of other programs: MCAP, rosbag2's SQLite and folders."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Collection, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import zstandard
from mcap.records import Channel, Schema
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    Qos,
)
from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.metadata import ReaderMetadata, parse_qos
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_facts import DERIVED
from slosh_bag.mcap_files.bag_folder import LONGEST_METADATA, METADATA
from slosh_bag.mcap_files.mcap_summary import FileSummary, read_summary
from slosh_bag.reader import BagReader
from slosh_bag.unpacking import UnpackingError, unpack
from slosh_base.files.errors import TextFileError, YamlError
from slosh_base.files.yaml_document import read_yaml

_NO_SCHEMA = "__schemaless__"  # rosbags' name of a type that the file does not tell
ROS1 = "ros1"
"""Encoding of ROS 1's messages in an MCAP file, as `mcap convert` writes them."""
_MOST_NAMED = 5
_LOGS = ("-wal", "-journal")
_FORMATS = {
    "ros1msg": MessageDefinitionFormat.MSG,
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}


class McapStorage:
    """Reads an MCAP file through the storage interface of rosbags.

    Attributes:
        connections: its topics.
        metadata: facts about the file; rosbags finds none here, either.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Connection] = []
        self.metadata = ReaderMetadata(0, 2**63 - 1, 0, 0, None, None, None, None)
        self._reader: BagReader
        self._beside: list[str] = []

    def open(self) -> None:
        """Reads the file's topics; reads the whole file if its summary lacks them.

        Raises:
            SloshBagError: the file is damaged, or would take too much memory.
        """
        self._reader = BagReader(self.path)
        found = self._reader.survey(self.path)
        with self.path.open("rb") as stream:
            summary = read_summary(stream, self.path.stat().st_size)
        if summary is None:
            raise SloshBagError("is cut off; `slosh recover` writes a complete bag of the rest")
        self._beside = _left_out(summary)
        for number, channel in found.channels.items():
            schema = found.schemas.get(channel.schema_id)
            self.connections.append(self._connection(channel, schema, found.counts.get(number, 0)))

    @property
    def warnings(self) -> list[str]:
        """Warnings about what could not be read from the file or is left out."""
        return [*self._reader.warnings, *self._beside]

    def close(self) -> None:
        """Clears the list of the file's topics."""
        self.connections.clear()

    def messages(
        self,
        connections: Collection[Connection],
        start: int | None = None,
        stop: int | None = None,
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yields the messages of the given connections in the order of their log times [ns]."""
        wanted = {each.id: each for each in connections}
        found = self._reader.channel_messages({each.topic for each in connections})
        for number, message in found:
            if number in wanted:
                yield wanted[number], message.log_ns, message.data

    def _connection(self, channel: Channel, schema: Schema | None, count: int) -> Connection:
        plain = MessageDefinition(MessageDefinitionFormat.NONE, "")
        form = _FORMATS.get(schema.encoding) if schema else None
        ext: Any = ConnectionExtRosbag2(
            channel.message_encoding, _qos(channel.metadata.get("offered_qos_profiles", ""))
        )
        if channel.message_encoding == ROS1:
            ext = ConnectionExtRosbag1(channel.metadata.get("callerid"), _latched(channel))
        return Connection(
            channel.id,
            channel.topic,
            _ros2_name(schema.name) if schema else _NO_SCHEMA,
            MessageDefinition(form, schema.data.decode()) if schema and form else plain,
            "",
            count,
            ext,
            self,
        )


class FolderStorage:
    """Reads a rosbag2 folder with metadata.yaml through the storage interface of rosbags.

    Files, topics and messages count as they are: what metadata.yaml says of the storage, and of
    what publishers offered, decides nothing but that.

    Attributes:
        connections: its topics.
        metadata: facts about the bag.
        warnings: what is odd, one line each.
        beside: files of messages that metadata.yaml does not name.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Connection] = []
        self.metadata = ReaderMetadata(0, 2**63 - 1, 0, 0, None, None, None, None)
        self.storages: list[Any] = []
        self.warnings: list[str] = []
        self.beside: list[str] = []
        self._own: list[dict[int, int]] = []  # by file: connection here by connection there
        self._count = 0
        self._packed = False
        self._stack = ExitStack()

    def open(self) -> None:
        """Opens all files of the folder.

        Raises:
            SloshBagError: metadata.yaml tells no files, or one is missing.
        """
        noted = bag_information(self.path)
        try:
            names = [Path(str(name)).name for name in noted["relative_file_paths"]]
            topics = list(noted.get("topics_with_message_count") or [])
            mode = str(noted.get("compression_mode") or "").lower()
            custom = noted.get("custom_data") or None
        except (LookupError, TypeError, AttributeError) as error:
            raise SloshBagError(
                f"metadata.yaml is not from rosbag2: {error!r} is missing"
            ) from None
        missing = [name for name in names if not (self.path / name).exists()]
        if missing:
            raise SloshBagError(f"files that metadata.yaml lists are missing: {missing}")
        self.beside = sorted(
            file.name for suffix in (".mcap", ".db3", ".db3.zstd", ".mcap.zstd")
            for file in self.path.glob(f"*{suffix}") if file.name not in names
        )  # fmt: skip
        self._packed = mode == "message"
        for file in self._files(names, unpack_files=mode == "file"):
            storage = _by_suffix(file)
            storage.open()
            self._stack.callback(storage.close)
            self.storages.append(storage)
        self.metadata = self.metadata._replace(custom=custom)
        self.connections = list(self._topics(topics))

    def close(self) -> None:
        """Closes all files of the folder."""
        self.connections.clear()
        self._stack.close()

    def messages(
        self,
        connections: Collection[Connection],
        start: int | None = None,
        stop: int | None = None,
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yields the messages of the given connections, file by file."""
        wanted = {each.id: each for each in connections}
        for storage, own in zip(self.storages, self._own, strict=True):
            mine = [each for each in storage.connections if own[each.id] in wanted]
            if not mine:
                continue
            for connection, stamp_ns, data in storage.messages(mine, start, stop):
                known = wanted[own[connection.id]]
                yield known, stamp_ns, _message(data) if self._packed else data

    def _files(self, names: list[str], *, unpack_files: bool) -> Iterator[Path]:
        if not unpack_files:
            yield from (self.path / name for name in names)
            return
        room = Path(self._stack.enter_context(TemporaryDirectory()))
        for name in names:
            target = room / Path(name).stem
            with (self.path / name).open("rb") as packed, target.open("wb") as raw:
                zstandard.ZstdDecompressor().copy_stream(packed, raw)
            yield target

    def _topics(self, noted: list[Any]) -> Iterator[Connection]:
        """Yields the files' topics with the counts and QoS profiles of metadata.yaml."""
        counts: dict[tuple[str, str], int] = {}
        profiles: dict[tuple[str, str], list[Qos]] = {}
        for entry in noted:
            try:
                topic = entry["topic_metadata"]
                key = str(topic["name"]), str(topic["type"])
                counts[key] = counts.get(key, 0) + int(entry["message_count"])
                profiles[key] = _qos(topic.get("offered_qos_profiles"))
            except (LookupError, TypeError, ValueError, AttributeError):
                self.warnings.append("metadata.yaml: a topic in it cannot be read")
        found: dict[tuple[str, str], list[Connection]] = {}
        for storage in self.storages:
            self._own.append({})
            for each in storage.connections:
                alike = found.setdefault((each.topic, each.msgtype), [])
                self._own[-1][each.id] = self._merge(each, alike)
        for key, alike in found.items():
            lacking = max(0, counts.get(key, 0) - sum(each.msgcount for each in alike))
            for each in alike:
                ext = each.ext
                if isinstance(ext, ConnectionExtRosbag2) and profiles.get(key):
                    ext = ext._replace(offered_qos_profiles=profiles[key])
                yield each._replace(msgcount=each.msgcount + lacking, ext=ext, owner=self)
                lacking = 0
        for key, count in counts.items():
            if count and key not in found:
                self.warnings.append(
                    f"{key[0]}: metadata.yaml counts {count} messages, but there are none"
                )

    def _merge(self, one: Connection, alike: list[Connection]) -> int:
        """Adds a file's connection to those of its topic and type; returns its id in the folder.

        Connections with one definition become one; each other definition has its own.
        """
        for place, known in enumerate(alike):
            if known.msgdef == one.msgdef or not (known.msgdef.data and one.msgdef.data):
                fuller = known if known.msgdef.data else one
                count = known.msgcount + one.msgcount
                alike[place] = fuller._replace(id=known.id, msgcount=count)
                return int(known.id)
        self._count += 1
        alike.append(one._replace(id=self._count))
        return self._count


class SqliteStorage(Sqlite3Reader):
    """Reads an SQLite file together with its write-ahead log.

    The recorder that was killed leaves messages in a file `…-wal` that are not in the `.db3` yet.

    Attributes:
        warnings: what a reader should know.
    """

    path: Path

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.warnings: list[str] = []
        self._room: TemporaryDirectory[str] | None = None

    def open(self) -> None:
        """Opens the SQLite file, or a temporary copy if it has a write-ahead log."""
        logs = [Path(f"{self.path}{end}") for end in _LOGS]
        logs = [log for log in logs if log.is_file() and log.stat().st_size]
        if logs:
            self._room = TemporaryDirectory()
            copy = Path(self._room.name) / self.path.name
            for file in (self.path, *logs):
                shutil.copyfile(file, copy.with_name(file.name))
            with closing(sqlite3.connect(copy)) as base:  # takes the log in
                base.execute("PRAGMA journal_mode=DELETE").fetchall()
            self.warnings.append(f"data in {', '.join(log.name for log in logs)} are included")
            self.path = copy
        super().open()

    def close(self) -> None:
        """Closes the SQLite file and deletes the temporary copy."""
        super().close()
        if self._room is not None:
            self._room.cleanup()


def _left_out(summary: FileSummary) -> list[str]:
    """Describes attachments and metadata of a file, which an import does not take."""
    kinds = {
        "attachment": [index.name for index in summary.attachments],
        "metadata record": [index.name for index in summary.metadata if index.name not in DERIVED],
    }
    return [
        f"{len(names)} {kind}{'s' * (len(names) > 1)} left out "
        f"({', '.join(names[:_MOST_NAMED])}); `slosh recover` keeps all"
        for kind, names in kinds.items()
        if names
    ]


def _by_suffix(path: Path) -> Any:
    """Returns the storage reader for a file's suffix.

    Raises:
        SloshBagError: its name tells no kind.
    """
    if path.suffix not in (".mcap", ".db3"):
        raise SloshBagError(f"{path.name} is neither .mcap nor .db3")
    return McapStorage(path) if path.suffix == ".mcap" else SqliteStorage(path)


def bag_information(folder: Path) -> Any:
    """Reads the description of files and topics in a bag's metadata.yaml.

    Raises:
        SloshBagError: it cannot be read.
    """
    try:
        document = read_yaml(folder / METADATA, LONGEST_METADATA).value
        return document["rosbag2_bagfile_information"]
    except (TextFileError, YamlError) as error:
        reason = str(error).removeprefix(f"{folder}/")
        raise SloshBagError(f"Could not load YAML: {reason}") from None
    except (LookupError, TypeError):
        raise SloshBagError("metadata.yaml is not from rosbag2") from None


def _qos(noted: Any) -> list[Qos]:
    """Parses QoS profiles; returns an empty list if they cannot be parsed."""
    try:
        return list(parse_qos(noted or []))
    except (ReaderError, LookupError, TypeError, ValueError, AttributeError):
        return []


def _ros2_name(message_type: str) -> str:
    """Converts a ROS 1 type name such as 'std_msgs/Header' to 'std_msgs/msg/Header'."""
    package, slash, name = message_type.partition("/")
    return f"{package}/msg/{name}" if slash and "/" not in name else message_type


def _latched(channel: Channel) -> int:
    return int(channel.metadata.get("latching", "") in ("1", "true"))


def _message(stored: bytes) -> bytes:
    try:
        return unpack("zstd", stored)
    except UnpackingError as error:
        raise SloshBagError(f"a message {error}") from None
