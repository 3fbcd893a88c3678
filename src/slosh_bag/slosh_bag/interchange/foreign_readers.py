"""Readers of foreign bags, as rosbags has them, that unpack no more than is let in.

rosbags unpacks whatever a file holds. ROS 1's chunks and packed messages of rosbag2 are unpacked
here within a bound; MCAP files are read by the reader of our own, which has its bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import zstandard
from mcap.records import Channel, Schema
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
)
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag1.reader import Chunk, IndexData, decompressors
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2.metadata import ReaderMetadata, parse_qos
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.bag_folder import LONGEST_METADATA
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
_FORMATS = {
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
    elif source.suffix == ROS1_SUFFIX:
        _check_ros1(source)
    return (_Ros1 if source.suffix == ROS1_SUFFIX else _Ros2)(source)


def _check_ros1(source: Path) -> None:
    with source.open("rb") as file:
        if file.read(len(_ROS1_MAGIC)) != _ROS1_MAGIC:
            raise SloshBagError(
                f"{source}: is no ROS 1 bag: it does not begin with {_ROS1_MAGIC.decode()}"
            )


def told_by(reader: Any) -> list[str]:
    """What the user should know of the files that a reader has read."""
    storage = getattr(reader, "storage", None)
    files = getattr(storage, "storages", [storage])
    return [text for file in files if isinstance(file, _Mcap) for text in file.warnings]


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
            connection = by_name.get((message.topic, message.message_type or _NO_SCHEMA))
            if connection is not None:
                yield connection, message.log_ns, message.data

    def _connection(self, channel: Channel, schema: Schema | None, count: int) -> Connection:
        plain = MessageDefinition(MessageDefinitionFormat.NONE, "")
        form = _FORMATS.get(schema.encoding) if schema else None
        return Connection(
            channel.id,
            channel.topic,
            schema.name if schema else _NO_SCHEMA,
            MessageDefinition(form, schema.data.decode()) if schema and form else plain,
            "",
            count,
            ConnectionExtRosbag2(
                channel.message_encoding,
                parse_qos(channel.metadata.get("offered_qos_profiles", "")),
            ),
            self,
        )


class _Folder(DirectoryReader):
    """Of a rosbag2 folder; unpacks the messages of one that has them packed."""

    STORAGE_PLUGINS = {"mcap": _Mcap, "sqlite3": Sqlite3Reader}  # noqa: RUF012
    metadata: ReaderMetadata

    def open(self) -> None:
        """Opens the files of the folder."""
        super().open()
        self._packed = self.metadata.compression_mode == "message"
        self.metadata = self.metadata._replace(compression_mode=None)

    def messages(
        self,
        connections: Collection[Connection],
        start: int | None = None,
        stop: int | None = None,
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """The messages of some topics, file by file."""
        for connection, stamp_ns, data in super().messages(connections, start, stop):
            yield connection, stamp_ns, _message(data) if self._packed else data


class _Ros2(Ros2Reader):
    """Of a rosbag2 folder or file."""

    STORAGE_PLUGINS = {"dir": _Folder, ".mcap": _Mcap, ".db3": Sqlite3Reader}  # noqa: RUF012


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
    """Bounds what rosbags reads of a folder before it looks at any message: YAML, packed files.

    Raises:
        SloshBagError: metadata.yaml stands for too much, or a file would be too large when it is
            unpacked.
        OSError: a file cannot be read.
    """
    metadata = folder / "metadata.yaml"
    try:
        noted = read_yaml(metadata, LONGEST_METADATA).value["rosbag2_bagfile_information"]
        names = noted["relative_file_paths"] if noted["compression_mode"].lower() == "file" else []
    except (TextFileError, YamlError) as error:
        reason = str(error).removeprefix(f"{folder}/")
        raise SloshBagError(f"Could not load YAML: {reason}") from None
    except (LookupError, TypeError, AttributeError):
        return  # rosbags says what is wrong
    for file in [folder / Path(str(name)).name for name in names]:
        most = max(MOST_FILE, MOST_RATIO * file.stat().st_size)
        size = 0
        with file.open("rb") as stream, zstandard.ZstdDecompressor().stream_reader(stream) as raw:
            while size <= most and (part := raw.read(_SLICE)):
                size += len(part)
        if size > most:
            raise SloshBagError(f"{file.name} unpacks to more than {most} bytes; unpack it first")
