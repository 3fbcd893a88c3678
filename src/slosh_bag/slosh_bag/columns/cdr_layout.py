"""Computes the position of each value in a message's CDR bytes.

Messages of a type whose strings and sequences are equally long have all values at the same places.
A layout says where these are, so that many messages are read or written at once.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import Bytes
from slosh_base.types import Integers

HEADER = 4
"""Encapsulation before the values: byte order and options [bytes]."""
EXPANDED = 1024
"""Arrays up to this length are listed element by element."""
_PADDING = 3
ORDERS = {b"\x00\x01": "<", b"\x00\x00": ">"}
WIDE = "wstring"
"""Kind of a text that is stored as UTF-16 units of four bytes each, without an end."""
TEXTS = frozenset({"string", WIDE})
KINDS = {"bool": "u1", "byte": "u1", "char": "u1", "float32": "f4", "float64": "f8"} | {
    f"{sign}int{8 * size}": f"{kind}{size}"
    for sign, kind in (("", "i"), ("u", "u"))
    for size in (1, 2, 4, 8)
}
_PART = re.compile(r"(\w+)(?:\[(\d+)\])?")
_ELEMENT = re.compile(r"(.*)\[(\d+)\]")


@dataclass(frozen=True, slots=True)
class Leaf:
    """Position and type of a value, or of an array of values, in a message's CDR bytes.

    Attributes:
        offset: of its first byte in the message [bytes].
        kind: of ROS, e.g. 'float64'; 'string', 'wstring'.
        dtype: of one value as it is stored; of a string, its bytes without the final zero.
        count: values of an array or sequence; None: a single value.
    """

    offset: int
    kind: str
    dtype: np.dtype[Any]
    count: int | None = None


@dataclass(frozen=True, eq=False)
class Layout:
    """Positions of all values in the CDR bytes of a message.

    Attributes:
        message_type: e.g. 'slosh_msgs/msg/FreeSurface'.
        size: of the whole message [bytes].
        leaves: by dotted name, e.g. 'header.stamp.sec', 'status[0].name'; an array of numbers is
            one leaf.
        fixed: places of the bytes that tell the layout: byte order, lengths, final zeros, (K,).
        values: these bytes, (K,) uint8.
    """

    message_type: str
    size: int
    leaves: dict[str, Leaf]
    fixed: Integers
    values: Bytes

    @cached_property
    def record(self) -> np.dtype[Any]:
        """The whole message as a NumPy structured type, with one field per value or array."""
        return np.dtype(
            {
                "names": list(self.leaves),
                "formats": [
                    leaf.dtype if leaf.count is None else (leaf.dtype, (leaf.count,))
                    for leaf in self.leaves.values()
                ],
                "offsets": [leaf.offset for leaf in self.leaves.values()],
                "itemsize": self.size,
            }
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all columns; a long array is a single column."""
        names: list[str] = []
        for name, leaf in self.leaves.items():
            if leaf.count is None or leaf.count > EXPANDED:
                names.append(name)
            else:
                names += [f"{name}[{index}]" for index in range(leaf.count)]
        return tuple(names)

    def find(self, name: str) -> tuple[str, int | None] | None:
        """Returns the record field of a column, and its element's index; None if unknown."""
        if name in self.leaves:
            return name, None
        match = _ELEMENT.fullmatch(name)
        leaf = self.leaves.get(match[1]) if match else None
        if match is None or leaf is None or leaf.count is None or int(match[2]) >= leaf.count:
            return None
        return match[1], int(match[2])

    def fits(self, data: bytes) -> bool:
        """Whether a message's bytes have this layout."""
        content = np.frombuffer(data, np.uint8)
        return len(data) == self.size and bool((content[self.fixed] == self.values).all())


def layout_of(typestore: Typestore, message_type: str, data: bytes) -> Layout:
    """Computes the positions of all values in a message's CDR bytes.

    Args:
        typestore: a store that knows the type.
        message_type: e.g. 'slosh_msgs/msg/FreeSurface'.
        data: the message's CDR bytes.

    Raises:
        SloshBagError: they are not those of such a message.
    """
    order = ORDERS.get(data[:2]) if len(data) >= HEADER else None
    if order is None:
        raise SloshBagError(f"no {message_type}: not plain CDR")
    walk = _Walk(typestore, data, order)
    try:
        walk.message(message_type, "")
    except (struct.error, IndexError, RecursionError):
        raise SloshBagError(f"no {message_type}: {len(data)} bytes are too few") from None
    except SloshBagError as error:
        raise SloshBagError(f"no {message_type}: {error}") from None
    if not walk.at <= len(data) <= walk.at + _PADDING:
        raise SloshBagError(f"no {message_type}: {walk.at} bytes would be, not {len(data)}")
    fixed = np.array([0, 1, *walk.fixed], np.int64)
    values = np.frombuffer(data, np.uint8)[fixed]
    return Layout(message_type, len(data), walk.leaves, fixed, values)


