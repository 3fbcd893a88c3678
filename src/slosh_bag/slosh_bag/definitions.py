"""Message definitions: ROS 2 Jazzy's from rosbags, all others from the installed packages."""

from __future__ import annotations

import os
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from slosh_bag.errors import SloshBagError


class Definitions:
    """Definitions and hashes by message type, e.g. 'slosh_msgs/msg/FreeSurface'."""

    def __init__(self) -> None:
        self.typestore: Typestore = get_typestore(Stores.ROS2_JAZZY)

    def text(self, message_type: str) -> str:
        """The full definition with those of all types in it, as an MCAP 'ros2msg' schema has it.

        Raises:
            SloshBagError: no installed package defines the type.
        """
        self._require(message_type)
        return str(self.typestore.generate_msgdef(message_type, ros_version=2)[0])

    def hash(self, message_type: str) -> str:
        """The type's RIHS01 hash."""
        self._require(message_type)
        return str(self.typestore.hash_rihs01(message_type))

    def _require(self, message_type: str) -> None:
        if message_type in self.typestore.fielddefs:
            return
        package = message_type.split("/")[0]
        folder = find_interfaces(package)
        if folder is None:
            raise SloshBagError(
                f"no definition of {message_type}: package {package} is not installed here"
            )
        types = {}
        for path in sorted(folder.glob("*.msg")):
            types.update(get_types_from_msg(path.read_text(), f"{package}/msg/{path.stem}"))
        self.typestore.register(types)
        if message_type not in self.typestore.fielddefs:
            raise SloshBagError(f"no definition of {message_type} in {folder}")


def find_interfaces(package: str) -> Path | None:
    """Where a package's .msg files are installed; None: nowhere on AMENT_PREFIX_PATH."""
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        folder = Path(prefix) / "share" / package / "msg"
        if prefix and folder.is_dir():
            return folder
    return None
