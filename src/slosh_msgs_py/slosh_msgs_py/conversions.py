"""Fills messages by field name, with values of exactly the declared types.

rclpy does not check field types by default: a NumPy float or an int in a float64 field goes out as
garbage.
"""

from __future__ import annotations

import array
from importlib import import_module
from typing import Any, TypeVar

import numpy as np

from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.stamps import to_duration, to_time

_NANOSECONDS = "_ns"
_TYPECODES = {"double": "d", "float": "f"}
_UNKNOWN = {"double": float("nan"), "float": float("nan")}
"""Value of a field that is not given; other types keep the message's own default."""
_FLOAT32 = 3.402823466e38
"""The greatest float32 that ROS's own check of a field admits."""
Message = TypeVar("Message")


def filled(message_type: type[Message], /, **fields: Any) -> Message:
    """Creates a message of a type with the given field values.

    Args:
        message_type: the message's class.
        fields: by the message's field names. `stamp_ns` and `frame_id` fill the header; another
            name that ends in `_ns` fills the time or duration of that name [ns]. Numbers that are
            not given are NaN, which the messages of slosh_msgs define as unknown.

    Raises:
        SloshMessageError: there is no such field, or a value does not fit its type.
    """
    message: Any = message_type()
    types = message.get_fields_and_field_types()
    for name in types.keys() - fields.keys():
        if types[name] in _UNKNOWN:
            setattr(message, name, _UNKNOWN[types[name]])
    for name, content in fields.items():
        try:
            _set(message, name, content, types)
        except KeyError:
            raise SloshMessageError(f"{message_type.__name__} has no field {name}") from None
        except (TypeError, ValueError, OverflowError) as error:
            raise SloshMessageError(
                f"{message_type.__name__}.{name} = {content!r} does not fit: {error}"
            ) from None
    return message  # type: ignore[no-any-return]


def _set(message: Any, name: str, content: Any, types: dict[str, str]) -> None:
    if name == "stamp_ns":
        message.header.stamp = to_time(content)
    elif name == "frame_id":
        message.header.frame_id = str(content)
    elif name.endswith(_NANOSECONDS):
        field = name.removesuffix(_NANOSECONDS)
        convert = to_duration if types[field].endswith("Duration") else to_time
        setattr(message, field, convert(content))
    else:
        setattr(message, name, _plain(types[name], content))


def _plain(kind: str, content: Any) -> Any:
    """Converts a value to exactly the Python type of the message's field."""
    if kind == "sequence<string>":
        return [str(text) for text in content]
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
    """Converts values to an array of numbers; raises an error for float32 overflow."""
    numbers = np.asarray(content, dtype=np.float64)
    if "float" in kind and np.any(np.isfinite(numbers) & (np.abs(numbers) > _FLOAT32)):
        raise ValueError("not in the range of float32")
    return numbers


def _integer(kind: str, content: Any) -> int:
    """Converts a value to an integer; raises an error if it exceeds the field's type."""
    number = int(content)
    bits = int(kind.lstrip("uint"))
    low, high = (0, 2**bits) if kind.startswith("u") else (-(2 ** (bits - 1)), 2 ** (bits - 1))
    if number != content or not low <= number < high:
        raise ValueError(f"not in the range of {kind}")
    return number


def find_type(name: str) -> Any:
    """Returns the class of a message type, e.g. 'std_msgs/msg/Header'.

    Raises:
        AttributeError, ImportError, ValueError: it is not installed here, or is no such name.
    """
    package, kind, message = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), message)
