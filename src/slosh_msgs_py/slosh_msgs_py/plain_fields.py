"""Messages from, and as, plain values: dictionaries, lists, numbers and texts.

rclpy checks no types by default: a whole number in a float64 field goes out as garbage.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

from rosidl_parser.definition import (
    AbstractGenericString,
    AbstractNestedType,
    Array,
    BasicType,
    BoundedSequence,
    NamespacedType,
)

from slosh_base.files.nearest import did_you_mean
from slosh_msgs_py.errors import SloshMessageError

_WHOLE = re.compile(r"(u?)int(\d+)")


def set_fields(message: Any, fields: Mapping[Any, Any], where: str = "") -> None:
    """Sets fields of a message; what is not given keeps the message's default.

    Args:
        message: of any type, filled in place.
        fields: by name; nested messages are dictionaries, arrays are lists.
        where: names of the fields that lead to this message, for errors.

    Raises:
        SloshMessageError: there is no such field, or a value does not fit its type.
    """
    slots = _slots(message)
    for name, content in fields.items():
        at = f"{where}{name}"
        if name not in slots:
            known = did_you_mean(str(name), slots) or f"; fields: {', '.join(slots) or 'none'}"
            raise SloshMessageError(f"{at}: there is no such field{known}")
        setattr(message, name, _value(slots[name], content, at))


def plain_fields(message: Any) -> dict[str, Any]:
    """Returns the fields of a message as plain values, nested messages as dictionaries."""
    return {name: _plain(getattr(message, name)) for name in _slots(message)}


def _slots(message: Any) -> dict[str, Any]:
    return dict(zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True))


def _plain(content: Any) -> Any:
    if hasattr(content, "get_fields_and_field_types"):
        return plain_fields(content)
    if isinstance(content, str | bytes | bool | int | float):
        return content.hex() if isinstance(content, bytes) else content
    return [_plain(one) for one in content]


def _value(slot: Any, content: Any, where: str) -> Any:
    if isinstance(slot, NamespacedType):
        if not isinstance(content, Mapping):
            raise _wrong(where, content, f"a dictionary of {slot.name}'s fields")
        message = getattr(import_module(".".join(slot.namespaces)), slot.name)()
        set_fields(message, content, f"{where}.")
        return message
    if isinstance(slot, AbstractNestedType):
        return _values(slot, content, where)
    if isinstance(slot, AbstractGenericString):
        if isinstance(content, str | int | float) and not isinstance(content, bool):
            return str(content)
        raise _wrong(where, content, "a text")
    return _number(slot, content, where)


def _values(slot: AbstractNestedType, content: Any, where: str) -> list[Any]:
    if not isinstance(content, Sequence) or isinstance(content, str):
        raise _wrong(where, content, "a list")
    if isinstance(slot, Array) and len(content) != slot.size:
        raise _wrong(where, content, f"a list of {slot.size} values")
    if isinstance(slot, BoundedSequence) and len(content) > slot.maximum_size:
        raise _wrong(where, content, f"a list of at most {slot.maximum_size} values")
    return [_value(slot.value_type, one, f"{where}[{n}]") for n, one in enumerate(content)]


def _number(slot: BasicType, content: Any, where: str) -> Any:
    kind = slot.typename
    if kind == "boolean":
        if isinstance(content, bool):
            return content
        raise _wrong(where, content, "true or false")
    if kind in ("float", "double"):
        if isinstance(content, int | float) and not isinstance(content, bool):
            return float(content)
        raise _wrong(where, content, "a number")
    if kind == "octet":
        if _is_whole(content) and 0 <= content < 256:
            return bytes([content])
        raise _wrong(where, content, "a whole number from 0 to 255")
    found = _WHOLE.fullmatch(kind)
    bits = int(found[2]) if found else 8
    signed = found is not None and not found[1]
    least, most = (-(2 ** (bits - 1)), 2 ** (bits - 1)) if signed else (0, 2**bits)
    if _is_whole(content) and least <= content < most:
        return int(content)
    raise _wrong(where, content, f"a whole number from {least} to {most - 1}")


def _is_whole(content: Any) -> bool:
    if isinstance(content, bool) or not isinstance(content, int | float):
        return False
    return math.isfinite(content) and content == int(content)


def _wrong(where: str, content: Any, wanted: str) -> SloshMessageError:
    return SloshMessageError(f"{where}: {content!r:.60} is not {wanted}")
