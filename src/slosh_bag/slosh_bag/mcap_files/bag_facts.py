"""Metadata of a whole bag, which its recorder stores in each file.

No checksum of MCAP covers a metadata record but that of the whole data section, for which the file
has to be read from its start to its end. A record that carries its own is read at once.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import Metadata, MetadataIndex

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.checksum import CHECKSUM, checksum_of
from slosh_bag.mcap_files.chunks import RECORD_HEADER, DamageError, parse
from slosh_bag.mcap_files.mcap_summary import MAGIC, read_summary
from slosh_bag.mcap_files.mcap_walk import McapWalk
from slosh_bag.mcap_files.record_stream import RecordStream

NAME = "slosh"
DERIVED = (NAME, "rosbag2")
"""Metadata records that a new bag gets anew: own facts, and rosbag2's copy of metadata.yaml."""
_HEADER = struct.Struct("<BQ")


def read_facts(path: Path) -> tuple[dict[str, str], list[str]]:
    """Returns the bag metadata in a file, and warnings about it.

    Raises:
        SloshBagError: they are damaged.
    """
    with path.open("rb") as stream:
        summary = read_summary(stream, path.stat().st_size)
        if summary is not None and summary.trusted:
            places = [index for index in summary.metadata if index.name == NAME]
            records = [_at(path, stream, place) for place in places]
            whole = all(CHECKSUM in record for record in records) or _is_whole(path, summary.start)
            return _opened(path, records), [] if whole else [_without_checksum(path)]
    walk = McapWalk(path)
    for _ in walk.chunks():
        pass
    records = [record.metadata for record in walk.found.metadata if record.name == NAME]
    # Nothing but a checksum of its own can vouch for a record in a file without its end.
    checked = [record for record in records if CHECKSUM in record]
    lost = [] if len(checked) == len(records) else [f"{path}: facts without checksums left out"]
    return _opened(path, checked), walk.warnings + lost


def _at(path: Path, stream: BinaryIO, place: MetadataIndex) -> dict[str, str]:
    """Reads the metadata record at a position that the file's summary gives."""
    stream.seek(place.offset)
    content = stream.read(place.length)
    try:
        if content[:RECORD_HEADER] != _HEADER.pack(
            Opcode.METADATA, max(0, place.length - RECORD_HEADER)
        ):
            raise DamageError("no metadata record")
        record = parse(Metadata, content[RECORD_HEADER:])
        if record.name != NAME:
            raise DamageError("a metadata record of another name")
    except DamageError as error:
        raise SloshBagError(f"{path}: damaged at byte {place.offset}: {error}") from None
    return dict(record.metadata)


def _opened(path: Path, records: list[dict[str, str]]) -> dict[str, str]:
    facts: dict[str, str] = {}
    for record in records:
        noted = record.pop(CHECKSUM, None)
        if noted is not None and noted != checksum_of(record):
            raise SloshBagError(
                f"{path}: damaged metadata: the checksum of {list(record)} is wrong"
            )
        facts.update(record)
    return facts


def _is_whole(path: Path, summary_start: int) -> bool:
    """Verifies the checksum of a file's data section; False if the file has no checksum.

    Raises:
        SloshBagError: it is wrong.
    """
    with path.open("rb") as file:
        stream = RecordStream(file, summary_start)
        try:
            noted = _data_checksum(stream)
        except DamageError:
            noted = None
    if noted not in (0, stream.crc):
        raise SloshBagError(f"{path}: damaged metadata: the checksum (CRC) of all data is wrong")
    return noted != 0


def _data_checksum(stream: RecordStream) -> int:
    """Reads the checksum stored at the end of the data, to compare with the computed one.

    Raises:
        DamageError: the data have no end.
    """
    stream.skip(len(MAGIC))
    while True:
        opcode, length = stream.begin()
        if opcode == Opcode.DATA_END and length == stream.left:
            return int.from_bytes(stream.take(4), "little")
        stream.skip(length)


def _without_checksum(path: Path) -> str:
    return f"{path}: facts about the bag without checksums: damage would not be noticed"
