"""Readers of foreign bags, as rosbags has them, that unpack no more than is let in.

rosbags unpacks whatever a file holds. ROS 1's chunks and packed messages of rosbag2 are unpacked
here within a bound; MCAP files are read by the reader of our own, which has its bounds.
"""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from collections.abc import Callable, Collection, Iterator
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
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag1.reader import Chunk, IndexData, decompressors
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2.errors import ReaderError
from rosbags.rosbag2.metadata import ReaderMetadata, parse_qos
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_folder import LONGEST_METADATA, METADATA
from slosh_bag.mcap_files.file_kind import foreign_kind
from slosh_bag.mcap_files.mcap_summary import read_summary
from slosh_bag.reader import BagReader
from slosh_bag.unpacking import UnpackingError, unpack
from slosh_files.errors import TextFileError, YamlError
from slosh_files.yaml_document import read_yaml

ROS1_SUFFIX = ".bag"
_ROS1_MAGIC = b"#ROSBAG V"
MOST_FILE, MOST_RATIO = 1_000_000_000, 50
"""What a file packed as a whole may be unpacked: so many bytes, or times its size."""
_SLICE = 1 << 20
_NO_SCHEMA = "__schemaless__"  # rosbags' name of a type that the file does not tell
ROS1 = "ros1"
"""Encoding of ROS 1's messages in an MCAP file, as `mcap convert` writes them."""
_KINDS = {ROS1_SUFFIX: "ROS 1 bag", ".db3": "SQLite file", ".mcap": "MCAP file"}
_LOGS = ("-wal", "-journal")
_FORMATS = {
    "ros1msg": MessageDefinitionFormat.MSG,
    "ros2msg": MessageDefinitionFormat.MSG,
    "ros2idl": MessageDefinitionFormat.IDL,
    "omgidl": MessageDefinitionFormat.IDL,
}


def foreign_reader(source: Path) -> Any:
    """A reader of a foreign bag, not yet open.

    Args:
        source: a `.bag`, `.db3` or `.mcap` file, or a rosbag2 folder.

    Raises:
        SloshBagError: it is packed and would be too large, or is no ROS 1 bag by its first bytes.
        Exception: what the library raises on a file that is no bag.
    """
    if source.is_dir():
        _check_folder(source)
    else:
        _check_kind(source)
    return (_Ros1 if source.suffix == ROS1_SUFFIX else _Ros2)(source)


def _check_kind(source: Path) -> None:
    """Refuses a file that is not what its name says."""
    with source.open("rb") as file:
        is_ros1 = file.read(len(_ROS1_MAGIC)) == _ROS1_MAGIC
    if source.suffix == ROS1_SUFFIX and is_ros1:
        return
    kind = foreign_kind(source)
    if kind is not None and not (source.suffix == ".db3" and "SQLite" in kind[0]):
        raise SloshBagError(f"{source}: is no {_KINDS[source.suffix]}: it is {kind[0]}; {kind[1]}")
    if source.suffix == ROS1_SUFFIX:
        raise SloshBagError(
            f"{source}: is no ROS 1 bag: it does not begin with {_ROS1_MAGIC.decode()}"
        )


def not_read(reader: Any) -> list[str]:
    """Files beside a bag that its metadata.yaml does not name."""
    return list(getattr(getattr(reader, "storage", None), "beside", []))


def told_by(reader: Any) -> list[str]:
    """What the user should know of the files that a reader has read."""
    storage = getattr(reader, "storage", None)
    files = getattr(storage, "storages", [])
    return [text for each in (storage, *files) for text in getattr(each, "warnings", [])]


class _Ros1(Ros1Reader):
    """Of a ROS 1 bag."""

    _left = 0

    def open(self) -> None:
        """Reads the index."""
        self._left = self.path.stat().st_size  # all indexes together lie in the file
        super().open()

    def read_chunk(self) -> Chunk:
        """Where a chunk is, and how it is unpacked: in bounds."""
        chunk = super().read_chunk()
        for name in ("bz2", "lz4"):
            if chunk.decompressor is decompressors[name]:
                return chunk._replace(decompressor=_unpacker(name))
        return chunk

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Reads one of a chunk's indexes; many chunks must not share one."""
        assert self.bio is not None
        start = self.bio.tell()
        super().read_index_data(pos, indexes)
        self._left -= self.bio.tell() - start
        if self._left < 0:
            raise SloshBagError("chunks share their indexes")


