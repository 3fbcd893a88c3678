"""Converts many CDR messages to NumPy columns and back, without an object per message."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numba.types import Tuple, boolean, int64, uint8
from numpy.typing import NDArray
from rosbags.typesys.store import Typestore

from slosh_bag.columns.cdr_layout import TEXTS, WIDE, Layout, kind_of, layout_of, wide_text
from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import Bytes, MessageBlock
from slosh_base.compiled.compilation import entry_point, given
from slosh_base.types import Integers

BYTES, INTEGERS = given(uint8, 1), given(int64, 1)

Columns = dict[str, NDArray[Any]]
_REMEMBERED = 64


class Group(NamedTuple):
    """Messages of a block whose CDR bytes have the same layout.

    Attributes:
        rows: which messages of the block, (M,).
        layout: where their values lie.
        columns: their values by name, (M,) each; (M, n) of a whole array.
    """

    rows: Integers
    layout: Layout
    columns: Columns


class ColumnReader:
    """Reads blocks of messages as NumPy columns and caches the layouts of their bytes.

    Args:
        store_of: gives a store that knows a message type.
    """

    def __init__(self, store_of: Callable[[str], Typestore]) -> None:
        self._store_of = store_of
        self._layouts: dict[str, list[Layout]] = {}
        self._kinds: dict[tuple[str, str], str] = {}

    def columns(self, block: MessageBlock, names: Collection[str] | None = None) -> Columns:
        """Returns the values of a block by dotted field name, one row per message.

        Columns are e.g. 'header.stamp.sec', 'modal_position[0]', 'status[0].name'. The name of an
        array of numbers alone gives it whole, (N, n). Numbers have the type that the message
        gives them, `bool` is NumPy's, strings are `str` in an array of objects.

        Where sequences are not equally long in all messages, what a message does not have is NaN
        in columns of floats, and masked (`numpy.ma`) in others.

        Args:
            block: messages of one topic.
            names: the columns wanted; None: all, with arrays longer than 1024 whole.

        Raises:
            SloshBagError: a message is not of its type, or the type has no such field.
        """
        groups = list(self.groups(block, names))
        if len(groups) == 1 and (names is None or len(groups[0].columns) == len(set(names))):
            return groups[0].columns
        wanted = names or dict.fromkeys(name for group in groups for name in group.columns)
        return {name: self._merged(block, groups, name) for name in wanted}

    def groups(self, block: MessageBlock, names: Collection[str] | None = None) -> Iterator[Group]:
        """Yields one group per CDR layout, each with the requested columns that it contains.

        Raises:
            SloshBagError: as `columns`.
        """
        for name in names or ():
            self._kind(block, name)
        left = np.arange(len(block))
        while len(left):
            layout = self._layout(block, int(left[0]))
            fits, packed = _pack(
                block.buffer,
                block.start[left],
                block.length[left],
                layout.size,
                layout.fixed,
                layout.values,
            )
            if not fits[0]:
                raise SloshBagError(f"{block.topic}: a message outside the block's buffer")
            yield Group(left[fits], layout, _read(layout, packed, names))
            left = left[~fits]

    def _layout(self, block: MessageBlock, row: int) -> Layout:
        data = block.data(row)
        known = self._layouts.setdefault(block.message_type, [])
        for layout in known:
            if layout.fits(data):
                return layout
        try:
            store = self._store_of(block.message_type)
            layout = layout_of(store, block.message_type, data)
        except SloshBagError as error:
            raise SloshBagError(f"{block.topic} at {int(block.log_ns[row])} ns: {error}") from None
        known.insert(0, layout)
        del known[_REMEMBERED:]
        return layout

    def _kind(self, block: MessageBlock, name: str) -> str:
        key = block.message_type, name
        if key not in self._kinds:
            store = self._store_of(block.message_type)
            self._kinds[key] = kind_of(store, block.message_type, name)
        return self._kinds[key]

    def _merged(self, block: MessageBlock, groups: list[Group], name: str) -> NDArray[Any]:
        parts = [(group.rows, group.columns[name]) for group in groups if name in group.columns]
        if not parts:
            kind = self._kind(block, name)
            dtype = np.dtype(object if kind in TEXTS else _native(kind))
            parts = [(np.empty(0, np.int64), np.empty(0, dtype))]
        wide = max((part.shape[1] for _, part in parts if part.ndim > 1), default=0)
        shape = (len(block), wide) if wide else (len(block),)
        whole = np.zeros(shape, parts[0][1].dtype)
        there = np.zeros(shape, bool)
        for rows, part in parts:
            place = (rows, slice(part.shape[1])) if wide else rows
            whole[place] = part
            there[place] = True
        if there.all():
            return whole
        if whole.dtype.kind == "f":
            whole[~there] = np.nan
            return whole
        return np.ma.MaskedArray(whole, ~there)


def columns(
    block: MessageBlock, typestore: Typestore, names: Collection[str] | None = None
) -> Columns:
    """Returns the values of one block; for many blocks use a ColumnReader, which is faster.

    Args:
        block: messages of one topic.
        typestore: a store that knows their type.
        names: as of `ColumnReader.columns`.

    Raises:
        SloshBagError: as `ColumnReader.columns`.
    """
    return ColumnReader(lambda _: typestore).columns(block, names)


def write_messages(layout: Layout, template: bytes, values: Mapping[str, Any]) -> Bytes:
    """Encodes many messages that differ from a template only in numeric values.

    Args:
        layout: of the template.
        template: a message's CDR bytes; all that is not given is as in it.
        values: by column, (N,) each, or (N, n) for a whole array.

    Returns:
        The messages' bytes, (N, size).

    Raises:
        SloshBagError: a column is not in the layout, is a string, or does not fit its field.
    """
    if not layout.fits(template):
        raise SloshBagError(f"the template is no {layout.message_type} of this layout")
    lengths = {len(column) for column in values.values()}
    if len(lengths) != 1:
        raise SloshBagError(f"columns of {layout.message_type} with {sorted(lengths)} rows")
    packed = np.tile(np.frombuffer(template, np.uint8), (lengths.pop(), 1))
    record = packed.view(layout.record)[:, 0]
    for name, column in values.items():
        found = layout.find(name)
        leaf = layout.leaves[found[0]] if found else None
        if found is None or leaf is None or leaf.kind in TEXTS:
            raise SloshBagError(f"{layout.message_type} has no number {name!r} here")
        target = record[found[0]]
        target = target if found[1] is None else target[:, found[1]]
        target[...] = _fitting(np.asarray(column), target, leaf.kind, name)
    return packed


def _fitting(column: NDArray[Any], target: NDArray[Any], kind: str, name: str) -> NDArray[Any]:
    """Converts a column to its field's type; raises an error for overflow or a wrong shape."""
    if column.shape != target.shape:
        raise SloshBagError(f"{name!r}: shape {column.shape} instead of {target.shape}")
    if kind == "bool":
        fits = column.dtype == bool
    elif target.dtype.kind == "f":
        fits = column.dtype.kind in "fiu"
    else:
        limits = np.iinfo(target.dtype)
        fits = column.dtype.kind in "iub" and (
            not column.size
            or (int(column.min()) >= limits.min and int(column.max()) <= limits.max)
        )
    if not fits:
        raise SloshBagError(f"{name!r}: values that are no {kind}")
    return column


