"""Determines order and arrival time of messages across all topics."""

from __future__ import annotations

from slosh_bag.nodes.topic_input import Received

STEP_NS = 50_000_000
"""From here on it is a step of the clock [ns], and no slewing."""
AHEAD_NS = 10_000_000
"""What was received so long after now was received before the clock was set back [ns]."""


class Arrivals:
    """Sorts messages by arrival while topics are polled one after the other.

    A message is held back until those that came before it on other topics must have been taken,
    and no longer than until the next call: a step of the clock holds nothing back for good.
    """

    def __init__(self) -> None:
        self._held: list[Received] = []

    def sort(self, taken: list[Received], settled: int) -> list[Received]:
        """Adds messages; returns, sorted by arrival, those that no later message can precede.

        Args:
            taken: of all topics, since the last call.
            settled: what came up to then has been taken, on every topic [ns].
        """
        # One pass over the topics may last for seconds: what was held since then is settled, too.
        until = max([settled, *(received.arrived_ns for received in self._held)])
        waiting = sorted([*self._held, *taken], key=lambda received: received.arrived_ns)
        self._held = [received for received in waiting if received.arrived_ns > until]
        return waiting[: len(waiting) - len(self._held)]

    def rest(self) -> list[Received]:
        """Returns the messages that were held back, in order of arrival."""
        held, self._held = self._held, []
        return held


class LogTimes:
    """Receive times of the system clock, corrected so that they never decrease.

    Bags are read by these times: of two stretches with the same ones nobody could tell which
    came first. Where the clock is set back they go on as if it had not been, until it is there
    again.

    Args:
        system_ns, steady_ns: both clocks' time [ns].
    """

    def __init__(self, system_ns: int, steady_ns: int) -> None:
        self._now = system_ns
        self._between = system_ns - steady_ns
        self._shift = self._shift_before = 0
        self._last = 0

    def look(self, system_ns: int, steady_ns: int) -> None:
        """Reads system clock and monotonic clock; call it before messages are polled."""
        step = system_ns - steady_ns - self._between
        self._now, self._between = system_ns, system_ns - steady_ns
        self._shift_before = self._shift
        if abs(step) > STEP_NS:
            self._shift = max(self._shift - step, 0)

    def of(self, received_ns: int) -> int:
        """Returns the log time for a message received at a system time [ns]."""
        before_the_step = received_ns > self._now + AHEAD_NS
        return received_ns + (self._shift_before if before_the_step else self._shift)

    def in_order(self, time_ns: int) -> int:
        """Returns a log time [ns], raised to the previous message's log time if that is later."""
        self._last = max(self._last, time_ns)
        return self._last
