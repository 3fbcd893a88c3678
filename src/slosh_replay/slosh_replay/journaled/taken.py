"""Finds what each process of a node took in a recording, in its order, as the recording comes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final

from slosh_bag.reader import BagMessage
from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py.journal_format import ANSWER, checksum, entries
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


class ProcessNotes:
    """The journal of one process of a node.

    Args:
        node: the node's name.
        log_ns: when its first journal was recorded [ns].
        begun_ns: the time of the first thing in it [ns].
        first: things that it had taken before.

    Attributes:
        lacking: the first thing that the recording lacks; empty: it has all.
        until_ns: up to when it is known what it took [ns]: it sent its last journal then.
        taken: things so far.
        count: things in its journals so far, and before them.
    """

    def __init__(self, node: str, log_ns: int, begun_ns: int, first: int = 0) -> None:
        self.node, self.log_ns, self.begun_ns = node, log_ns, begun_ns
        self.lacking = "the beginning of its journal" if first else ""
        self.until_ns = begun_ns
        self.taken = 0
        self.count = first
        self._last: Taken | None = None

    def add(self, journal: Any, sent_ns: int, messages: RecentMessages) -> Iterator[Taken]:
        """Yields what is known to be taken, in order, with the next journal of the process."""
        self.count += len(journal.source)
        for entry in entries(journal):
            if entry.source == ANSWER:
                if self._last is not None:
                    question, answer = json.loads(entry.content)
                    answers = (*self._last.answers, (question, answer))
                    self._last = self._last._replace(answers=answers)
                continue
            content: bytes | None = entry.content
            if entry.topic:
                content = messages.find(entry.topic, entry.check)
                if content is None:
                    self.lacking = self.lacking or f"a message on {entry.topic}"
            yield from self.rest()
            self._last = Taken(entry.source, content, entry.now_ns, entry.steady_ns)
        self.until_ns = sent_ns

    def rest(self) -> Iterator[Taken]:
        """Yields the thing that was taken last: its answers are complete."""
        if self._last is not None:
            self.taken += 1
            self.until_ns = max(self.until_ns, self._last.now_ns)
            yield self._last
            self._last = None
