"""Decodes CDR messages with wide strings, which rosbags cannot decode."""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname
from rosbags.typesys.store import Typestore

from slosh_bag.columns.cdr_layout import HEADER, KINDS, ORDERS, TEXTS, WIDE, wide_text
from slosh_bag.errors import SloshBagError


def has_wide_text(store: Typestore, message_type: str) -> bool:
    """Whether a type or one of its nested types has wide strings."""
    for _, (kind, detail) in store.fielddefs[message_type][1]:
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            kind, detail = detail[0]
        if kind == Nodetype.BASE and detail[0] == WIDE:
            return True
        if kind == Nodetype.NAME and has_wide_text(store, detail):
            return True
    return False


def decode_values(store: Typestore, message_type: str, data: bytes) -> SimpleNamespace:
    """Decodes a message to an object with the field names that rosbags uses.

    Raises:
        SloshBagError: the bytes are not those of such a message.
    """
    order = ORDERS.get(bytes(data[:2])) if len(data) >= HEADER else None
    if order is None:
        raise SloshBagError(f"no {message_type}: not plain CDR")
    try:
        return _Values(store, bytes(data), order).message(message_type)
    except (struct.error, ValueError) as error:
        if isinstance(error, SloshBagError):
            raise
        raise SloshBagError(f"no {message_type}: {len(data)} bytes are too few") from None


class _Values:
    def __init__(self, store: Typestore, data: bytes, order: str) -> None:
        self._store, self._data, self._order, self._at = store, data, order, HEADER

    def message(self, message_type: str) -> SimpleNamespace:
        """Decodes the next message or nested message of a type."""
        fields = self._store.fielddefs[message_type][1]
        return SimpleNamespace(
            **{normalize_fieldname(name): self._value(what) for name, what in fields}
        )

    def _value(self, description: Any) -> Any:
        kind, what = description
        if kind == Nodetype.NAME:
            return self.message(what)
        if kind == Nodetype.BASE:
            if what[0] in TEXTS:
                return self._text(what[0])
            return self._numbers(what[0], 1)[0].item()
        inner, count = what
        if kind == Nodetype.SEQUENCE:
            count = self._word()
        if inner[0] == Nodetype.BASE and inner[1][0] not in TEXTS:
            return self._numbers(inner[1][0], count)
        if count > len(self._data):
            raise ValueError(count)
        return [self._value(inner) for _ in range(count)]

    def _numbers(self, kind: str, count: int) -> Any:
        dtype = np.dtype(self._order + KINDS[kind])
        if count:
            self._align(dtype.itemsize)
        found = np.frombuffer(self._data, dtype, count, self._at) if count else np.empty(0, dtype)
        self._at += found.nbytes
        return found.astype(bool if kind == "bool" else dtype.newbyteorder("="))

    def _text(self, kind: str) -> str:
        length = self._word()
        size = 4 * length if kind == WIDE else length
        raw = self._data[self._at : self._at + size]
        if len(raw) < size:
            raise ValueError(size)
        self._at += size
        return wide_text(raw, self._order) if kind == WIDE else raw[:-1].decode()

    def _word(self) -> int:
        self._align(4)
        (value,) = struct.unpack_from(f"{self._order}I", self._data, self._at)
        self._at += 4
        return int(value)

    def _align(self, size: int) -> None:
        self._at += (HEADER - self._at) % size
