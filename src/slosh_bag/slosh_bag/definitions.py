"""Message definitions: ROS 2 Jazzy's from rosbags, all others from the installed packages."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import TypesysError
from rosbags.typesys.store import Typestore

from slosh_bag.errors import SloshBagError
from slosh_bag.message_types import parts_of, read_types
from slosh_base.files.installed import shared_folder


class Definitions:
    """Definitions and hashes by message type, e.g. 'slosh_msgs/msg/FreeSurface'."""

    def __init__(self) -> None:
        self.typestore: Typestore = get_typestore(Stores.ROS2_JAZZY)

    def text(self, message_type: str) -> str:
        """The full definition with those of all types in it, as an MCAP 'ros2msg' schema has it.

        Raises:
            SloshBagError: no installed package defines the type, or its file cannot be read.
        """
        self._require(message_type)
        return str(self.typestore.generate_msgdef(message_type, ros_version=2)[0])

    def schema(self, message_type: str) -> tuple[str, bytes] | None:
        """Encoding and content of the type's schema; None: its messages have none.

        Raises:
            SloshBagError: as `text`.
        """
        return "ros2msg", self.text(message_type).encode()

    def hash(self, message_type: str) -> str:
        """The type's RIHS01 hash; empty where it cannot be made, as of a type with wide strings.

        Raises:
            SloshBagError: as `text`.
        """
        self._require(message_type)
        try:
            return str(self.typestore.hash_rihs01(message_type))
        except KeyError:
            return ""

    def _require(self, message_type: str) -> None:
        """Reads the type and those in it, and no other file: one that is broken harms no one."""
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
    """A type's constants and fields, from the file that its package installed."""
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
    """Where a package's .msg files are installed; None: nowhere."""
    share = shared_folder(package)
    return share / "msg" if share is not None and (share / "msg").is_dir() else None
