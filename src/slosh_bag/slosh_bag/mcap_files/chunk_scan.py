"""Finds records in an MCAP buffer with compiled code that checks every length."""

from __future__ import annotations

import numpy as np
from numba.types import Tuple, boolean, int64, uint8

from slosh_base.compiled.compilation import compiled, entry_point, given

BYTES = given(uint8, 1)

# What a scan says of the bytes.
WHOLE, CUT, BAD_LENGTH, BAD_TIME, BAD_RECORD, OTHER, TOO_MANY = 0, 1, 2, 3, 4, 5, 6

MOST_MESSAGES = 1_000_000
"""In a chunk, at most: each takes 40 bytes beside those of the chunk, and more as it is read."""
MOST_DEFINITIONS = 20_000
"""Schemas and channels, at most."""


@compiled
def _u32(buffer, at):  # type: ignore[no-untyped-def]
    return (
        np.int64(buffer[at])
        | np.int64(buffer[at + 1]) << 8
        | np.int64(buffer[at + 2]) << 16
        | np.int64(buffer[at + 3]) << 24
    )


@compiled
def _u64(buffer, at):  # type: ignore[no-untyped-def]
    """Reads a uint64 as int64; values of 2⁶³ and more become negative."""
    return _u32(buffer, at) | _u32(buffer, at + 4) << 32


@compiled
def _state(buffer, at, opcode, length):  # type: ignore[no-untyped-def]
    """Checks the length and times of a record and returns its state."""
    if opcode == 5:
        if length < 22:
            return BAD_LENGTH
        if _u64(buffer, at + 15) < 0 or _u64(buffer, at + 23) < 0:
            return BAD_TIME
    elif opcode < 0x10 and opcode != 3 and opcode != 4:
        return BAD_RECORD
    return WHOLE


@compiled
def _survey(buffer, loose):  # type: ignore[no-untyped-def]
    """Counts the records in a buffer and checks each length against the buffer's end.

    Returns the numbers of messages and of definitions, where the walk ended, and how.
    """
    size, at, messages, others = len(buffer), 0, 0, 0
    while at < size:
        whole = size - at >= 9
        opcode, length = buffer[at], _u64(buffer, at + 1) if whole else 0
        if loose and (not 3 <= opcode <= 5 or (at and opcode != 5)):
            # A definition begins a run: where it is damaged, it must not cost messages before it.
            return messages, others, at, OTHER
        if not whole or length < 0 or length > size - at - 9:
            return messages, others, at, (WHOLE if loose else CUT)
        state = _state(buffer, at, opcode, length)
        if state != WHOLE:
            return messages, others, at, (OTHER if loose and at else state)
        messages += opcode == 5
        others += opcode == 3 or opcode == 4
        if messages > MOST_MESSAGES or others > MOST_DEFINITIONS:
            return 0, 0, 0, TOO_MANY
        at += 9 + length
    return messages, others, at, WHOLE


@entry_point(Tuple((int64[:, ::1], int64[:, ::1], int64, int64))(BYTES, boolean))
def scan(buffer, loose):  # type: ignore[no-untyped-def]
    """Finds the messages, schemas and channels in a buffer of records.

    Args:
        buffer: uint8 array of records, one after the other.
        loose: the buffer is a window of a file: end at a record of another kind, or at the last
            whole one.

    Returns:
        Channel, log time, publish time, start and length of each message's data, (5, N) int64;
        opcode, start and length of each definition's content, (3, M) int64; where the scan
        ended, and how: one of the states above.
    """
    count, others, end, state = _survey(buffer, loose)
    messages, definitions = np.empty((5, count), np.int64), np.empty((3, others), np.int64)
    at, row, other = 0, 0, 0
    while at < end:
        opcode, length = buffer[at], _u64(buffer, at + 1)
        if opcode == 5:
            messages[0, row] = np.int64(buffer[at + 9]) | np.int64(buffer[at + 10]) << 8
            messages[1, row] = _u64(buffer, at + 15)
            messages[2, row] = _u64(buffer, at + 23)
            messages[3, row] = at + 31
            messages[4, row] = length - 22
            row += 1
        elif opcode == 3 or opcode == 4:
            definitions[0, other] = opcode
            definitions[1, other] = at + 9
            definitions[2, other] = length
            other += 1
        at += 9 + length
    return messages, definitions, end, state


@entry_point(int64(BYTES, int64))
def find_chunk(buffer, start):  # type: ignore[no-untyped-def]
    """Returns the next position whose bytes look like a chunk's header, or -1.

    Args:
        buffer: uint8 array.
        start: where to begin.
    """
    for at in range(start, len(buffer) - 49 + 1):
        if buffer[at] != 6:
            continue
        name = _u32(buffer, at + 37)
        if name > 4 or at + 49 + name > len(buffer):
            continue
        stored = _u64(buffer, at + 41 + name)
        if 0 <= stored <= 2**31 and _u64(buffer, at + 1) >= 40 + name + stored:
            return at
    return -1
