"""Decodes the entropy-coded data of a JPEG scan, to check that it is valid.

A decoder goes on behind damage and fills what is missing with grey. Here the codes are read
without making a picture of them: every code must be one of the file's, every block must hold 64
coefficients of values that a picture can have, and the blocks must use up the data up to the
marker behind them [ITU-T T.81, annex F]. Where data are missing, or a wrong bit makes a code
longer or shorter, they hardly ever do. A wrong bit within a value is not seen: no sum tells it.
"""

from __future__ import annotations

import numpy as np
from numba.types import UniTuple, int32, int64, uint8
from numpy.typing import NDArray

from slosh_base.compiled.compilation import compiled, entry_point, given

LOOK = 9
"""Bits of a code that are looked up at once."""
_LONGEST = 16
AT_LENGTH = 1 << LOOK
"""Place in a code table of the codes' ends, by length, and of what leads to their symbols."""
AT_SYMBOLS = AT_LENGTH + 2 * (_LONGEST + 1)
"""Place of the symbols."""
CODE_TABLE = AT_SYMBOLS + 256
"""Numbers that a code table has."""
COEFFICIENTS = 64
"""Coefficients of a block."""

WHOLE, NO_CODE, NO_VALUE, EARLY, LATE, NO_RESTART = range(6)
"""What is said about a scan."""

# Most bits of the values of a first coefficient's step and of the other coefficients.
_STEP_BITS, _VALUE_BITS = 11, 10
# Zero bytes behind the data that some cameras fill up with.
_FILLING = 3


def code_table(counts: bytes, symbols: bytes) -> NDArray[np.int32]:
    """Builds a decoding table (CODE_TABLE,) for a Huffman code.

    Args:
        counts: (16,) numbers of codes of 1 to 16 bits.
        symbols: what the codes stand for, shortest codes first.

    Raises:
        ValueError: there are more codes than their lengths have room for.
    """
    table = np.zeros(CODE_TABLE, np.int32)
    table[AT_SYMBOLS : AT_SYMBOLS + len(symbols)] = np.frombuffer(symbols, np.uint8)
    code = first = 0
    for length, count in enumerate(counts, start=1):
        if code + count > 1 << length:
            raise ValueError("more codes than there is room for")
        # Codes of this length are below the end; a code less the offset is its symbol's place.
        table[AT_LENGTH + length] = code + count
        table[AT_LENGTH + _LONGEST + 1 + length] = code - first
        for symbol in symbols[first : first + count] if length <= LOOK else b"":
            begin = code << (LOOK - length)
            table[begin : begin + (1 << (LOOK - length))] = length << 8 | symbol
            code += 1
        code += count if length > LOOK else 0
        first += count
        code <<= 1
    return table


@compiled
def _filled(data, place, held, bits, made_up):  # type: ignore[no-untyped-def]
    """Fills the bit buffer to at least 32 bits; appends zeros at the end of the data."""
    while bits < 32:
        byte, step = 0, 0
        if place < data.size:
            byte, step = data[place], 1
            if byte == 0xFF:
                # A byte of 255 is followed by 0; all else is a marker.
                stuffed = place + 1 < data.size and data[place + 1] == 0
                byte, step = (0xFF, 2) if stuffed else (0, 0)
        place += step
        held = held << np.uint64(8) | np.uint64(byte)
        bits += 8
        made_up += 0 if step else 8
    return place, held, bits, made_up


@compiled
def _symbol(tables, table, held, bits):  # type: ignore[no-untyped-def]
    """Decodes the next Huffman symbol and its length; length 0 means an invalid code."""
    entry = tables[table, np.int64(held >> np.uint64(bits - LOOK)) & ((1 << LOOK) - 1)]
    if entry:
        return entry & 0xFF, entry >> 8
    ahead = np.int64(held >> np.uint64(bits - _LONGEST)) & 0xFFFF
    for length in range(LOOK + 1, _LONGEST + 1):
        code = ahead >> (_LONGEST - length)
        if code < tables[table, AT_LENGTH + length]:
            code -= tables[table, AT_LENGTH + _LONGEST + 1 + length]
            return tables[table, AT_SYMBOLS + code], np.int32(length)
    return np.int32(0), np.int32(0)


