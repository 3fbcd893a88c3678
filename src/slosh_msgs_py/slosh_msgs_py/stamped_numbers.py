"""Reads serialised messages that consist of a header and numbers.

An executor creates ten Python objects for an AccelStamped, which takes longer than everything that
is done with it. These messages are therefore received raw, as CDR (OMG DDS-XTypes, §7.4), and read
here.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py.errors import SloshMessageError

_HEAD = 4
"""Bytes that tell the encoding; alignment counts from behind them."""
_ORDERS = {b"\x00\x00": ">", b"\x00\x01": "<"}
"""Byte order by encoding: CDR, big and little endian."""
_FRAME = _HEAD + 12
"""Where the frame's name begins, after stamp and length."""


class StampedNumbers(NamedTuple):
    """Content of a message that consists of a header and numbers.

    Attributes:
        stamp_ns: of the header [ns].
        frame: of the header.
        values: all numbers behind the header, in the order of the message's definition.
    """

    stamp_ns: int
    frame: str
    values: tuple[float, ...]


class StampedReader:
    """Reads raw messages of one type, such as AccelStamped, Imu or PoseStamped.

    Args:
        count: number of float64 values behind the header.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._head = b""
        self._name, self._frame, self._at = b"", "", 0
        self._stamp = self._numbers = struct.Struct("<")

    def read(self, data: bytes) -> StampedNumbers:
        """Returns stamp, frame and numbers of a raw message.

        Raises:
            SloshMessageError: the bytes are no such message.
        """
        try:
            if data[:_HEAD] != self._head:
                self._prepare(data[:_HEAD])
            sec, nanosec, length = self._stamp.unpack_from(data, _HEAD)
            name = data[_FRAME : _FRAME + length]
            if name != self._name or not self._at:
                self._frame, self._name = name[:-1].decode(), name
                self._at = _HEAD + (_FRAME - _HEAD + length + 7) // 8 * 8
            values = self._numbers.unpack_from(data, self._at)
        except (struct.error, UnicodeDecodeError) as error:
            raise SloshMessageError(
                f"a message of {len(data)} bytes is damaged: {error}"
            ) from None
        return StampedNumbers(sec * SECOND + nanosec, self._frame, values)

    def _prepare(self, head: bytes) -> None:
        order = _ORDERS.get(head[:2])
        if order is None:
            raise SloshMessageError(
                f"a message has the encoding {head[:2].hex() or 'none'}; only CDR is read"
            )
        self._head = head
        self._stamp = struct.Struct(f"{order}iII")
        self._numbers = struct.Struct(f"{order}{self._count}d")