def _native(kind: str) -> str:
    return {"bool": "bool", "byte": "uint8", "char": "uint8"}.get(kind, kind)


def _read(layout: Layout, packed: Bytes, names: Collection[str] | None) -> Columns:
    record = packed.view(layout.record)[:, 0]
    found: Columns = {}
    for name in layout.names if names is None else names:
        place = layout.find(name)
        if place is None:
            continue
        leaf, stored = layout.leaves[place[0]], record[place[0]]
        if place[1] is not None:
            stored = stored[:, place[1]]
        if leaf.kind in TEXTS:
            wide = "<" if packed[0, 1] else ">"
            found[name] = _strings(
                stored, f"{layout.message_type}: {name}", wide if leaf.kind == WIDE else ""
            )
        elif leaf.kind == "bool":
            found[name] = stored != 0
        else:
            found[name] = stored.astype(_native(leaf.kind))
    return found


def _strings(stored: NDArray[Any], name: str, wide: str) -> NDArray[Any]:
    """Decodes strings, wide ones in a given byte order; identical strings are decoded once."""
    size, raw = stored.dtype.itemsize, stored.tobytes()
    parts = [raw[:size]]
    if raw != parts[0] * len(stored):
        parts = [raw[at : at + size] for at in range(0, len(raw), size)]
    texts = np.empty(len(stored), object)
    try:
        texts[:] = [wide_text(part, wide) if wide else part.decode() for part in parts]
    except UnicodeDecodeError:
        raise SloshBagError(f"{name} is no UTF-8 text") from None
    return texts


@entry_point(
    Tuple((boolean[::1], uint8[:, ::1]))(BYTES, INTEGERS, INTEGERS, int64, INTEGERS, BYTES)
)
def _pack(buffer, start, length, size, fixed, values):  # type: ignore[no-untyped-def]
    """Copies messages of one layout to rows, checking every position against the buffer's end.

    Returns which they are, (N,) bool, and their bytes, (M, size).
    """
    fits = np.zeros(len(start), np.bool_)
    count = 0
    for row in range(len(start)):
        at = start[row]
        good = length[row] == size and at >= 0 and at + size <= len(buffer)
        if good:
            for k in range(len(fixed)):
                if buffer[at + fixed[k]] != values[k]:
                    good = False
                    break
        fits[row] = good
        count += good
    packed = np.empty((count, size), np.uint8)
    place = 0
    for row in range(len(start)):
        if fits[row]:
            packed[place] = buffer[start[row] : start[row] + size]
            place += 1
    return fits, packed
