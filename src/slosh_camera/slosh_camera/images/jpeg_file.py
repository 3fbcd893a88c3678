"""Checks that a JPEG file is complete: its segments and its coded pixels.

Cameras and networks lose parts of images, and some drivers close what is left with a proper end.
A decoder makes a picture of that without a word, grey where nothing is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.images.jpeg_entropy import (
    COEFFICIENTS,
    EARLY,
    LATE,
    NO_CODE,
    NO_RESTART,
    NO_VALUE,
    WHOLE,
    code_table,
    read_scan,
)

Bytes = NDArray[np.uint8]
IntArray = NDArray[np.int32]

_TABLES, _QUANTA, _INTERVAL, _SCAN, _END = 0xC4, 0xDB, 0xDD, 0xDA, 0xD9
_SEQUENTIAL = (0xC0, 0xC1)
# Frames of other kinds; 0xC4, 0xC8 and 0xCC between them are none.
_OTHER_FRAMES = (0xC2, 0xC3, 0xC5, 0xC6, 0xC7, 0xC9, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF)
# Largest coefficient of a picture of 8 bits before it is divided; rounding adds one step.
_LARGEST = 1024
_MOST_SAMPLES = 4
_CUT = "the file is cut off"
_HEADER = "its header is damaged"
_WHY = {
    NO_CODE: "data are damaged",
    NO_VALUE: "data are damaged",
    EARLY: "data are missing",
    LATE: "data are damaged or missing",
    NO_RESTART: "data are missing",
}


class _DamageError(Exception):
    """Internal error for an incomplete JPEG file; the message says why."""


class _Component(NamedTuple):
    across: int
    down: int
    quanta: int


@dataclass(slots=True)
class _State:
    """State of the JPEG parser before a scan: image size and tables read so far."""

    size: tuple[int, int] = (0, 0)
    components: dict[int, _Component] = field(default_factory=dict)
    quanta: dict[int, IntArray] = field(default_factory=dict)
    codes: dict[int, IntArray] = field(default_factory=dict)
    restart: int = 0
    scanned: set[int] = field(default_factory=set)


def jpeg_damage(data: Bytes) -> str:
    """Returns why a JPEG file is incomplete; empty if it is complete.

    What cameras and phones append behind the end does not matter.

    Args:
        data: (N,) the file; it begins with a JPEG's signature.

    Returns:
        Some words; empty where the file is whole.
    """
    try:
        _check(data)
    except _DamageError as damaged:
        return str(damaged)
    except (IndexError, KeyError, ValueError, ZeroDivisionError):
        return _HEADER
    return ""


def _check(data: Bytes) -> None:
    state, at = _State(), 2
    while True:
        at, kind = _marker(data, at)
        if kind == _END:
            break
        segment, at = _segment(data, at)
        if kind in _OTHER_FRAMES:
            raise _DamageError(
                "is progressive, which cannot be checked: save it as baseline or PNG"
            )
        if kind in _SEQUENTIAL:
            _read_frame(state, segment)
        elif kind == _TABLES:
            state.codes |= _code_tables(segment)
        elif kind == _QUANTA:
            state.quanta |= _quanta(segment)
        elif kind == _INTERVAL:
            state.restart = int.from_bytes(segment[:2], "big")
        elif kind == _SCAN:
            at = _check_scan(state, segment, data, at)
    if not state.components or state.scanned != set(state.components):
        raise _DamageError("has no pixels")


def _marker(data: Bytes, at: int) -> tuple[int, int]:
    """Returns the position after the next JPEG marker, and the marker's code."""
    if at < len(data) and data[at] != 0xFF:
        raise _DamageError(_HEADER)
    while at < len(data) and data[at] == 0xFF:
        at += 1
    if at >= len(data):
        raise _DamageError(_CUT)
    return at + 1, int(data[at])


def _segment(data: Bytes, at: int) -> tuple[bytes, int]:
    """Returns a JPEG segment's content and the position after it."""
    if at + 2 > len(data):
        raise _DamageError(_CUT)
    length = int(data[at]) << 8 | int(data[at + 1])
    if length < 2:
        raise _DamageError(_HEADER)
    if at + length > len(data):
        raise _DamageError(_CUT)
    return data[at + 2 : at + length].tobytes(), at + length


