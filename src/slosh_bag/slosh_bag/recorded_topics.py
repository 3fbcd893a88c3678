"""Selects the topics to record, with reasons why other topics are left out.

By default these are the topics of one cell: those of the table `slosh_msgs_py.topics` in its
namespace, what its nodes read and publish under whatever names, and the shared topics, such as
/tf. Raw images are left out while the same images are recorded compressed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Final

from slosh_bag.errors import SloshBagError
from slosh_msgs_py import topics
from slosh_msgs_py.topics import Publishers, Topic, TopicRole

RAW: Final = "sensor_msgs/msg/Image"
COMPRESSED_ENDING: Final = "/compressed"
GRACE: Final = 1.0
"""So long raw images wait for a publisher of compressed ones [s]."""
_OF_EVERY_NODE, _HIDDEN = "rcl_interfaces/", "/_"
_OF_THE_CELL = {
    row.type
    for row in topics.TOPICS
    if row.publishers is Publishers.ONE and row.type.startswith("slosh_msgs/")
}
"""Types that only a cell's node publishes, whatever the topic's name."""
_INPUTS = {row.type for row in topics.TOPICS if row.role is TopicRole.INPUT} - {
    row.type for row in topics.TOPICS if row.publishers is Publishers.MANY
}


@dataclass(frozen=True, slots=True)
class TopicSelection:
    """The topics selected for recording, and the reasons why other topics are left out.

    Attributes:
        recorded: type by topic.
        left_out: why a topic is not recorded that was asked for, by topic.
        others: topics that nobody has asked for.
    """

    recorded: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    others: tuple[str, ...] = ()


class TopicChoice:
    """Rules that select the topics to record: namespace and name patterns.

    Args:
        namespace: of the cell.
        include: regular expression of topics to record beside the cell's; empty: none.
        exclude: regular expression of topics to leave out; empty: none.
        raw_images: record raw images also where compressed ones are recorded.

    Raises:
        SloshBagError: an expression is none.
    """

    def __init__(
        self, namespace: str, include: str = "", exclude: str = "", *, raw_images: bool = False
    ) -> None:
        self._home = f"{namespace.rstrip('/')}/"
        rows = [row for row in topics.TOPICS if row.recorded and row.is_absolute]
        self._shared = {row.name: row for row in rows}
        self._include = _pattern("topics", include)
        self._exclude = _pattern("exclude", exclude)
        self._raw_images = raw_images
        self._alone_since: dict[str, float] = {}  # raw images without compressed ones
        self._used: set[str] = set()

    def wants(self, topic: str) -> bool:
        """Whether the rules select a topic, regardless of topics that could replace it."""
        return self._is_wanted(topic) and not self._is_excluded(topic)

    def has_one_publisher(self, topic: str, message_type: str) -> bool:
        """Whether a topic may have only one publisher."""
        row = self._row(topic)
        if row is not None and row.type == message_type:
            return row.publishers is Publishers.ONE
        return message_type in _OF_THE_CELL or (topic in self._used and message_type in _INPUTS)

    def choose(
        self,
        graph: Mapping[str, str],
        used: Collection[str],
        publishers: Callable[[str], int],
        now: float,
    ) -> TopicSelection:
        """Returns the topics to record now; call it again when topics appear or disappear.

        Args:
            graph: message type by topic.
            used: topics that the cell's nodes read or publish.
            publishers: number of a topic's publishers.
            now: steady time [s].
        """
        self._used |= set(used)  # a node that has ended may come back
        recorded, left_out, others = {}, {}, []
        for topic, kind in sorted(graph.items()):
            told = not (kind.startswith(_OF_EVERY_NODE) or _HIDDEN in topic)
            if not self._is_wanted(topic):
                others += [topic] * told
            elif self._is_excluded(topic):
                if told:
                    left_out[topic] = "excluded by the parameter exclude"
            elif publishers(topic):
                reason = self._raw_reason(topic, kind, graph, publishers, now)
                if reason:
                    left_out[topic] = reason
                else:
                    recorded[topic] = kind
            else:
                self._alone_since.pop(topic, None)
        return TopicSelection(recorded, left_out, tuple(others))

    def _is_wanted(self, topic: str) -> bool:
        names = (topic, topic.removesuffix(COMPRESSED_ENDING))
        return any(
            self._row(name) is not None
            or name in self._used
            or (self._include is not None and bool(self._include.search(name)))
            for name in names
        )

    def _row(self, topic: str) -> Topic | None:
        """Returns a topic's row in the table of topics if it is to be recorded, otherwise None."""
        if not topic.startswith(self._home):
            return self._shared.get(topic)
        row = topics.row_of(topic.removeprefix(self._home))
        return row if row is not None and row.recorded else None

    def _is_excluded(self, topic: str) -> bool:
        return self._exclude is not None and bool(self._exclude.search(topic))

    def _raw_reason(
        self,
        topic: str,
        kind: str,
        graph: Mapping[str, str],
        publishers: Callable[[str], int],
        now: float,
    ) -> str:
        """Returns why raw images are not recorded; empty if they are recorded."""
        if self._raw_images or kind != RAW:
            return ""
        compressed = topic + COMPRESSED_ENDING
        if compressed in graph and not self._is_excluded(compressed) and publishers(compressed):
            self._alone_since.pop(topic, None)
            return f"{compressed} is recorded, with the same images"
        if now - self._alone_since.setdefault(topic, now) < GRACE:
            return f"waits {GRACE:g} s for compressed images"
        return ""


def _pattern(name: str, text: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise SloshBagError(
            f"parameter {name} = {text!r}: not a regular expression: {error}"
        ) from None
