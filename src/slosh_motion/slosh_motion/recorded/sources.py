"""Selects the topics of a bag that a replay, a discovery or an export needs; its metadata."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from slosh_bag.black_box.black_box import EVENTS
from slosh_bag.black_box.event_bags import noted_events
from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_bag.recorder import LOST, LOST_BY_TOPIC, PUBLISHERS, SEVERAL
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.inputs import JOINTS, MESSAGE_TYPES, TOPIC_NAMES
from slosh_motion.recorded import settings
from slosh_motion.recorded.settings import NodeStart
from slosh_msgs_py import topics

CLOCKS: Final = "clocks"
UNRELATED: Final = "unrelated"
TABLE_COLUMNS: Final = "table_columns"
"""Names of the columns of the motion table that a bag was made of."""
TABLE_ORIGIN: Final = "table_origin_ns"
"""The stamp at that table's t = 0 [ns]."""
CONTAINER_RADIUS: Final = "container_radius"
CONTAINER_FILL_HEIGHT: Final = "container_fill_height"


def clocks_unrelated(facts: Mapping[str, str]) -> bool:
    """Returns whether the stamps of inputs and heights come from unrelated clocks."""
    return facts.get(CLOCKS) == UNRELATED


def lost_messages(facts: Mapping[str, str]) -> dict[str, int]:
    """Returns the number of lost messages by topic, as far as the recorder knew.

    Those of which the topic is not known stand under an empty name.
    """
    counts = _json_object(facts.get(LOST_BY_TOPIC, ""))
    if counts and all(isinstance(count, int) for count in counts.values()):
        return counts
    total = facts.get(LOST, "0")
    return {"": int(total)} if total.isdecimal() and int(total) else {}


def event_lines(facts: Mapping[str, str], start_ns: int) -> tuple[str, ...]:
    """Returns one line for each event that caused the bag to be written.

    Args:
        start_ns: the zero of the times that are told [ns].
    """
    return tuple(
        f"event {event.cause} at {1e-9 * (event.stamp_ns - start_ns):.2f} s: {event.text}"
        for event in noted_events(facts.get(EVENTS, ""))
    )


def mixed_topics(facts: Mapping[str, str]) -> frozenset[str]:
    """Returns the topics on which several publishers sent although one is allowed."""
    return frozenset(filter(None, facts.get(SEVERAL, "").split(",")))


def shared_topics_line(facts: Mapping[str, str]) -> str:
    """Describes topics that wrongly have several publishers; empty if there are none."""
    topics = facts.get(SEVERAL, "")
    if not topics:
        return ""
    nodes = _json_object(facts.get(PUBLISHERS, ""))
    named = ", ".join(_with_nodes(topic, nodes.get(topic)) for topic in topics.split(","))
    return (
        f"several publishers were mixed on {named}, as when two cells share a namespace: their "
        "messages cannot be separated; stop one publisher, or give it another namespace or "
        "ROS_DOMAIN_ID"
    )


def _with_nodes(topic: str, nodes: Any) -> str:
    """Formats a topic with the names of its publishing nodes."""
    if not isinstance(nodes, list) or not nodes:
        return topic
    counts = Counter(str(node) for node in nodes)
    named = (f"{count} x {node}" if count > 1 else node for node, count in counts.items())
    return f"{topic} (of {', '.join(named)})"


def _json_object(text: str) -> dict[str, Any]:
    """Parses a JSON object; returns an empty one if the text is invalid."""
    try:
        document = json.loads(text)
    except ValueError:
        return {}
    return document if isinstance(document, dict) else {}


def noted_container(facts: Mapping[str, str]) -> Cylinder | None:
    """Returns the container in the bag's metadata, or None if it has none.

    Raises:
        SloshModelError: they tell of an impossible one.
    """
    try:
        radius, fill_height = float(facts[CONTAINER_RADIUS]), float(facts[CONTAINER_FILL_HEIGHT])
    except (KeyError, ValueError):
        return None
    return Cylinder(radius, fill_height)


_TYPES = {row.name: row.type for row in topics.TOPICS}
SURFACE = _TYPES[topics.FREE_SURFACE]
ESTIMATE = _TYPES[topics.ESTIMATE]
TRAY = _TYPES[topics.TRAY_ESTIMATE]
COMPARISON = _TYPES[topics.COMPARISON]
_OWN = {settings.TOPIC: settings.MESSAGE_TYPE, "estimate": ESTIMATE, "comparison": COMPARISON}
"""Topics of an estimator or a monitor: where there is one, there is a cell."""
_SHARED = {row.name for row in topics.TOPICS if row.is_absolute}


class Sources(NamedTuple):
    """Topics of a bag for a replay, with the bag's metadata.

    Attributes:
        kind: of the input, see `slosh_motion.inputs.inputs`.
        estimate, comparison: topics of what was recorded live; None: there is none.
        state: topic of the estimator's states; None: none were recorded.
    """

    kind: str
    topics: CellTopics
    input: str
    surface: str | None
    estimate: str | None
    comparison: str | None
    starts: tuple[NodeStart, ...]
    facts: Mapping[str, str]
    state: str | None = None
    journal: str | None = None

    def without_answers_to_others(self) -> Sources:
        """Drops recorded results that were computed from an input that is not replayed."""
        started = settings.first(self.starts, "estimator")
        if started is None or started.parameters.get("input", self.kind) == self.kind:
            return self
        return self._replace(estimate=None, comparison=None, state=None)


