"""Which topics of a bag belong together."""

from __future__ import annotations

from collections.abc import Mapping

from slosh_bag.reader import TopicInfo
from slosh_msgs_py import topics
from slosh_replay.recording import settings

_TYPES = {row.name: row.type for row in topics.TOPICS}
SURFACE = _TYPES[topics.FREE_SURFACE]
ESTIMATE = _TYPES[topics.ESTIMATE]
COMPARISON = _TYPES[topics.COMPARISON]
_OWN = {settings.TOPIC: settings.MESSAGE_TYPE, "estimate": ESTIMATE, "comparison": COMPARISON}
"""Topics of an estimator or a monitor: where there is one, there is a cell."""


class CellTopics:
    """Finds the topics of one cell by their last names, in its namespace or outside all cells.

    Args:
        recorded: topics of the bag; those without messages do not count.
        cell: the namespace; None: the first in which a cell was recorded.
    """

    def __init__(self, recorded: Mapping[str, TopicInfo], cell: str | None = None) -> None:
        self._topics = {name: info.message_type for name, info in recorded.items() if info.count}
        own = {
            _namespace(topic)
            for topic, kind in self._topics.items()
            if _OWN.get(_last(topic)) == kind
        }
        self._home = min(own, default=None) if cell is None else f"/{cell.strip('/')}".rstrip("/")
        self._others = own - {self._home}

    @property
    def cells(self) -> tuple[str, ...]:
        """Namespaces of the cells, the one that is read first."""
        return () if self._home is None else (self._home, *sorted(self._others))

    @property
    def is_there(self) -> bool:
        """Whether the cell has a topic at all."""
        return any(_namespace(topic) == self._home for topic in self._topics)

    def topic(self, name: str, message_type: str) -> str | None:
        """The cell's topic of that last name and type."""
        found = [
            topic
            for topic, kind in self._topics.items()
            if _last(topic) == name
            and kind == message_type
            and _namespace(topic) not in self._others
        ]
        return min(found, key=lambda topic: (_namespace(topic) != self._home, topic), default=None)

    def settle(self, topic: str) -> None:
        """Takes a topic's namespace for the cell, where none has been recorded."""
        if self._home is None:
            self._home = _namespace(topic)


def _namespace(topic: str) -> str:
    return topic.rpartition("/")[0]


def _last(topic: str) -> str:
    return topic.rpartition("/")[2]