class _Mcap:
    """Of an MCAP file, as rosbags' own reader is to be used.

    Attributes:
        connections: its topics.
        metadata: facts about the file; rosbags finds none here, either.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.connections: list[Connection] = []
        self.metadata = ReaderMetadata(0, 2**63 - 1, 0, 0, None, None, None, None)
        self._reader: BagReader

    def open(self) -> None:
        """Reads the topics; to its end where the file's end does not tell them.

        Raises:
            SloshBagError: the file is damaged, or would take too much memory.
        """
        self._reader = BagReader(self.path)
        found = self._reader.survey(self.path)
        with self.path.open("rb") as stream:
            if read_summary(stream, self.path.stat().st_size) is None:
                raise SloshBagError("is cut off; `slosh recover` makes a whole bag of the rest")
        for number, channel in found.channels.items():
            schema = found.schemas.get(channel.schema_id)
            self.connections.append(self._connection(channel, schema, found.counts.get(number, 0)))

    @property
    def warnings(self) -> list[str]:
        """What a reader of the messages should know."""
        return self._reader.warnings

    def close(self) -> None:
        """Forgets the topics."""
        self.connections.clear()

    def messages(
        self,
        connections: Collection[Connection],
        start: int | None = None,
        stop: int | None = None,
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """The messages of some topics in the order of their log times [ns]."""
        by_name = {(each.topic, each.msgtype): each for each in connections}
        for message in self._reader.messages({each.topic for each in connections}):
            kind = _ros2_name(message.message_type) or _NO_SCHEMA
            connection = by_name.get((message.topic, kind))
            if connection is not None:
                yield connection, message.log_ns, message.data

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


class _Folder:
    """Of a rosbag2 folder, by its metadata.yaml; as rosbags' own reader is to be used.

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
        self._packed = False
        self._stack = ExitStack()

    def open(self) -> None:
        """Opens the files of the folder.

        Raises:
            SloshBagError: metadata.yaml tells no files, or one is missing.
        """
        noted = _information(self.path)
        try:
            names = [Path(str(name)).name for name in noted["relative_file_paths"]]
            topics = list(noted.get("topics_with_message_count") or [])
            mode = str(noted.get("compression_mode") or "").lower()
            custom = noted.get("custom_data") or None
        except (LookupError, TypeError, AttributeError) as error:
            raise SloshBagError(f"metadata.yaml is none of rosbag2: {error!r} is missing") from None
        missing = [name for name in names if not (self.path / name).exists()]
        if missing:
            raise SloshBagError(f"files are missing that metadata.yaml names: {missing}")
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
        """Closes the files."""
        self.connections.clear()
        self._stack.close()

    def messages(
        self,
        connections: Collection[Connection],
        start: int | None = None,
        stop: int | None = None,
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """The messages of some topics, file by file."""
        wanted = {(each.topic, each.msgtype): each for each in connections}
        for storage in self.storages:
            mine = [each for each in storage.connections if (each.topic, each.msgtype) in wanted]
            if not mine:
                continue
            for connection, stamp_ns, data in storage.messages(mine, start, stop):
                known = wanted[connection.topic, connection.msgtype]
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
        """The topics that the files hold, with the counts and the QoS of metadata.yaml."""
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
        found: dict[tuple[str, str], Connection] = {}
        held: Counter[tuple[str, str]] = Counter()
        for storage in self.storages:
            for each in storage.connections:
                key = each.topic, each.msgtype
                held[key] += each.msgcount
                before = found.get(key)
                if before is None or not before.msgdef.data:
                    found[key] = each
        for number, (key, each) in enumerate(found.items(), start=1):
            ext = each.ext
            if isinstance(ext, ConnectionExtRosbag2) and profiles.get(key):
                ext = ext._replace(offered_qos_profiles=profiles[key])
            count = max(counts.get(key, 0), held[key])
            yield each._replace(id=number, msgcount=count, ext=ext, owner=self)
        for key, count in counts.items():
            if count and key not in found:
                self.warnings.append(f"{key[0]}: metadata.yaml counts {count} messages, none is there")


class _Sqlite(Sqlite3Reader):
    """Of an SQLite file, with what SQLite's log beside it holds.

    The recorder that was killed leaves messages in a file `…-wal` that are not in the `.db3` yet.

    Attributes:
        warnings: what a reader should know.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.warnings: list[str] = []
        self._room: TemporaryDirectory[str] | None = None

    def open(self) -> None:
        """Opens the file, or a copy of it with its log."""
        logs = [Path(f"{self.path}{end}") for end in _LOGS]
        logs = [log for log in logs if log.is_file() and log.stat().st_size]
        if logs:
            self._room = TemporaryDirectory()
            copy = Path(self._room.name) / self.path.name
            for file in (self.path, *logs):
                shutil.copyfile(file, copy.with_name(file.name))
            with closing(sqlite3.connect(copy)) as base:  # takes the log in
                base.execute("PRAGMA journal_mode=DELETE").fetchall()
            self.warnings.append(f"what {', '.join(log.name for log in logs)} holds is taken in")
            self.path = copy
        super().open()

    def close(self) -> None:
        """Closes the file and removes the copy."""
        super().close()
        if self._room is not None:
            self._room.cleanup()


def _by_suffix(path: Path) -> Any:
    """The reader of a file: what metadata.yaml says may be empty, as `ros2 bag reindex` leaves it.

    Raises:
        SloshBagError: its name tells no kind.
    """
    if path.suffix not in (".mcap", ".db3"):
        raise SloshBagError(f"{path.name} is neither .mcap nor .db3")
    return _Mcap(path) if path.suffix == ".mcap" else _Sqlite(path)


def _information(folder: Path) -> Any:
    """What metadata.yaml holds.

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
        raise SloshBagError("metadata.yaml is none of rosbag2") from None


def _qos(noted: Any) -> list[Qos]:
    """Profiles, as far as they can be read: none decides whether messages are read."""
    try:
        return parse_qos(noted or [])
    except (ReaderError, LookupError, TypeError, ValueError, AttributeError):
        return []


class _Ros2(Ros2Reader):
    """Of a rosbag2 folder or file."""

    STORAGE_PLUGINS = {"dir": _Folder, ".mcap": _Mcap, ".db3": _Sqlite}  # noqa: RUF012


def _ros2_name(message_type: str) -> str:
    """A type's name as ROS 2 has it: ROS 1's 'std_msgs/Header' is 'std_msgs/msg/Header'."""
    package, slash, name = message_type.partition("/")
    return f"{package}/msg/{name}" if slash and "/" not in name else message_type


def _latched(channel: Channel) -> int:
    return int(channel.metadata.get("latching", "") in ("1", "true"))


def _unpacker(compression: str) -> Callable[[bytes], bytes]:
    def unpacked(stored: bytes) -> bytes:
        try:
            return unpack(compression, stored)
        except UnpackingError as error:
            raise SloshBagError(f"a chunk {error}") from None

    return unpacked


def _message(stored: bytes) -> bytes:
    try:
        return unpack("zstd", stored)
    except UnpackingError as error:
        raise SloshBagError(f"a message {error}") from None


def _check_folder(folder: Path) -> None:
    """Bounds what is read of a folder before any message is: YAML, packed files.

    Raises:
        SloshBagError: metadata.yaml stands for too much, or a file would be too large when it is
            unpacked.
        OSError: a file cannot be read.
    """
    noted = _information(folder)
    try:
        names = noted["relative_file_paths"] if noted["compression_mode"].lower() == "file" else []
    except (LookupError, TypeError, AttributeError):
        return  # `_Folder.open` says what is wrong
    for file in [folder / Path(str(name)).name for name in names]:
        most = max(MOST_FILE, MOST_RATIO * file.stat().st_size)
        size = 0
        with file.open("rb") as stream, zstandard.ZstdDecompressor().stream_reader(stream) as raw:
            while size <= most and (part := raw.read(_SLICE)):
                size += len(part)
        if size > most:
            raise SloshBagError(f"{file.name} unpacks to more than {most} bytes; unpack it first")