def find_sources(
    path: Path, reader: BagReader, kind: str | None = None, cell: str | None = None
) -> Sources:
    """Selects the topics of a bag that a replay reads or compares with.

    Args:
        path: of the bag, for errors.
        kind: of the input; None: what the recorded estimator read, or the first that there is.
        cell: namespace of the topics; None: the bag's only or first cell.

    Raises:
        SloshBagError: there is no input, or no such cell.
    """
    found = CellTopics(reader, cell)
    if cell is not None and not found.is_there:
        raise SloshBagError(f"{path}: holds no topic of a cell {cell}")
    started = settings.first(found.starts, "estimator")
    if kind is None and started is not None:
        kind = started.parameters.get("input")
    wanted = list(MESSAGE_TYPES) if kind is None else [kind]
    if kind is None and found.topic("robot_description", _TYPES[topics.ROBOT_DESCRIPTION]) is None:
        # Joints tell nothing without the robot's description.
        wanted.sort(key=lambda name: name == JOINTS)
    for name in wanted:
        last = TOPIC_NAMES.get(name, name).strip("/")
        topic = found.topic(last, MESSAGE_TYPES.get(name, ""))
        if topic is not None:
            found.settle(topic)
            return Sources(
                name,
                found,
                topic,
                found.topic("free_surface", SURFACE),
                found.topic("estimate", ESTIMATE),
                found.topic("comparison", COMPARISON),
                found.starts,
                reader.metadata(),
                found.topic(topics.ESTIMATOR_STATE, _TYPES[topics.ESTIMATOR_STATE]),
                found.topic(topics.JOURNAL, _TYPES[topics.JOURNAL]),
            )
    where = f" for the cell {found.cells[0] or '/'}" if len(found.cells) > 1 else ""
    told = found.told(TOPIC_NAMES.get(wanted[0], wanted[0])) if len(wanted) == 1 else ""
    named = f" (the estimator read {told})" if told else ""
    raise SloshBagError(
        f"{path}: holds no message of {', '.join(wanted)}{named}{where}; the model has no input"
    )


class CellTopics:
    """Finds a robot cell's topics: as its nodes told with their settings, otherwise by name.

    A node tells by which full names it reads and publishes, so topics of a robot (`remap`) are
    found. Others are found by the last part of their names, also outside the cell's namespace.

    Args:
        reader: of the bag; topics without messages do not count.
        cell: the namespace; None: the first in which a cell was recorded.

    Attributes:
        starts: the settings messages of the cell's nodes in order; empty if none were recorded.

    Raises:
        SloshBagError: the bag or what a node says in it cannot be read.
    """

    def __init__(self, reader: BagReader, cell: str | None = None) -> None:
        recorded = reader.topics()
        self._topics = {name: info.message_type for name, info in recorded.items() if info.count}
        told = {
            _namespace(topic): tuple(settings.read_starts(reader, topic))
            for topic, kind in self._topics.items()
            if _last(topic) == settings.TOPIC and kind == settings.MESSAGE_TYPE
        }
        names = {home: _full_names(starts) for home, starts in told.items()}
        claimed = {full for of_cell in names.values() for fulls in of_cell.values()
                   for full in fulls}  # fmt: skip
        own = names.keys() | {
            _namespace(topic)
            for topic, kind in self._topics.items()
            if _OWN.get(_last(topic)) == kind and topic not in claimed
        }
        self._home = min(own, default=None) if cell is None else f"/{cell.strip('/')}".rstrip("/")
        self._others = own - {self._home}
        self.starts: tuple[NodeStart, ...] = told.get(self._home or "", ())
        self._names = names.get(self._home or "", {})
        mine = {full for fulls in self._names.values() for full in fulls}
        self._foreign = claimed - mine - _SHARED

    @property
    def cells(self) -> tuple[str, ...]:
        """Namespaces of the cells, with the selected one first."""
        return () if self._home is None else (self._home, *sorted(self._others))

    @property
    def is_there(self) -> bool:
        """Whether the bag contains any topic of the cell."""
        return any(_namespace(topic) == self._home for topic in self._topics)

    def told(self, name: str) -> str:
        """Returns a topic's full name as the cell's nodes told it; empty if none did."""
        return next(iter(self._names.get(name.strip("/"), ())), "")

    def topic(self, name: str, message_type: str) -> str | None:
        """Returns the cell's topic of a type; None if there is none.

        Args:
            name: as nodes tell it, or the last part of the topic's name.
        """
        for full in self._names.get(name.strip("/"), ()):
            if self._topics.get(full) == message_type:
                return full
        found = [
            topic
            for topic, kind in self._topics.items()
            if _last(topic) == name.rpartition("/")[2]
            and kind == message_type
            and _namespace(topic) not in self._others
            and topic not in self._foreign
        ]
        return min(found, key=lambda topic: (_namespace(topic) != self._home, topic), default=None)

    def settle(self, topic: str) -> None:
        """Selects the cell of a topic, by its namespace, if no cell is selected yet."""
        if self._home is None:
            self._home = _namespace(topic)


def _full_names(starts: Sequence[NodeStart]) -> dict[str, tuple[str, ...]]:
    """Returns the full names of the topics that nodes told, by their names in the cell."""
    found: dict[str, tuple[str, ...]] = {}
    for start in starts:
        for name, full in start.topics.items():
            key = name.strip("/")
            found[key] = tuple(dict.fromkeys((*found.get(key, ()), full)))
    return found


def _namespace(topic: str) -> str:
    return topic.rpartition("/")[0]


def _last(topic: str) -> str:
    return topic.rpartition("/")[2]
