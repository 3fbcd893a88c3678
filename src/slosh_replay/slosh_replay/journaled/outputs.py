"""Compares what a replayed node publishes on a topic with what was recorded, as both come."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Sequence
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagMessage, BagReader
from slosh_estimator.validity import EstimateFlag
from slosh_motion.recorded.inputs import stamps_of
from slosh_msgs_py import topics
from slosh_msgs_py.journal_format import whole_words
from slosh_replay.replay.verification import Messages, Tally

_TYPES = {row.name: row.type for row in topics.TOPICS}
_STAMP: Final = slice(4, 12)
"""Where a serialised message has the stamp of its header."""
_KEPT: Final = 20_000
"""Replayed messages that wait for a recorded one; of more the oldest were not recorded."""
_MOST_APPENDED: Final = 256
"""Bytes."""
UNTAKEN: Final = "what its node took is not in the recording"
T = TypeVar("T")
Place = tuple[bytes, int]
"""The stamp of a message, as bytes, and its place among those of the same stamp."""


CONTRADICTED: Final = np.uint16(EstimateFlag.INPUT_CONTRADICTED)
"""Says what a second source showed so far, which no state holds."""
COUNTED: Final = {
    _TYPES[topics.ESTIMATE]: ("samples_dropped",),
    _TYPES[topics.COMPARISON]: (
        "sigma_linear", "sigma_nonlinear", "epsilon_linear", "epsilon_nonlinear", "count", "state",
        "sides_disagree",
    ),
}  # fmt: skip
"""Fields that depend on all since the start, which no state holds."""


class Recorded(NamedTuple):
    """A recorded message: when it was sent [ns], and its serialised bytes."""

    sent_ns: int
    data: bytes


class _Given(NamedTuple):
    """A replayed message, and whether it follows from what the recording has."""

    data: bytes
    known: bool


class ComparedOutput:
    """Compares the messages of one topic of one process.

    Args:
        reader: of the bag.
        topic: full name.
        message_type: of its messages.
        tally: counts how they compare.

    Attributes:
        kind: type of the messages.
        unknown_since: when the node took what the recording lacks [ns], until its state is known
            again; None: it is known.
    """

    def __init__(self, reader: BagReader, topic: str, message_type: str, tally: Tally) -> None:
        self._reader, self._topic, self.kind, self._tally = reader, topic, message_type, tally
        self._ours, self._theirs = _Placed[_Given](), _Placed[Recorded]()
        self.unknown_since: int | None = None
        self._unknown: list[tuple[int, int]] = []

    def lose(self, from_ns: int) -> None:
        """Compares nothing from a time [ns] on, until `find`."""
        if self.unknown_since is None:
            self.unknown_since = from_ns

    def find(self, until_ns: int) -> None:
        """Compares again what is given from here on; the node goes on at a time [ns]."""
        if self.unknown_since is not None:
            self._unknown.append((self.unknown_since, until_ns))
            self.unknown_since = None

    def give(self, data: bytes) -> None:
        """Adds a message of the replayed node."""
        self._ours.add(data, _Given(data, self.unknown_since is None))

    def compare(self, recorded: Sequence[Recorded]) -> None:
        """Compares further recorded messages, and those that had no counterpart yet."""
        for message in recorded:
            self._theirs.add(message.data, message)
        ours, theirs = self._ours.messages, self._theirs.messages
        unlike: list[tuple[bytes, bytes]] = []
        same = unknown = 0
        for place in [place for place in theirs if place in ours]:
            one, other = theirs.pop(place).data, ours.pop(place)
            if not other.known:
                unknown += 1
            elif whole_words(one) == whole_words(other.data):
                same += 1
            else:
                unlike.append((one, other.data))
        self._tally.count(recorded=same, identical=same)
        self._tally.leave_out(unknown, UNTAKEN)
        if unlike:
            theirs_bytes, ours_bytes = zip(*unlike, strict=True)
            self._tally.pairs(
                *self._told(
                    self._columns(theirs_bytes),
                    self._columns([self._exact(one) for one in ours_bytes]),
                )
            )
        self._ours.forget()
        while len(theirs) > _KEPT:
            self._miss([theirs.pop(next(iter(theirs))).sent_ns])

    def finish(self, later: int) -> None:
        """Counts the recorded messages that the replay does not give.

        Args:
            later: number of those that the node sent after all that is known of what it took.
        """
        self._miss([one.sent_ns for one in self._theirs.messages.values()])
        self._tally.count(extra=sum(one.known for one in self._ours.messages.values()))
        self._tally.leave_out(later, UNTAKEN)

    def _miss(self, sent: Sequence[int]) -> None:
        """Counts recorded messages that the replay does not give, by when they were sent [ns]."""
        since = self.unknown_since
        spans = [*self._unknown, *([] if since is None else [(since, 2**63 - 1)])]
        unknown = sum(any(begin <= one <= end for begin, end in spans) for one in sent)
        self._tally.count(missing=len(sent) - unknown)
        self._tally.leave_out(unknown, UNTAKEN)

    def _told(self, theirs: Messages, ours: Messages) -> tuple[Messages, Messages]:
        """Drops, behind what the recording lacks, what no state tells of the time before."""
        counted = COUNTED.get(self.kind, ())
        if not self._unknown or not counted:
            return theirs, ours
        both = [dict(one.columns) for one in (theirs, ours)]
        for columns in both:
            if "flags" in columns:
                columns["flags"] = columns["flags"] & ~CONTRADICTED
        kept = {name: column for name, column in both[1].items() if name not in counted}
        return theirs._replace(columns=both[0]), ours._replace(columns=kept)

    def _exact(self, data: bytes) -> bytes:
        """Cuts off what rclpy appends: it gives the most bytes that a message may need.

        Empty sequences of numbers at its end need fewer.
        """
        for more in range(0, _MOST_APPENDED, 4):
            cut = data[: len(data) - more]
            with contextlib.suppress(SloshBagError):
                self._reader.decode(BagMessage(self._topic, self.kind, 0, 0, cut))
                return cut
        return data

    def _columns(self, messages: Sequence[bytes]) -> Messages:
        whole = [whole_words(data) for data in messages]
        length = np.array([len(data) for data in whole], np.int64)
        start = np.cumsum(length) - length
        times = np.zeros(len(whole), np.int64)
        buffer = np.frombuffer(b"".join(whole), np.uint8)
        block = MessageBlock(self._topic, self.kind, times, times, start, length, buffer)
        columns = self._reader.columns(block)
        return Messages(stamps_of(columns), columns)


class _Placed(Generic[T]):
    """Messages by stamp, and by their place among those of the same stamp."""

    def __init__(self) -> None:
        self.messages: dict[Place, T] = {}
        self._counts: Counter[bytes] = Counter()

    def add(self, data: bytes, message: T) -> None:
        stamp = data[_STAMP]
        self.messages[stamp, self._counts[stamp]] = message
        self._counts[stamp] += 1

    def forget(self) -> None:
        """Drops the oldest messages of many, and the counts of stamps long ago."""
        while len(self.messages) > _KEPT:
            del self.messages[next(iter(self.messages))]
        while len(self._counts) > _KEPT:
            del self._counts[next(iter(self._counts))]
