"""Selects the topics of a bag that a replay, a discovery or an export needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_motion.inputs.inputs import JOINTS, MESSAGE_TYPES, TOPIC_NAMES
from slosh_motion.recorded import settings
from slosh_motion.recorded.settings import NodeStart
from slosh_msgs_py import topics

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
        topics: finds all topics of the cell.
        input, surface: topics.
        estimate, comparison: topics of what was recorded live; None: there is none.
        starts: of the recorded nodes.
        facts: about the whole bag.
        state: topic of the estimator's states; None: none were recorded.
        journal: the same of what the nodes took.
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
        reader: of the bag.
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
            message_type: of its messages.
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
