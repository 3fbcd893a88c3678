"""Checks bytes after a record's known fields, which later MCAP versions may append.

Readers have to pass over them, in every record but messages and the footer, which never grow.
Yet a damaged opcode or length looks much the same: what hides a chunk is damage, not a new field.
"""

from __future__ import annotations

import struct

import numpy as np

from slosh_bag.mcap_files.chunk_scan import find_chunk
from slosh_bag.mcap_files.chunks import CHUNK_START, RECORD_HEADER, DamageError, whole_chunk

_INDEX = struct.Struct("<HI")
_TIMES, _U32, _U64, _CRC = 16, struct.Struct("<I"), struct.Struct("<Q"), 4
LONGEST_NAMES = 1 << 20
"""An attachment's name and media type, at most [bytes]."""


def check_no_chunk(content: bytes) -> None:
    """Raises an error if a record of another type has the content of a chunk.

    Args:
        content: of the record.

    Raises:
        DamageError: its opcode is damaged.
    """
    if _has_messages(content):
        raise DamageError("a chunk with the opcode of another record")


def check_appended(appended: bytes) -> None:
    """Raises an error if bytes after a record's fields contain a chunk.

    Raises:
        DamageError: the record's length is damaged, and swallows what follows it.
    """
    start = 0
    while (at := find_chunk(np.frombuffer(appended, np.uint8), start)) >= 0:
        (length,) = _U64.unpack_from(appended, at + 1)
        content = at + RECORD_HEADER
        if _has_messages(appended[content : content + length]):
            raise DamageError("a record whose damaged length takes in a chunk")
        start = at + 1


def _has_messages(content: bytes) -> bool:
    try:
        return len(content) > CHUNK_START and len(whole_chunk(0, content)) > 0
    except DamageError:
        return False


def check_message_index(content: bytes) -> None:
    """Raises an error if a message index exceeds its record, or if a chunk follows it there.

    Raises:
        DamageError: it does not fit.
    """
    if len(content) < _INDEX.size:
        raise DamageError("a damaged message index")
    end = _INDEX.size + _INDEX.unpack_from(content)[1]
    if end > len(content):
        raise DamageError("a damaged message index")
    check_appended(content[end:])


def attachment_size(start: bytes, length: int) -> int:
    """Returns the size of an attachment's fields before its checksum [bytes].

    Args:
        start: the record's content, or its first `LONGEST_NAMES`.
        length: of the whole content [bytes].

    Raises:
        DamageError: the fields do not fit into the record.
    """
    at = _TIMES
    try:
        for _ in ("name", "media type"):
            at += _U32.size + int(_U32.unpack_from(start, at)[0])
        at += _U64.size + int(_U64.unpack_from(start, at)[0])
    except struct.error:
        raise DamageError("a damaged attachment") from None
    if at + _CRC > length:
        raise DamageError("a damaged attachment")
    return at