@dataclass(slots=True)
class _Walk:
    """Traverses a message's bytes according to the definition of its type."""

    store: Typestore
    data: bytes
    order: str
    at: int = HEADER
    leaves: dict[str, Leaf] = field(default_factory=dict)
    fixed: list[int] = field(default_factory=list)

    def message(self, message_type: str, prefix: str) -> None:
        try:
            fields = self.store.fielddefs[message_type][1]
        except KeyError:
            raise SloshBagError(f"{message_type} is not defined") from None
        for name, description in fields:
            self.value(description, f"{prefix}{name}")

    def value(self, description: Any, name: str) -> None:
        kind, what = description
        if kind == Nodetype.BASE:
            self.base(what[0], name)
        elif kind == Nodetype.NAME:
            self.message(what, f"{name}.")
        else:
            inner, count = what
            if kind == Nodetype.SEQUENCE:
                count = self.word()
            self.elements(inner, count, name)

    def base(self, kind: str, name: str) -> None:
        if kind in TEXTS:
            self.string(name, wide=kind == WIDE)
        else:
            self.leaves[name] = self.numbers(kind, 1, None)

    def elements(self, inner: Any, count: int, name: str) -> None:
        if count > len(self.data):
            raise SloshBagError(f"{name} cannot have {count} elements")
        if inner[0] == Nodetype.BASE and inner[1][0] not in TEXTS:
            if count:
                self.leaves[name] = self.numbers(inner[1][0], count, count)
            return
        for index in range(count):
            self.value(inner, f"{name}[{index}]")

    def numbers(self, kind: str, number: int, count: int | None) -> Leaf:
        if kind not in KINDS:
            raise SloshBagError(f"values of type {kind} cannot be read")
        dtype = np.dtype(self.order + KINDS[kind])
        self.align(dtype.itemsize)
        leaf = Leaf(self.at, kind, dtype, count)
        self.at += number * dtype.itemsize
        if self.at > len(self.data):
            raise IndexError
        return leaf

    def string(self, name: str, *, wide: bool) -> None:
        length = self.word()
        if wide:
            end = self.at + 4 * length
            if end > len(self.data):
                raise SloshBagError(f"{name} is no string")
            self.leaves[name] = Leaf(self.at, WIDE, np.dtype(f"V{4 * length}"))
            self.at = end
            return
        end = self.at + length
        if not length or end > len(self.data) or self.data[end - 1]:
            raise SloshBagError(f"{name} is no string")
        self.leaves[name] = Leaf(self.at, "string", np.dtype(f"V{length - 1}"))
        self.fixed.append(end - 1)
        self.at = end

    def word(self) -> int:
        self.align(4)
        (value,) = struct.unpack_from(f"{self.order}I", self.data, self.at)
        self.fixed += range(self.at, self.at + 4)
        self.at += 4
        return int(value)

    def align(self, size: int) -> None:
        self.at += (HEADER - self.at) % size


def wide_text(raw: bytes, order: str) -> str:
    """Decodes a wide string; keeps unpaired surrogates.

    >>> wide_text("cup".encode("utf-32-le"), "<")
    'cup'

    Args:
        raw: its units, four bytes each.
        order: of their bytes, '<' or '>'.
    """
    units = np.frombuffer(raw, f"{order}u4").astype("<u2")
    return units.tobytes().decode("utf-16-le", "surrogatepass")


def kind_of(typestore: Typestore, message_type: str, name: str) -> str:
    """Returns the ROS type of a column's values, from the definition of its message type.

    Args:
        typestore: a store that knows the type.
        message_type: e.g. 'slosh_msgs/msg/FreeSurface'.
        name: of a column.

    Raises:
        SloshBagError: the type has no such field.

    >>> from rosbags.typesys import Stores, get_typestore
    >>> kind_of(get_typestore(Stores.ROS2_HUMBLE), "geometry_msgs/msg/Point", "x")
    'float64'
    """
    description: Any = (Nodetype.NAME, message_type)
    whole = False
    for part in name.split("."):
        match = _PART.fullmatch(part)
        if match is None or whole or description[0] != Nodetype.NAME:
            raise SloshBagError(f"{message_type} has no field {name!r}")
        fields = dict(typestore.fielddefs[description[1]][1])
        if match[1] not in fields:
            known = ", ".join(fields)
            raise SloshBagError(
                f"{message_type} has no field {name!r}; {description[1]} has {known}"
            )
        description = fields[match[1]]
        many = description[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE)
        if match[2] and not many:
            raise SloshBagError(f"{message_type} has no field {name!r}: {match[1]} is one value")
        whole = many and not match[2]
        description = description[1][0] if many else description
    if description[0] != Nodetype.BASE or (whole and description[1][0] in TEXTS):
        raise SloshBagError(f"{message_type}: {name!r} is no column; name what is in it")
    return str(description[1][0])
