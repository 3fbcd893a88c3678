"""Reads a measured force and the motion of its container from bags and tables."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.rosbag_import import import_rosbag
from slosh_bag.interchange.topic_choice import find_topic
from slosh_bag.reader import BagReader
from slosh_base.files.errors import SloshFileError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.force.record import ForceRecord
from slosh_model.simulate import Inputs
from slosh_motion.inputs.inputs import JOINTS, MESSAGE_TYPES, TOPIC_NAMES, WantedInput
from slosh_motion.tables.columns import FOUND_OUT, TableOptions
from slosh_motion.tables.motion_table import ATTITUDE, MOTION, is_motion_table
from slosh_motion.tables.reading import read_table
from slosh_replay.tables.bag_table import NO_HEIGHTS, TableSettings, read_bag_table

FORCE = ("fx", "fy", "fz")
WRENCHES = (
    "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/Wrench", "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
)  # fmt: skip
"""Types that hold a force, the surest first; a twist holds it as its linear part."""
Tell = Callable[[str], object]


@dataclass(frozen=True, slots=True)
class ForceSource:
    """Options for reading force and motion from a recording.

    Attributes:
        topic: of the force; empty: the only one that can be.
        wanted: which motion, and by which robot; None: as recorded.
        tables: how tables are read.
    """

    topic: str = ""
    wanted: WantedInput | None = None
    tables: TableOptions = FOUND_OUT


def read_force(path: Path, source: ForceSource, tell: Tell) -> ForceRecord:
    """Reads the measured force and the container's motion from a file.

    Args:
        path: a table with t, ax, ay, az, fx, fy, fz; a bag, also a ROS 1 or rosbag2 one.
        source: how it is read.
        tell: is told what is assumed, one line each.

    Raises:
        SloshFileError, SloshBagError, SloshDiscoveryError: one line that says what is wrong.
        OSError: a file cannot be read.
    """
    if not path.exists():
        raise SloshDiscoveryError(f"{path}: no such file or folder")
    if is_motion_table(path):
        return _of_table(path, replace(source.tables, tell=tell))
    if path.suffix == ".mcap" or (path.is_dir() and any(path.rglob("*.mcap"))):
        return _of_bag(path, path, source, tell)
    with tempfile.TemporaryDirectory(prefix="slosh_force_") as room:
        bag = Path(room) / path.stem
        for line in import_rosbag(path, bag).lost:
            tell(f"{path}: {line}")
        return _of_bag(bag, path, source, tell)


def _of_table(path: Path, options: TableOptions) -> ForceRecord:
    table = read_table(path, _check_columns, options, may_be_blank=lambda name: name in FORCE)
    table.check_finite(lambda name: name in FORCE)
    table.check_time()
    acceleration, force = table.group(MOTION[1:]), table.group(FORCE)
    assert acceleration is not None
    assert force is not None
    t = table.column("t").copy()
    return ForceRecord(str(path), Inputs(t, acceleration, table.group(ATTITUDE)), t, force)


def _check_columns(path: Path, names: list[str]) -> None:
    missing = [name for name in (*MOTION, *FORCE) if name not in names]
    if missing:
        raise SloshFileError(
            f"{path}: column {missing[0]!r} is missing; a table for --force has "
            f"{', '.join(MOTION)} [s, m/s²] and {', '.join(FORCE)} [N]"
        )


def _of_bag(bag: Path, path: Path, source: ForceSource, tell: Tell) -> ForceRecord:
    reader = BagReader(bag)
    topic = _force_topic(path, reader, source.topic)
    wanted = _named_joints(reader, source.wanted, path, tell)
    kind = wanted.kind if wanted is not None else None
    try:
        found = read_bag_table(
            bag, TableSettings(kind=kind, measured=NO_HEIGHTS, absolute=True, inputs=wanted)
        )
    except SloshBagError as error:
        raise SloshBagError(str(error).replace(str(bag), str(path))) from None
    stamps, force = _forces(reader, topic)
    tell(f"{path}: force {topic}, motion {found.source}")
    for note in found.notes:
        tell(f"{path}: {note}")
    table, origin = found.table, round(float(found.table.t[0]) * SECOND)
    inputs = Inputs(table.t - origin / SECOND, table.acceleration, table.attitude)
    return ForceRecord(str(path), inputs, (stamps - origin) / SECOND, force)


def _force_topic(path: Path, reader: BagReader, name: str) -> str:
    kinds = {topic: info.message_type for topic, info in reader.topics().items() if info.count}
    if name:
        topic = find_topic(path, kinds, name)
        if kinds[topic] not in WRENCHES:
            raise SloshDiscoveryError(
                f"{path}: {topic} is {kinds[topic]}, which holds no force; one of "
                f"{', '.join(WRENCHES)} does"
            )
        return topic
    for kind in WRENCHES:
        found = sorted(topic for topic, own in kinds.items() if own == kind)
        if len(found) == 1:
            return found[0]
        if found:
            raise SloshDiscoveryError(
                f"{path}: holds several forces: choose one by --wrench {' or '.join(found)}"
            )
    raise SloshDiscoveryError(
        f"{path}: holds no force: no message of {' or '.join(WRENCHES)}; its topics: "
        f"{', '.join(sorted(kinds)) or 'none'}"
    )


def _forces(reader: BagReader, topic: str) -> tuple[Any, Array]:
    """Returns stamps (K,) [ns], from message headers if there are any, and forces (K, 3)."""
    stamps, rows = [], []
    for message in reader.messages({topic}):
        decoded = reader.decode(message)
        header = getattr(decoded, "header", None)
        own = 0 if header is None else header.stamp.sec * SECOND + header.stamp.nanosec
        stamps.append(own or message.log_ns)
        part = getattr(decoded, "wrench", getattr(decoded, "twist", decoded))
        vector = part.force if hasattr(part, "force") else part.linear
        rows.append((vector.x, vector.y, vector.z))
    return np.array(stamps, dtype=np.int64), np.array(rows, dtype=np.float64).reshape(-1, 3)


def _named_joints(
    reader: BagReader, wanted: WantedInput | None, path: Path, tell: Tell
) -> WantedInput | None:
    """Returns the requested input, with the joint names that the recording uses."""
    if wanted is None or not wanted.urdf or wanted.kind not in (None, JOINTS):
        return wanted
    kind = MESSAGE_TYPES[JOINTS]
    last = TOPIC_NAMES.get(JOINTS, JOINTS).strip("/")
    topics = [
        name for name, info in reader.topics().items()
        if info.message_type == kind and name.endswith(last)
    ]  # fmt: skip
    message = next(iter(reader.messages(set(topics[:1]))), None) if topics else None
    if message is None:
        return wanted
    recorded = list(reader.decode(message).name)
    known = _moving_joints(wanted.urdf)
    if set(known) & set(recorded) or len(known) != len(recorded):
        return wanted
    tell(
        f"{path}: the joints {', '.join(recorded)} are taken, in this order, for "
        f"{', '.join(known)} of the description, which has other names"
    )
    return wanted._replace(urdf=_renamed(wanted.urdf, dict(zip(known, recorded, strict=True))))


def _moving_joints(urdf: str) -> list[str]:
    body = re.sub(r"^\s*<\?xml.*?\?>", "", urdf, count=1, flags=re.DOTALL)
    try:
        root = ElementTree.fromstring(f"<all>{body}</all>")
    except ElementTree.ParseError:
        return []  # whoever reads it says what is wrong
    return [
        joint.get("name", "") for joint in root.iter("joint")
        if joint.get("type") not in (None, "fixed") and joint.find("mimic") is None
    ]  # fmt: skip


def _renamed(urdf: str, names: dict[str, str]) -> str:
    """Returns a robot description (URDF) with replaced joint names."""
    pattern: Sequence[str] = [re.escape(name) for name in names]
    quoted = re.compile(rf"""(<(?:joint|mimic)\b[^>]*?=\s*["'])({"|".join(pattern)})(["'])""")
    return quoted.sub(lambda m: f"{m[1]}{names[m[2]]}{m[3]}", urdf)
