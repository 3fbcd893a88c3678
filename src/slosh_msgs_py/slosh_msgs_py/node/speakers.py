"""Detects several publishers on a topic from their messages' sequence numbers.

Each publisher numbers its messages, and the middleware hands the numbers over, though not whose
they are. One publisher's numbers rise, by as much more than one as messages were lost in the time
between; two publishers' numbers jump to and fro. A second publisher is matched before its first
message can come: from then on each number that is not the next one is a second publisher's, and
the numbers after the moment of the match are doubtful for a while, whatever they are.

One that takes the place of another is none beside it: it begins when the other is silent.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from slosh_base.files.nanoseconds import SECOND

BESIDE_NS = 2 * SECOND
"""Two publishers speak at the same time where both spoke within this time."""
FORGOTTEN_NS = 30 * SECOND
"""A publisher that was silent for so long has ended; a number that follows its last is chance."""
PAUSE_NS, PAUSES = SECOND // 20, 4.0
"""After a silence of this time and so many intervals a new one takes the place of another."""
LOST, LOST_SHARE = 20, 2.0
"""So many messages may be lost at once, and so many times what the time between allows."""
MOST = 8
"""Publishers that are told apart."""


class SpeakerWatch:
    """Tracks the sequence numbers of a topic's messages to detect several publishers.

    Attributes:
        contested: whether several publishers speak, as of the newest message.
    """

    def __init__(self) -> None:
        self.contested = False
        self._own = _Stream(0, 0)
        self._others: list[_Stream] = []
        self._begun = False
        self._matched = 1
        self._joined_ns = -BESIDE_NS

    def take(self, number: int | None, arrival_ns: int, matched: int = 1) -> bool:
        """Tracks a message's sequence number; returns whether several publishers are active.

        Args:
            number: that its publisher gave it; None: the middleware tells none.
            arrival_ns: when it was received [ns].
            matched: publishers that the subscription has.
        """
        if not number:
            return False
        own = self._own
        if matched != self._matched:
            if matched > self._matched and not (self._begun and own.is_silent(arrival_ns)):
                self._joined_ns = arrival_ns
            self._matched = matched
        if number == own.number + 1:  # as nearly always
            own.follow(number, arrival_ns)
        elif not self._begun or matched > 1 or not own.fits(number, arrival_ns):
            self._change(number, arrival_ns)
        else:
            own.follow(number, arrival_ns)
        self._look(arrival_ns)
        return self.contested

    def _change(self, number: int, arrival_ns: int) -> None:
        """Handles a message that comes from a different publisher than the previous one."""
        before = self._own
        known = next((one for one in self._others if one.fits(number, arrival_ns)), None)
        if known is not None:
            self._others.remove(known)
            known.follow(number, arrival_ns)
        replaced = known is None and before.is_silent(arrival_ns)
        if self._begun and not replaced:
            self._others = [before, *self._others][: MOST - 1]
        self._own, self._begun = known or _Stream(number, arrival_ns), True

    def _look(self, now_ns: int) -> None:
        self.contested = now_ns - self._joined_ns < BESIDE_NS
        if self._others:
            self._others = [one for one in self._others if now_ns - one.at_ns < FORGOTTEN_NS]
            self.contested |= any(now_ns - one.at_ns < BESIDE_NS for one in self._others)


class _Stream:
    """Sequence number and timing of the messages of one publisher.

    Attributes:
        number, at_ns: of its newest message, and when that was received [ns].
        interval_ns: usual time between two messages [ns]; 0: not known.
    """

    __slots__ = ("at_ns", "interval_ns", "number")

    def __init__(self, number: int, at_ns: int) -> None:
        self.number, self.at_ns, self.interval_ns = number, at_ns, 0.0

    def follow(self, number: int, at_ns: int) -> None:
        """Updates sequence number and timing with the publisher's next message."""
        spacing = (at_ns - self.at_ns) / (number - self.number)
        self.interval_ns += (spacing - self.interval_ns) * (0.1 if self.interval_ns else 1.0)
        self.number, self.at_ns = number, at_ns

    def fits(self, number: int, at_ns: int) -> bool:
        """Whether a message could be the publisher's next message, allowing for lost messages."""
        missing = number - self.number - 1
        if missing < 0:
            return False
        if missing <= LOST:
            return True
        passed = at_ns - self.at_ns
        return self.interval_ns > 0.0 and missing <= LOST_SHARE * passed / self.interval_ns

    def is_silent(self, now_ns: int) -> bool:
        """Whether the publisher's next message is overdue."""
        return now_ns - self.at_ns > max(PAUSE_NS, PAUSES * self.interval_ns)


class WithInfo:
    """Callback wrapper that passes on message and message info with every executor.

    The executor finds out from the signature what a callback wants. rclpy's events executor then
    hands over both as one pair, the others as two arguments.
    """

    def __init__(self, use: Callable[[Any, Mapping[str, Any]], None]) -> None:
        self._use = use
        self.__signature__ = inspect.signature(use)

    def __call__(self, *given: Any) -> None:
        """Calls the wrapped callback with a message and its info."""
        message, info = given if len(given) == 2 else given[0]
        self._use(message, info)
