"""Reads bags of other programs with rosbags, with limits on decompressed size.

rosbags unpacks whatever a file holds. ROS 1's chunks and packed messages of rosbag2 are unpacked
here within a bound; MCAP files are read by the reader of our own, which has its bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import zstandard
from rosbags.rosbag1 import Reader as Ros1Reader
from rosbags.rosbag1.reader import Chunk, IndexData, decompressors
from rosbags.rosbag2 import Reader as Ros2Reader

from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.foreign_storage import (
    FolderStorage,
    McapStorage,
    SqliteStorage,
    bag_information,
)
from slosh_bag.unpacking import UnpackingError, unpack
from slosh_base.files.file_kind import foreign_kind

ROS1_SUFFIX = ".bag"
_ROS1_MAGIC = b"#ROSBAG V"
MOST_FILE, MOST_RATIO = 1_000_000_000, 50
"""What a file packed as a whole may be unpacked: so many bytes, or times its size."""
_SLICE = 1 << 20
_KINDS = {ROS1_SUFFIX: "a ROS 1 bag", ".db3": "an SQLite file", ".mcap": "an MCAP file"}


def foreign_reader(source: Path) -> Any:
    """Creates a reader of another program's bag, without opening it.

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
    """Raises an error for a file whose content does not match its suffix."""
    with source.open("rb") as file:
        is_ros1 = file.read(len(_ROS1_MAGIC)) == _ROS1_MAGIC
    if source.suffix == ROS1_SUFFIX and is_ros1:
        return
    kind = foreign_kind(source)
    if kind is not None and not (source.suffix == ".db3" and "SQLite" in kind[0]):
        raise SloshBagError(
            f"{source}: is not {_KINDS[source.suffix]}: it is {kind[0]}; {kind[1]}"
        )
    if source.suffix == ROS1_SUFFIX:
        raise SloshBagError(
            f"{source}: is not a ROS 1 bag: it does not begin with {_ROS1_MAGIC.decode()}"
        )


def not_read(reader: Any) -> list[str]:
    """Returns the files in a bag's folder that its metadata.yaml does not list."""
    return list(getattr(getattr(reader, "storage", None), "beside", []))


def told_by(reader: Any) -> list[str]:
    """Returns the warnings of a bag reader about the files that it has read."""
    storage = getattr(reader, "storage", None)
    files = getattr(storage, "storages", [])
    return [text for each in (storage, *files) for text in getattr(each, "warnings", [])]


class _Ros1(Ros1Reader):
    """Reader of ROS 1 bags with limits on decompressed size."""

    _left = 0

    def open(self) -> None:
        """Opens the bag and reads its index."""
        self._left = self.path.stat().st_size  # all indexes together lie in the file
        super().open()

    def read_chunk(self) -> Chunk:
        """Reads a chunk's header and sets a decompressor with a size limit."""
        chunk = super().read_chunk()
        for name in ("bz2", "lz4"):
            if chunk.decompressor is decompressors[name]:
                return chunk._replace(decompressor=_unpacker(name))
        return chunk

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Reads one of a chunk's indexes; raises an error if many chunks share an index."""
        assert self.bio is not None
        start = self.bio.tell()
        super().read_index_data(pos, indexes)
        self._left -= self.bio.tell() - start
        if self._left < 0:
            raise SloshBagError("chunks share their indexes")


class _Ros2(Ros2Reader):
    """Reader of rosbag2 folders and files."""

    STORAGE_PLUGINS = {"dir": FolderStorage, ".mcap": McapStorage, ".db3": SqliteStorage}  # noqa: RUF012


def _unpacker(compression: str) -> Callable[[bytes], bytes]:
    def unpacked(stored: bytes) -> bytes:
        try:
            return unpack(compression, stored)
        except UnpackingError as error:
            raise SloshBagError(f"a chunk {error}") from None

    return unpacked


def _check_folder(folder: Path) -> None:
    """Limits the size of a bag folder's YAML and compressed files before they are read.

    Raises:
        SloshBagError: metadata.yaml stands for too much, or a file would be too large when it is
            unpacked.
        OSError: a file cannot be read.
    """
    noted = bag_information(folder)
    try:
        names = noted["relative_file_paths"] if noted["compression_mode"].lower() == "file" else []
    except (LookupError, TypeError, AttributeError):
        return  # `FolderStorage.open` says what is wrong
    for file in [folder / Path(str(name)).name for name in names]:
        most = max(MOST_FILE, MOST_RATIO * file.stat().st_size)
        size = 0
        with file.open("rb") as stream, zstandard.ZstdDecompressor().stream_reader(stream) as raw:
            while size <= most and (part := raw.read(_SLICE)):
                size += len(part)
        if size > most:
            raise SloshBagError(f"{file.name} unpacks to more than {most} bytes; unpack it first")