@compiled
def _value(held, bits, width):  # type: ignore[no-untyped-def]
    """Returns the value of the next `width` bits in the bit buffer."""
    value = np.int64(held >> np.uint64(bits)) & ((1 << width) - 1)
    return value - ((1 << width) - 1) if width and value < 1 << (width - 1) else value


@compiled
def _others(data, tables, table, most, component, place, held, bits, made_up):  # type: ignore[no-untyped-def]
    """Decodes all coefficients of a JPEG block after the first."""
    k = 1
    while k < COEFFICIENTS:
        place, held, bits, made_up = _filled(data, place, held, bits, made_up)
        symbol, length = _symbol(tables, table, held, bits)
        if length == 0:
            return NO_CODE, place, held, bits, made_up
        bits -= length
        run, width = symbol >> 4, symbol & 0xF
        if width == 0 and run == 0:
            break
        k += run
        if k >= COEFFICIENTS or width > _VALUE_BITS or (width == 0 and run != 15):
            return NO_VALUE, place, held, bits, made_up
        bits -= width
        if abs(_value(held, bits, width)) > most[component, k]:
            return NO_VALUE, place, held, bits, made_up
        k += 1
    return WHOLE, place, held, bits, made_up


@compiled
def _first(data, tables, table, place, held, bits, made_up):  # type: ignore[no-untyped-def]
    """Decodes a JPEG block's first coefficient, which is stored as a difference."""
    place, held, bits, made_up = _filled(data, place, held, bits, made_up)
    width, length = _symbol(tables, table, held, bits)
    if length == 0 or width > _STEP_BITS:
        return NO_CODE, 0, place, held, bits, made_up
    bits -= length + width
    return WHOLE, _value(held, bits, width), place, held, bits, made_up


@compiled
def _closed(data, place, held, bits, made_up):  # type: ignore[no-untyped-def]
    """Returns how a JPEG scan ends (WHOLE, EARLY or LATE), and the next marker's position."""
    whole = (bits - made_up) // 8
    left = np.int64(held >> np.uint64(made_up)) & ((1 << (8 * whole)) - 1)
    while place < data.size and data[place] == 0 and whole <= _FILLING:
        place += 1
        whole += 1
    if left or whole > _FILLING or (place < data.size and data[place] != 0xFF):
        return LATE, place
    while place + 1 < data.size and data[place + 1] == 0xFF:
        place += 1
    if place + 1 >= data.size:
        return EARLY, place
    return WHOLE if data[place + 1] else LATE, place


@entry_point(
    UniTuple(int64, 3)(
        given(uint8, 1), int64, given(int32, 2), given(int32, 2), given(int32, 2), int64, int64
    )
)
def read_scan(data, start, tables, blocks, most, units, restart):  # type: ignore[no-untyped-def]
    """Decodes a JPEG scan from its first byte to the next marker.

    Args:
        tables: (T, CODE_TABLE) code tables.
        blocks: (B, 3) of a unit: component, tables of its first and its other coefficients.
        most: (C, COEFFICIENTS) largest values that the coefficients may have, by component.
        units: number of units (MCUs).
        restart: units between restart markers; 0: there are none.

    Returns:
        What is said, the place of the marker or of the damage, the number of whole units.
    """
    place, held, bits, made_up = start, np.uint64(0), 0, 0
    level = np.zeros(most.shape[0], np.int64)
    for unit in range(units):
        if restart and unit and unit % restart == 0:
            said, place = _closed(data, place, held, bits, made_up)
            if said == WHOLE and data[place + 1] != 0xD0 + (unit // restart - 1) % 8:
                said = NO_RESTART
            if said != WHOLE:
                return said, place, unit
            place, held, bits, made_up = place + 2, np.uint64(0), 0, 0
            level[:] = 0
        for b in range(blocks.shape[0]):
            component, first, others = blocks[b, 0], blocks[b, 1], blocks[b, 2]
            said, step, place, held, bits, made_up = _first(
                data, tables, first, place, held, bits, made_up
            )
            level[component] += step
            if said == WHOLE and abs(level[component]) > most[component, 0]:
                said = NO_VALUE
            if said == WHOLE:
                said, place, held, bits, made_up = _others(
                    data, tables, others, most, component, place, held, bits, made_up
                )
            if bits < made_up:
                said = EARLY
            if said != WHOLE:
                return said, place, unit
    said, place = _closed(data, place, held, bits, made_up)
    return said, place, units
