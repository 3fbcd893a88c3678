"""Compares what a replayed node publishes on a topic with what was recorded, as both come."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagMessage, BagReader
from slosh_msgs_py.node.journal import whole_words
from slosh_replay.recording.inputs import stamps_of
from slosh_replay.replay.verification import Messages, Tally

_STAMP: Final = slice(4, 12)
"""Where a serialised message has the stamp of its header."""
_KEPT: Final = 20_000
"""Replayed messages that wait for a recorded one; of more the oldest were not recorded."""
_MOST_APPENDED: Final = 256
"""Bytes."""
UNTAKEN: Final = "what its node took is not in the recording"
Place = tuple[bytes, int]
"""The stamp of a message, as bytes, and its place among those of the same stamp."""


class Recorded(NamedTuple):
    """A recorded message: when it was sent [ns], and its serialised bytes."""

    sent_ns: int
    data: bytes


class ComparedOutput:
    """Compares the messages of one topic of one process.

    Args:
        reader: of the bag.
        topic: full name.
        message_type: of its messages.
        tally: counts how they compare.
    """

    def __init__(self, reader: BagReader, topic: str, message_type: str, tally: Tally) -> None:
        self._reader, self._topic, self._type, self._tally = reader, topic, message_type, tally
        self._ours, self._theirs = _Placed(), _Placed()

    def give(self, data: bytes) -> None:
        """Adds a message of the replayed node."""
        self._ours.add(data)

    def compare(self, recorded: Sequence[Recorded]) -> None:
        """Compares further recorded messages, and those that had no counterpart yet."""
        for message in recorded:
            self._theirs.add(message.data)
        ours, theirs = self._ours.messages, self._theirs.messages
        unlike: list[tuple[bytes, bytes]] = []
        shared = [place for place in theirs if place in ours]
        for place in shared:
            one, other = theirs.pop(place), ours.pop(place)
            if whole_words(one) != whole_words(other):
                unlike.append((one, other))
        same = len(shared) - len(unlike)
        self._tally.count(recorded=same, identical=same)
        if unlike:
            theirs_bytes, ours_bytes = zip(*unlike, strict=True)
            self._tally.pairs(
                self._columns(theirs_bytes),
                self._columns([self._exact(one) for one in ours_bytes]),
            )
        self._ours.forget()

    def finish(self, later: int) -> None:
        """Counts the recorded messages that the replay does not give.

        Args:
            later: number of those that the node sent after all that is known of what it took.
        """
        self._tally.count(missing=len(self._theirs.messages), extra=len(self._ours.messages))
        self._tally.leave_out(later, UNTAKEN)

    def _exact(self, data: bytes) -> bytes:
        """Cuts off what rclpy appends: it gives the most bytes that a message may need.

        Empty sequences of numbers at its end need fewer.
        """
        for more in range(0, _MOST_APPENDED, 4):
            cut = data[: len(data) - more]
            with contextlib.suppress(SloshBagError):
                self._reader.decode(BagMessage(self._topic, self._type, 0, 0, cut))
                return cut
        return data

    def _columns(self, messages: Sequence[bytes]) -> Messages:
        whole = [whole_words(data) for data in messages]
        length = np.array([len(data) for data in whole], np.int64)
        start = np.cumsum(length) - length
        times = np.zeros(len(whole), np.int64)
        buffer = np.frombuffer(b"".join(whole), np.uint8)
        block = MessageBlock(self._topic, self._type, times, times, start, length, buffer)
        columns = self._reader.columns(block)
        return Messages(stamps_of(columns), columns)


class _Placed:
    """Messages by stamp, and by their place among those of the same stamp."""

    def __init__(self) -> None:
        self.messages: dict[Place, bytes] = {}
        self._counts: Counter[bytes] = Counter()

    def add(self, data: bytes) -> None:
        stamp = data[_STAMP]
        self.messages[stamp, self._counts[stamp]] = data
        self._counts[stamp] += 1

    def forget(self) -> None:
        """Drops the oldest messages of many, and the counts of stamps long ago."""
        while len(self.messages) > _KEPT:
            del self.messages[next(iter(self.messages))]
        while len(self._counts) > _KEPT:
            del self._counts[next(iter(self._counts))]
