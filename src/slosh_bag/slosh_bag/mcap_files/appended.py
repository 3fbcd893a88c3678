"""Checks bytes after a record's known fields, which later MCAP versions may append.

Readers have to pass over them, in every record but messages and the footer, which never grow.
Yet a damaged opcode or length looks much the same: what hides a chunk is damage, not a new field.
"""

from __future__ import annotations

import struct

import numpy as np
from mcap.records import AttachmentIndex

from slosh_bag.mcap_files.chunk_scan import find_chunk
from slosh_bag.mcap_files.chunks import CHUNK_START, RECORD_HEADER, DamageError, whole_chunk

_INDEX = struct.Struct("<HI")
_TIMES, _U32, _U64, _CRC = 16, struct.Struct("<I"), struct.Struct("<Q"), 4
_BOTH = struct.Struct("<QQ")
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


def attachment_index(start: bytes, length: int) -> AttachmentIndex:
    """Parses an attachment's fields before its data.

    Args:
        start: the record's content, or its first `LONGEST_NAMES`.
        length: of the whole content [bytes].

    Returns:
        Its times, names and sizes; `length` is that of the fields before the checksum, the offset
        is 0.

    Raises:
        DamageError: the fields do not fit into the record.
    """
    at, texts = _TIMES, list[str]()
    try:
        log_ns, created_ns = _BOTH.unpack_from(start)
        for _ in ("name", "media type"):
            end = at + _U32.size + int(_U32.unpack_from(start, at)[0])
            texts.append(start[at + _U32.size : end].decode(errors="replace"))
            at = end
        size = int(_U64.unpack_from(start, at)[0])
    except struct.error:
        raise DamageError("a damaged attachment") from None
    at += _U64.size + size
    if at + _CRC > length:
        raise DamageError("a damaged attachment")
    return AttachmentIndex(
        offset=0, length=at, log_time=log_ns, create_time=created_ns, data_size=size,
        name=texts[0], media_type=texts[1],
    )  # fmt: skip
