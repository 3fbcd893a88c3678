"""Message types by their names."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def find_type(name: str) -> Any:
    """The class of a message type, e.g. 'std_msgs/msg/Header'.

    Raises:
        AttributeError, ImportError, ValueError: it is not installed here, or is no such name.
    """
    package, kind, message = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), message)
