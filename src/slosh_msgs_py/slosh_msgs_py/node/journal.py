"""Writes down all that a node takes, in order, so that a replay gives it the same again.

What a node publishes follows from what it has taken and when: the order of messages of different
topics, the ticks of its timers, requests, changed parameters, and what the graph has answered.
None of that can be derived from the recorded messages alone.
"""

from __future__ import annotations

import json
import time
from array import array
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from slosh_msgs.msg import Journal as JournalMessage
from slosh_msgs_py import qos, topics
from slosh_msgs_py.journal_format import ANSWER, MICROSECOND, PARAMETERS, checksum
from slosh_msgs_py.stamps import to_time

if TYPE_CHECKING:
    from rclpy.node import Node

PERIOD = 0.5
"""Time between two published journals [s]."""
MOST = 5000
"""Things in one published journal."""
_LONGEST = 2**32
_MOST_SOURCES = 256


class Journal:
    """Notes what a node takes, and when, and publishes it twice a second.

    A node uses the times noted here, which are whole microseconds, so that a replay has the same.

    Args:
        node: the node.

    Attributes:
        now_ns: time of the thing that was taken last, by the node's clock [ns].
        steady_ns: the same by the steady clock [ns].
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.now_ns = self.steady_ns = 0
        self._message = JournalMessage()
        self._sources: dict[str, int] = {}
        self._answers: dict[str, Any] = {}
        self._count = self._first = 0
        self._publisher: Any = None
        self._clear()

    def publish(self) -> None:
        """Begins to publish; the node exists from here on."""
        self._message.node = self._node.get_name()
        self._publisher = self._node.create_publisher(JournalMessage, topics.JOURNAL, qos.EVENT)

    def source(self, name: str) -> int:
        """Returns the index under which things of a source are noted."""
        index = self._sources.setdefault(name, len(self._sources))
        if index >= _MOST_SOURCES:
            raise ValueError(f"{name}: more than {_MOST_SOURCES} sources of one node")
        return index

    def take_message(self, source: int, data: bytes) -> None:
        """Notes a serialised message that is about to be used."""
        self._note(source, checksum(data))

    def take(self, source: int, content: bytes = b"") -> None:
        """Notes a tick, a request or a change of parameters that is about to be used."""
        self._note(source, len(content))
        self._content += content

    def take_values(self, values: Mapping[str, Any]) -> None:
        """Notes changed parameters that are about to be used."""
        self.take(self.source(PARAMETERS), json.dumps(dict(values)).encode())

    def noted(self, question: str, ask: Callable[[], Any]) -> Any:
        """Asks what no message tells while something is used; notes the answer if it is new."""
        found = ask()
        if question not in self._answers or self._answers[question] != found:
            self._answers[question] = found
            content = json.dumps([question, found]).encode()
            self._append(self.source(ANSWER), len(content), self.now_ns, self.steady_ns)
            self._content += content
        return found

    def flush(self) -> None:
        """Publishes what was noted since the last call; nothing where there is nothing."""
        if not self._source or self._publisher is None:
            return
        message = self._message
        message.header.stamp = to_time(max(self._base_ns, 0))
        message.first, message.steady = self._first, self._steady_ns
        message.sources = list(self._sources)
        message.source, message.check = self._source, self._check
        message.time, message.steady_time = self._time, self._steady
        message.content = array("B", self._content)
        self._publisher.publish(message)
        self._clear()

    def close(self) -> None:
        """Publishes what was noted last; the node ends."""
        self.flush()
        self._publisher = None

    def abandon(self) -> None:
        """Publishes nothing from here on: the context has ended, and with it the publisher."""
        self._publisher = None

    def _note(self, source: int, check: int) -> None:
        now_ns, steady_ns = self._clocks()
        self.now_ns, self.steady_ns = now_ns, steady_ns
        self._append(source, check, now_ns, steady_ns)

    def _append(self, source: int, check: int, now_ns: int, steady_ns: int) -> None:
        if not self._source:
            self._base_ns, self._steady_ns = now_ns, steady_ns
        since, steady = now_ns - self._base_ns, steady_ns - self._steady_ns
        late = since < 0 or max(since, steady) >= _LONGEST * MICROSECOND
        if late or len(self._source) >= MOST:
            self.flush()
            self._base_ns, self._steady_ns, since, steady = now_ns, steady_ns, 0, 0
        self._source.append(source)
        self._check.append(check)
        self._time.append(since // MICROSECOND)
        self._steady.append(steady // MICROSECOND)
        self._count += 1

    def _clocks(self) -> tuple[int, int]:
        """Returns the node's time and the steady time in whole microseconds [ns]."""
        clock = self._node.get_clock()
        now = clock.now().nanoseconds if clock.ros_time_is_active else time.time_ns()
        steady = time.monotonic_ns()
        return now - now % MICROSECOND, steady - steady % MICROSECOND

    def _clear(self) -> None:
        self._source, self._check = array("B"), array("I")
        self._time, self._steady = array("I"), array("I")
        self._content = bytearray()
        self._base_ns = self._steady_ns = 0
        self._first = self._count
