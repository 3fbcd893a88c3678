"""Messages of slosh_msgs to and from the immutable values of `slosh_msgs_py.values`.

rclpy does not check field types by default: a NumPy float or an int in a float64 field goes out as
garbage. `to_message` therefore converts every field to exactly the type that it declares.
"""

from __future__ import annotations

import array
import dataclasses
from typing import Any

import numpy as np

from slosh_msgs import msg as messages
from slosh_msgs_py import values
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.stamps import to_duration, to_nanoseconds, to_time

_NANOSECONDS = "_ns"
_TYPECODES = {"double": "d", "float": "f"}
_FLOAT32 = 3.402823466e38
"""The greatest float32 that ROS's own check of a field admits."""


def to_message(value: Any) -> Any:
    """The message of a value.

    Args:
        value: one of the dataclasses of `slosh_msgs_py.values`.

    Raises:
        SloshMessageError: no such message, or a field's value does not fit its type.
    """
    message_type = getattr(messages, type(value).__name__, None)
    if message_type is None:
        raise SloshMessageError(f"there is no message for {type(value).__name__}")
    message = message_type()
    types = message_type.get_fields_and_field_types()
    for item in dataclasses.fields(value):
        content = getattr(value, item.name)
        try:
            _set(message, item.name, content, types)
        except (TypeError, ValueError, OverflowError) as error:
            raise SloshMessageError(
                f"{type(value).__name__}.{item.name} = {content!r} does not fit: {error}"
            ) from None
    return message


def _set(message: Any, name: str, content: Any, types: dict[str, str]) -> None:
    if name == "stamp_ns":
        message.header.stamp = to_time(content)
    elif name == "frame_id":
        message.header.frame_id = str(content)
    elif name.endswith(_NANOSECONDS):
        field = name.removesuffix(_NANOSECONDS)
        convert = to_duration if types[field].endswith("Duration") else to_time
        setattr(message, field, convert(content))
    elif dataclasses.is_dataclass(content):
        setattr(message, name, to_message(content))
    else:
        setattr(message, name, _plain(types[name], content))


def _plain(kind: str, content: Any) -> Any:
    """A value of exactly the Python type that the message's field declares."""
    if kind.startswith("sequence<"):
        return array.array(_TYPECODES[kind[9:-1]], _numbers(kind, content).tolist())
    if kind.endswith("]"):
        return _numbers(kind, content)
    if kind == "float":
        return float(_numbers(kind, float(content)))
    if kind == "double":
        return float(content)
    if kind == "boolean":
        return bool(content)
    if kind == "string":
        return str(content)
    return _integer(kind, content)


def _numbers(kind: str, content: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Finite numbers that a float32 would carry as infinity are refused."""
    numbers = np.asarray(content, dtype=np.float64)
    if "float" in kind and np.any(np.isfinite(numbers) & (np.abs(numbers) > _FLOAT32)):
        raise ValueError("not in the range of float32")
    return numbers


def _integer(kind: str, content: Any) -> int:
    """A whole number within the range of 'uint8' … 'int64'; rclpy would wrap another around."""
    number = int(content)
    bits = int(kind.lstrip("uint"))
    low, high = (0, 2**bits) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1))
    if number != content or not low <= number < high:
        raise ValueError(f"not in the range of {kind}")
    return number


def from_message(message: Any) -> Any:
    """The value of a message; its arrays are read-only copies.

    Raises:
        SloshMessageError: there is no value type for the message.
    """
    value_type = getattr(values, type(message).__name__, None)
    if value_type is None:
        raise SloshMessageError(f"there is no value for {type(message).__name__}")
    return value_type(
        **{item.name: _get(message, item.name) for item in dataclasses.fields(value_type)}
    )


def _get(message: Any, name: str) -> Any:
    if name == "stamp_ns":
        return to_nanoseconds(message.header.stamp)
    if name == "frame_id":
        return message.header.frame_id
    if name.endswith(_NANOSECONDS):
        return to_nanoseconds(getattr(message, name.removesuffix(_NANOSECONDS)))
    content = getattr(message, name)
    if isinstance(content, array.array | np.ndarray):
        copy = np.array(content, dtype=np.float64)
        copy.setflags(write=False)
        return copy
    if hasattr(content, "get_fields_and_field_types"):
        return from_message(content)
    return content
