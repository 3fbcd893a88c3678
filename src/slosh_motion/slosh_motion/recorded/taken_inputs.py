"""Tells which recorded inputs a live estimator took, and when, by its journal, without ROS."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagMessage, BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Integers
from slosh_msgs_py.journal_format import begun_ns, checksum, entries

UNKNOWN, NOT_TAKEN = -1, -2
"""In place of a time: no journal covers the message; one does, and does not name it."""
LATE_NS: Final = 2 * SECOND
"""A message may be noted so long after it was recorded, ..."""
_MOST_UNSEEN: Final = 20_000
KEPT_NS: Final = 30 * SECOND
"""... and be recorded so long after it was noted."""


class Arrivals(NamedTuple):
    """When messages were taken.

    Attributes:
        times: (N,) UNKNOWN, NOT_TAKEN or the time [ns].
        lacking: rows before which messages lack that the estimator took.
    """

    times: Integers
    lacking: list[int]


class TakenInputs:
    """What an estimator took of its inputs, as far as its journals go.

    Args:
        reader: of the bag.
        journal: topic of the journals.
        node: whose journals count.

    Attributes:
        begun_ns: when it took the first message [ns]; far ahead: it has taken none so far.
    """

    def __init__(self, reader: BagReader, journal: str, node: str = "estimator") -> None:
        self._reader, self._node = reader, node
        self._journals: Iterator[BagMessage] = reader.messages([journal])
        self._next: BagMessage | None = next(self._journals, None)
        self._times: dict[tuple[str, int], int] = {}
        self._unseen: dict[str, deque[int]] = {}
        self._count = 0
        self._until_ns = -(2**62)  # the journals are complete up to here
        self._holes: deque[tuple[int, int]] = deque()
        self.begun_ns = 2**62

    def arrivals(self, block: MessageBlock) -> Arrivals:
        """Returns when the messages of a block were taken, and before which of them some lack."""
        self._read(int(block.log_ns[-1]) + LATE_NS)
        checks = [checksum(block.data(row)) for row in range(len(block))]
        rows = zip(checks, block.log_ns.tolist(), strict=True)
        times = [self._arrival(block.topic, check, log_ns) for check, log_ns in rows]
        return Arrivals(np.array(times, np.int64), self._lacking(block.topic, checks))

    def _lacking(self, topic: str, checks: list[int]) -> list[int]:
        """Returns the rows before which messages lack that the estimator took."""
        found, here = [], set(checks)
        waiting = self._unseen.setdefault(topic, deque())
        for row, check in enumerate(checks):
            if (topic, check) not in self._times or check not in waiting:
                continue
            before = list(iter(waiting.popleft, check))
            if not here.issuperset(before):
                found.append(row)
        return found

    def _arrival(self, topic: str, check: int, log_ns: int) -> int:
        found = self._times.get((topic, check))
        if found is not None:
            return found
        unknown = log_ns > self._until_ns or any(a <= log_ns <= b for a, b in self._holes)
        return UNKNOWN if unknown else NOT_TAKEN

    def _read(self, until_ns: int) -> None:
        """Reads the journals that were recorded up to a time [ns]."""
        while self._next is not None and self._next.log_ns <= until_ns:
            self._add(self._next)
            self._next = next(self._journals, None)
        while self._times and next(iter(self._times.values())) < until_ns - KEPT_NS:
            del self._times[next(iter(self._times))]
        while self._holes and self._holes[0][1] < until_ns - KEPT_NS:
            self._holes.popleft()

    def _add(self, message: BagMessage) -> None:
        journal = self._reader.decode(message)
        if journal.node != self._node:
            return
        if journal.first not in (0, self._count):  # what lies between is unknown
            self._holes.append((self._until_ns, begun_ns(journal) + LATE_NS))
        self._count = journal.first + len(journal.source)
        for entry in entries(journal):
            if entry.topic:
                self._times.pop((entry.topic, entry.check), None)
                self._times[entry.topic, entry.check] = entry.now_ns
                unseen = self._unseen.setdefault(entry.topic, deque(maxlen=_MOST_UNSEEN))
                unseen.append(entry.check)
                self._until_ns = max(self._until_ns, entry.now_ns)
                self.begun_ns = min(self.begun_ns, entry.now_ns)
