"""Describes message types as columns of a flat table.

Fields of messages within messages become columns with dotted names (`header.stamp.sec`), the
elements of short arrays of fixed length columns with an index (`acceleration[0]`). What has no
fixed number of values stays one column: sequences, long arrays, and all arrays of texts or of
messages.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname
from rosbags.typesys.store import Typestore

STAMP: Final = ("header.stamp.sec", "header.stamp.nanosec")
LONGEST_SPREAD: Final = 64
"""Longest array whose elements get columns of their own."""
TEXTS: Final = frozenset({"string", "wstring"})
BYTES: Final = frozenset({"uint8", "byte", "char", "octet"})
Shape = Literal["value", "spread", "list"]


class ValueType(NamedTuple):
    """Type of a field's value: a primitive type, or the fields of a nested message.

    Attributes:
        base: e.g. 'float64', 'string'; empty: a message.
        fields: names and types of a message's fields, and whether each is a list.
    """

    base: str
    fields: tuple[tuple[str, ValueType, bool], ...] = ()


@dataclass(frozen=True, slots=True)
class ColumnField:
    """A message field that is exported as one column, or as one column per array element.

    Attributes:
        name: dotted.
        path: dotted, as attributes of the decoded message.
        node: the type of the value, or of a list's elements.
        shape: one value, an array that is spread over columns, or a list.
        length: of an array that is spread.
    """

    name: str
    path: str
    node: ValueType
    shape: Shape
    length: int = 0

    @property
    def columns(self) -> list[str]:
        """Names of the table columns for the message field."""
        if self.shape != "spread":
            return [self.name]
        return [f"{self.name}[{index}]" for index in range(self.length)]

    @property
    def is_flat(self) -> bool:
        """Whether the field holds numbers or one string, but no list of strings or messages."""
        return self.node.base not in {"", *TEXTS} or self.shape == "value"

    @property
    def is_bytes(self) -> bool:
        """Whether the field is a list of bytes, such as an image's data."""
        return self.shape == "list" and self.node.base in BYTES


def leaves(
    types: Typestore, message_type: str, prefix: str = "", path: str = ""
) -> list[ColumnField]:
    """Returns all value fields of a message type, nested ones included, in order."""
    found: list[ColumnField] = []
    for field, description in types.fielddefs[message_type][1]:
        name, attribute = prefix + field, path + normalize_fieldname(field)
        kind, detail = description
        if kind == Nodetype.NAME:
            found += leaves(types, detail, f"{name}.", f"{attribute}.")
        elif kind == Nodetype.BASE:
            found.append(ColumnField(name, attribute, ValueType(detail[0]), "value"))
        else:
            found.append(_array_leaf(types, name, attribute, description))
    return found


def _array_leaf(types: Typestore, name: str, attribute: str, description: Any) -> ColumnField:
    kind, (element, length) = description
    node = _node(types, element)
    short = kind == Nodetype.ARRAY and length <= LONGEST_SPREAD
    if short and node.base not in {"", *TEXTS}:
        return ColumnField(name, attribute, node, "spread", length)
    return ColumnField(name, attribute, node, "list")


def _node(types: Typestore, description: Any) -> ValueType:
    kind, detail = description
    if kind == Nodetype.BASE:
        return ValueType(detail[0])
    fields = []
    for field, inner in types.fielddefs[detail][1]:
        several = inner[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE)
        fields.append((field, _node(types, inner[1][0] if several else inner), several))
    return ValueType("", tuple(fields))


def row_getter(fields: Sequence[ColumnField]) -> Callable[[Any], tuple[Any, ...]]:
    """Returns a function that reads all exported fields of a decoded message."""
    get = attrgetter(*(leaf.path for leaf in fields))
    return get if len(fields) > 1 else lambda message: (get(message),)


def plain(node: ValueType, value: Any) -> Any:
    """Converts a decoded value to built-in Python numbers, strings, lists and dictionaries."""
    if not node.base:
        return {
            name: ([plain(inner, item) for item in content] if several else plain(inner, content))
            for name, inner, several in node.fields
            for content in (getattr(value, normalize_fieldname(name)),)
        }
    found = value.item() if hasattr(value, "item") else value
    return found & 0xFF if node.base == "byte" else found  # rosbags gives it a sign


def unsigned(node: ValueType, values: Any) -> Any:
    """Converts byte values to the range 0 … 255 of ROS 2; rosbags decodes them as signed."""
    if node.base != "byte":
        return values
    return np.asarray(values).astype(np.uint8)  # -1 becomes 255


def plain_list(node: ValueType, values: Any) -> list[Any]:
    """Converts the elements of a decoded list to built-in Python types."""
    if hasattr(values, "tolist"):
        return list(unsigned(node, values).tolist())
    return [plain(node, value) for value in values]