def _read_frame(state: _State, segment: bytes) -> None:
    bits, height, width = segment[0], segment[1] << 8 | segment[2], segment[3] << 8 | segment[4]
    parts = [segment[6 + 3 * n : 9 + 3 * n] for n in range(segment[5])]
    components = {part[0]: _Component(part[1] >> 4, part[1] & 15, part[2]) for part in parts}
    sampled = all(
        min(part[:2]) >= 1 and max(part[:2]) <= _MOST_SAMPLES for part in components.values()
    )
    if bits != 8 or height < 1 or width < 1 or state.components or not sampled:
        raise _DamageError(_HEADER)
    state.size, state.components = (width, height), components


def _check_scan(state: _State, segment: bytes, data: Bytes, start: int) -> int:
    """Checks a JPEG scan; returns the position of the marker after it."""
    parts = [segment[1 + 2 * n : 3 + 2 * n] for n in range(segment[0])]
    codes = state.codes or _usual_codes()
    slots = sorted(codes)
    blocks: list[tuple[int, int, int]] = []
    most = []
    for number, (name, tables) in enumerate(parts):
        component = state.components[name]
        count = component.across * component.down if len(parts) > 1 else 1
        first, other = slots.index(tables >> 4), slots.index(16 | tables & 15)
        blocks += count * [(number, first, other)]
        quanta = state.quanta[component.quanta]
        most.append((_LARGEST + quanta) // quanta)
    units = _units(state, [part[0] for part in parts])
    said, place, whole = read_scan(
        data,
        start,
        np.array([codes[slot] for slot in slots]),
        np.array(blocks, np.int32),
        np.array(most, np.int32),
        units,
        state.restart,
    )
    if said != WHOLE:
        raise _DamageError(f"{_WHY[said]} from {100 * whole // units} % of the picture on")
    state.scanned |= {part[0] for part in parts}
    return int(place)


def _units(state: _State, names: list[int]) -> int:
    """Returns the number of coding units (MCUs) in a JPEG scan [T.81, A.2]."""
    most_across = max(part.across for part in state.components.values())
    most_down = max(part.down for part in state.components.values())
    width, height = state.size
    if len(names) > 1:
        return -(-width // (8 * most_across)) * -(-height // (8 * most_down))
    part = state.components[names[0]]
    across, down = -(-width * part.across // most_across), -(-height * part.down // most_down)
    return -(-across // 8) * -(-down // 8)


@lru_cache(maxsize=16)
def _code_tables(segment: bytes) -> dict[int, IntArray]:
    """Parses Huffman tables; returns them by slot: DC tables from 0, AC tables from 16."""
    tables = {}
    for slot, content in _tables_in(segment):
        tables[slot] = code_table(content[:16], content[16:])
    return tables


def _tables_in(segment: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at < len(segment):
        counts = segment[at + 1 : at + 17]
        end = at + 17 + sum(counts)
        if len(counts) < 16 or end > len(segment) or sum(counts) > 256:
            raise _DamageError(_HEADER)
        yield segment[at], segment[at + 1 : end]
        at = end


@lru_cache(maxsize=16)
def _quanta(segment: bytes) -> dict[int, IntArray]:
    """Parses a segment's quantisation tables (COEFFICIENTS,); returns them by slot."""
    tables, at = {}, 0
    while at < len(segment):
        wide, slot = segment[at] >> 4, segment[at] & 15
        kind = np.dtype(">u2" if wide else np.uint8)
        table = np.frombuffer(segment, kind, COEFFICIENTS, at + 1).astype(np.int32)
        if wide > 1 or not np.all(table):
            raise _DamageError(_HEADER)
        tables[slot] = table
        at += 1 + COEFFICIENTS * kind.itemsize
    return tables


@lru_cache(maxsize=1)
def _usual_codes() -> dict[int, IntArray]:
    """Returns the default Huffman tables of T.81, annex K, which motion JPEG omits."""
    written = cv2.imencode(".jpg", np.zeros((8, 8, 3), np.uint8))[1].ravel()
    codes: dict[int, IntArray] = {}
    at, kind = _marker(written, 2)
    while kind != _SCAN:
        segment, at = _segment(written, at)
        if kind == _TABLES:
            codes |= _code_tables(segment)
        at, kind = _marker(written, at)
    return codes
