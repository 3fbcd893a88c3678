"""Writes bags of a robot cell; message fields that are not given are zero or empty."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions

ACCEL, SURFACE = "geometry_msgs/msg/AccelStamped", "slosh_msgs/msg/FreeSurface"
IMU, POSE = "sensor_msgs/msg/Imu", "geometry_msgs/msg/PoseStamped"
MEASURED = "msh"
"""The one number of a surface that is known unless more are given."""


class CellBag:
    """Collects messages and writes them to a bag in the order of log times.

    Args:
        log_time: of a message [ns], by its stamp and the number of messages before it.
    """

    def __init__(self, log_time: Callable[[int, int], int] = lambda stamp, count: stamp) -> None:
        self._definitions = Definitions()
        self._log_time = log_time
        self._entries: list[tuple[int, str, str, bytes]] = []

    def put(self, topic: str, kind: str, stamp: int, frame: str, **fields: Any) -> None:
        """Adds a message with field values; `pose__position__x` sets the nested field's value."""
        self._definitions.hash(kind)
        message = self._blank(kind)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.header.frame_id = frame
        for path, value in fields.items():
            *parents, last = path.split("__")
            place = message
            for parent in parents:
                place = getattr(place, parent)
            setattr(place, last, value)
        data = bytes(self._definitions.typestore.serialize_cdr(message, kind))
        self._entries.append((self._log_time(stamp, len(self._entries)), topic, kind, data))

    def accel(self, stamp: int, a: Sequence[float], frame: str = "world") -> None:
        """Adds an AccelStamped message with an acceleration (3,) [m/s²]."""
        x, y, z = map(float, a)
        self.put("/slosh/accel", ACCEL, stamp, frame,
                 accel__linear__x=x, accel__linear__y=y, accel__linear__z=z)  # fmt: skip

    def surface(
        self, stamp: int, msh: float, topic: str = "/slosh/free_surface", **fields: Any
    ) -> None:
        """Adds a FreeSurface message with a maximum height [m]; other numbers are unknown."""
        self._definitions.hash(SURFACE)
        definitions = self._definitions.typestore.fielddefs[SURFACE][1]
        floats = [name for name, (node, what) in definitions
                  if node == Nodetype.BASE and what[0].startswith("float")]  # fmt: skip
        values = dict.fromkeys(floats, math.nan) | {MEASURED: float(msh)} | fields
        self.put(topic, SURFACE, stamp, "container", **values)

    def write(self, folder: Path, facts: dict[str, str] | None = None) -> Path:
        """Writes the bag in the order of log times and returns its folder."""
        with BagWriter(folder, self._definitions, facts or {}) as writer:
            for _, topic, kind, _ in self._entries:
                writer.add_topic(topic, kind)
            for log_ns, topic, _, data in sorted(self._entries, key=lambda entry: entry[0]):
                writer.write(topic, data, log_ns)
        return folder

    def _blank(self, kind: str) -> Any:
        store = self._definitions.typestore
        values: dict[str, Any] = {}
        for name, (node, what) in store.fielddefs[kind][1]:
            if node == Nodetype.NAME:
                values[name] = self._blank(what)
            elif node == Nodetype.BASE:
                values[name] = "" if what[0] == "string" else 0
            elif node == Nodetype.ARRAY:
                values[name] = np.zeros(what[1])
            else:
                values[name] = np.empty(0, dtype=np.float32)
        return store.types[kind](**values)
