"""Finds what each process of a node took in a recording, in its order, as the recording comes."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from slosh_bag.reader import BagMessage
from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py.node.journal import ANSWER, MESSAGE, MICROSECOND, checksum
from slosh_msgs_py.node.offline import Taken

KEPT_NS: Final = 30 * SECOND
"""So long behind its recording a message may be taken, ..."""
LATCHED: Final = 1000
"""... but of a topic with so few messages, such as settings, at any time."""


class RecentMessages:
    """The latest messages of a recording, found by topic and CRC-32."""

    def __init__(self) -> None:
        self._topics: dict[str, dict[int, tuple[int, bytes]]] = {}

    def add(self, message: BagMessage) -> None:
        """Adds a message; of equal ones the last counts."""
        known, check = self._topics.setdefault(message.topic, {}), checksum(message.data)
        known.pop(check, None)
        known[check] = (message.log_ns, message.data)
        if len(known) > LATCHED:
            oldest = next(iter(known))
            if message.log_ns - known[oldest][0] > KEPT_NS:
                del known[oldest]

    def find(self, topic: str, check: int) -> bytes | None:
        """Returns a message's serialised bytes; None: it was not recorded."""
        found = self._topics.get(topic, {}).get(check)
        return None if found is None else found[1]


class _Entry(NamedTuple):
    source: str
    check: int
    content: bytes
    now_ns: int
    steady_ns: int


class ProcessNotes:
    """The journal of one process of a node, up to the first thing that the recording lacks.

    Args:
        node: the node's name.
        log_ns: when its first journal was recorded [ns].
        begun_ns: the time of the first thing in it [ns].
        lacking: why not all of it can be replayed; empty: nothing is known to be missing.

    Attributes:
        until_ns: up to when what it published follows from what it took [ns]. It sent its last
            journal then, or took the last thing before the first that is lacking.
        taken: things so far.
    """

    def __init__(self, node: str, log_ns: int, begun_ns: int, lacking: str = "") -> None:
        self.node, self.log_ns, self.begun_ns, self.lacking = node, log_ns, begun_ns, lacking
        self.until_ns = begun_ns
        self.taken = 0
        self._count = 0  # entries
        self._entries: deque[_Entry] = deque()
        self._last: Taken | None = None

    def add(self, journal: Any, sent_ns: int, messages: RecentMessages) -> Iterator[Taken]:
        """Yields what is known to be taken, in order, with the next journal of the process."""
        missing = journal.first - self._count
        if missing and not self.lacking:
            self._lack(f"{missing} things of its journal")
        if self.lacking:
            return
        self._count += len(journal.source)
        for entry in _entries(journal):
            if entry.source == ANSWER:
                if self._last is not None:
                    question, answer = json.loads(entry.content)
                    answers = (*self._last.answers, (question, answer))
                    self._last = self._last._replace(answers=answers)
                continue
            content: bytes | None = entry.content
            if entry.source.startswith(MESSAGE):
                topic = entry.source.removeprefix(MESSAGE).partition(" ")[0]
                content = messages.find(topic, entry.check)
                if content is None:
                    yield from self.rest()
                    self._lack(f"a message on {topic}")
                    return
            yield from self.rest()
            self._last = Taken(entry.source, content or b"", entry.now_ns, entry.steady_ns)
        self.until_ns = sent_ns

    def rest(self) -> Iterator[Taken]:
        """Yields the thing that was taken last: its answers are complete."""
        if self._last is not None:
            self.taken += 1
            self.until_ns = max(self.until_ns, self._last.now_ns)
            yield self._last
            self._last = None

    def _lack(self, what: str) -> None:
        self.lacking = what


def begun_ns(journal: Any) -> int:
    """Returns the time of the first thing in a journal [ns]."""
    stamp = journal.header.stamp
    return int(stamp.sec * SECOND + stamp.nanosec)


def _entries(journal: Any) -> Iterator[_Entry]:
    base = begun_ns(journal)
    content, at = bytes(journal.content), 0
    rows = zip(
        journal.source.tolist(), journal.check.tolist(), journal.time.tolist(),
        journal.steady_time.tolist(), strict=True,
    )  # fmt: skip
    for index, check, since, steady in rows:
        source = journal.sources[index]
        own = b""
        if not source.startswith(MESSAGE):
            own, at = content[at : at + check], at + check
        yield _Entry(
            source, check, own, base + since * MICROSECOND, journal.steady + steady * MICROSECOND
        )
