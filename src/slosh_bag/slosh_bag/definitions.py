"""Message definitions: from rosbags for ROS 2 Jazzy, otherwise from installed packages.

Foreign bags bring their own, of a size that can be worked with. A definition that contains itself
has no end, and forty types that each hold the one before twice have a million million fields: both
are refused before anything is made of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from slosh_bag.errors import SloshBagError
from slosh_base.files.installed import shared_folder

LONGEST = 500_000
"""Characters of a definition with those of all types in it, at most."""
MOST_DECLARED = 5_000
"""Fields and constants that it declares, at most."""
MOST_VALUES = 100_000
"""Values of a message, at most; sequences and arrays of numbers count as one."""
DEEPEST = 50
"""Levels of messages in messages, at most."""
ENCODINGS = ("ros2msg", "ros2idl")
_WIDE = re.compile(r"^(\s*wstring)<=\d+", re.MULTILINE)
_IDL_SEPARATOR = "=" * 80 + "\n"

Types = dict[str, Any]


class Definitions:
    """Definitions and hashes of message types, e.g. of 'slosh_msgs/msg/FreeSurface'."""

    def __init__(self) -> None:
        self.typestore: Typestore = get_typestore(Stores.ROS2_JAZZY)

    def text(self, message_type: str) -> str:
        """Returns a type's full definition with its nested types, as an MCAP 'ros2msg' schema.

        Raises:
            SloshBagError: no installed package defines the type, or its file cannot be read.
        """
        self._require(message_type)
        return str(self.typestore.generate_msgdef(message_type, ros_version=2)[0])

    def schema(self, message_type: str) -> tuple[str, bytes] | None:
        """Returns encoding and content of a type's MCAP schema.

        Raises:
            SloshBagError: as `text`.
        """
        return "ros2msg", self.text(message_type).encode()

    def hash(self, message_type: str) -> str:
        """Returns a type's RIHS01 hash, or an empty text for a type with wide strings.

        Raises:
            SloshBagError: as `text`.
        """
        self._require(message_type)
        try:
            return str(self.typestore.hash_rihs01(message_type))
        except KeyError:
            return ""

    def _require(self, message_type: str) -> None:
        """Loads the definitions of a type and of its nested types only."""
        wanted, found = [message_type], dict[str, Any]()
        while wanted:
            name = wanted.pop()
            if name not in self.typestore.fielddefs and name not in found:
                found.update(_read(name))
                if name not in found:  # such as 'std_msgs/Header', ROS 1's form of the name
                    raise SloshBagError(f"{name!r} is not the name of a ROS 2 type")
                wanted += [part for part, _ in parts_of(found[name][1])]
        if found:
            self.typestore.register(found)


def _read(message_type: str) -> dict[str, Any]:
    """Reads a type's constants and fields from its package's installed file."""
    package, name = message_type.split("/")[0], message_type.split("/")[-1]
    folder = find_interfaces(package)
    if folder is None:
        raise SloshBagError(
            f"no definition of {message_type}: package {package} is not installed here"
        )
    path = folder / f"{name}.msg"
    try:
        text = path.read_text(encoding="utf-8")
        types: dict[str, Any] = read_types("ros2msg", text, f"{package}/msg/{name}")
    except FileNotFoundError:
        raise SloshBagError(f"no definition of {message_type} in {folder}") from None
    except (OSError, UnicodeError, TypesysError) as error:
        reason = " ".join(str(error).split())
        raise SloshBagError(f"{path}: cannot be read as a message: {reason}") from None
    return types


def find_interfaces(package: str) -> Path | None:
    """Returns the folder of a package's .msg files, or None if it is not installed."""
    share = shared_folder(package)
    return share / "msg" if share is not None and (share / "msg").is_dir() else None


def read_types(encoding: str, text: str, message_type: str) -> Types:
    """Parses the text of a definition; returns constants and fields by type name.

    Args:
        encoding: one of ENCODINGS.
        text: the definition, with those of all types in it.
        message_type: what it defines, e.g. 'slosh_msgs/msg/FreeSurface'.

    Raises:
        SloshBagError: it is too long, stands for too much, or contains itself.
        TypesysError: it cannot be read; broken text causes other errors, too.
    """
    if len(text) > LONGEST:
        raise SloshBagError(f"it has {len(text)} characters, more than {LONGEST}")
    lines = sum(not line.lstrip().startswith(("#", "//")) for line in text.split("\n") if line)
    if max(lines, text.count(";") if encoding == "ros2idl" else 0) > MOST_DECLARED:
        raise SloshBagError(f"it declares more than {MOST_DECLARED} fields")
    types = _msg(text, message_type) if encoding == "ros2msg" else _idl(text)
    _Measure(types).check(message_type)
    return types


def parts_of(fields: list[tuple[str, Any]]) -> Iterator[tuple[str, int]]:
    """Yields each nested message type of the fields, with its number of elements."""
    for _, (kind, detail) in fields:
        count = detail[1] if kind == Nodetype.ARRAY else 1
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            kind, detail = detail[0]
        if kind == Nodetype.NAME:
            yield detail, count


def _msg(text: str, message_type: str) -> Types:
    """Parses a .msg file, including wide strings, which rosbags handles incorrectly."""
    found: Types = get_types_from_msg(_WIDE.sub(r"\1", text), message_type)
    return {
        name: (constants, [(field, _with_wide(what)) for field, what in fields])
        for name, (constants, fields) in found.items()
    }


def _with_wide(description: Any) -> Any:
    kind, detail = description
    if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
        return kind, (_with_wide(detail[0]), detail[1])
    if kind == Nodetype.NAME and detail.endswith("/msg/wstring"):
        return Nodetype.BASE, ("wstring", 0)
    return description


def _idl(text: str) -> Types:
    types: Types = {}
    for part in text.split(_IDL_SEPARATOR):
        # Several definitions in one text: each with a line that names it.
        titled = part.startswith("IDL: ")
        types.update(get_types_from_idl(part.partition("\n")[2] if titled else part))
    return types


class _Measure:
    """Counts the values and the nesting depth of message types."""

    def __init__(self, types: Types) -> None:
        self._types = types
        self._known: dict[str, tuple[int, int]] = {}

    def check(self, message_type: str) -> None:
        """Raises an error for a message type that is too large."""
        self._of(message_type, ())

    def _of(self, name: str, above: tuple[str, ...]) -> tuple[int, int]:
        if name in above:
            raise SloshBagError(f"{name} contains itself")
        if name not in self._known and name in self._types:
            fields = self._types[name][1]
            values, levels = len(fields), 0
            self._bound(values, len(above))
            for part, count in parts_of(fields):
                inner, deeper = self._of(part, (*above, name))
                values, levels = values + count * inner, max(levels, deeper + 1)
                self._bound(values, levels)
            self._known[name] = values, levels
        return self._known.get(name, (1, 0))

    def _bound(self, values: int, levels: int) -> None:
        if values > MOST_VALUES:
            raise SloshBagError(f"it stands for more than {MOST_VALUES} values")
        if levels > DEEPEST:
            raise SloshBagError(f"it has more than {DEEPEST} levels")
