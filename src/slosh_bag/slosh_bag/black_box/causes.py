"""Detects the events in a cell's messages that start the writing of a bag."""

from __future__ import annotations

import math
from collections import deque
from typing import Final, NamedTuple

from slosh_bag.black_box.black_box import Cause, Happening
from slosh_msgs.msg import Calm, LimitEvent, SloshComparison

SIGMAS: Final = 2.0
"""A height exceeds a tolerance surely from so many of its standard deviations above it on."""
REMEMBERED: Final = 50
"""Answers of calm that are remembered: some seconds."""
WAITING: Final = 500
"""Heights that wait for the next answer."""


class _Height(NamedTuple):
    stamp_ns: int
    least: float
    name: str


class _Answer(NamedTuple):
    stamp_ns: int
    calm: bool
    at_rest: bool
    tolerance: float


class ComparisonWatch:
    """Detects when model and camera start to disagree, or can no longer be compared."""

    def __init__(self) -> None:
        self._disagrees = self._blind = False

    def take(self, comparison: SloshComparison, stamp_ns: int) -> list[Happening]:
        """Processes a SloshComparison message; returns the events that begin with it.

        Args:
            comparison: the message.
            stamp_ns: its stamp [ns].
        """
        found = []
        disagrees = bool(comparison.sides_disagree)
        blind = comparison.state == SloshComparison.STATE_BLIND
        if disagrees and not self._disagrees:
            text = "the measured and the estimated side disagree"
            found.append(Happening(Cause.DISAGREEMENT, stamp_ns, text))
        if blind and not self._blind:
            text = "nothing that is measured and estimated can be compared"
            found.append(Happening(Cause.BLIND, stamp_ns, text))
        self._disagrees, self._blind = disagrees, blind
        return found


def limit_happening(event: LimitEvent, stamp_ns: int) -> Happening | None:
    """Returns the event at the start of a limit violation, or None at its end.

    Args:
        event: the message.
        stamp_ns: its stamp [ns].
    """
    if event.kind != LimitEvent.KIND_START:
        return None
    disagrees = event.source == LimitEvent.SOURCE_DISAGREEMENT
    return Happening(Cause.DISAGREEMENT if disagrees else Cause.LIMIT, stamp_ns, event.description)


class CalmWatch:
    """Detects liquid that was reported calm but moves although the container is at rest.

    A height is held against the last answer before it, and judged when the next answer after it
    has come: that one tells whether the container has begun to move. One event is told until the
    liquid is no longer called calm.
    """

    def __init__(self) -> None:
        self._answers: deque[_Answer] = deque(maxlen=REMEMBERED)
        self._heights: deque[_Height] = deque(maxlen=WAITING)
        self._told = False

    def answer(self, calm: Calm, stamp_ns: int) -> list[Happening]:
        """Stores a report on calmness; returns events for calm reports found to be wrong."""
        if self._answers and stamp_ns < self._answers[-1].stamp_ns:
            self._answers.clear()  # another run of the estimator, or a clock that was set back
            self._heights.clear()
        at_rest = calm.reason not in (Calm.MOVING, Calm.STALE)
        self._answers.append(_Answer(stamp_ns, bool(calm.calm), at_rest, float(calm.tolerance)))
        self._told = self._told and bool(calm.calm)
        return self._judge()

    def height(self, name: str, stamp_ns: int, height: float, stddev: float) -> list[Happening]:
        """Processes a measured height; returns events for calm reports found to be wrong.

        Args:
            name: whose height it is, for people.
            stamp_ns: its moment [ns].
            height, stddev: with its standard deviation [m]; NaN: unknown.
        """
        if not math.isfinite(height):
            return []
        spread = stddev if math.isfinite(stddev) else 0.0
        self._heights.append(_Height(stamp_ns, height - SIGMAS * spread, name))
        return self._judge()

    def _judge(self) -> list[Happening]:
        newest_ns = self._answers[-1].stamp_ns if self._answers else -1
        due = [height for height in self._heights if height.stamp_ns < newest_ns]
        if not due:
            return []
        later = (height for height in self._heights if height.stamp_ns >= newest_ns)
        self._heights = deque(later, maxlen=WAITING)
        return [self._tell(height, before) for height in due if (before := self._wrong(height))]

    def _wrong(self, height: _Height) -> _Answer | None:
        """Returns the calm report that a height newly contradicts, or None if there is none."""
        at_ns = height.stamp_ns
        before = next((one for one in reversed(self._answers) if one.stamp_ns <= at_ns), None)
        follower = next(one for one in self._answers if one.stamp_ns > at_ns)
        if self._told or before is None or not follower.at_rest:
            return None
        if not before.calm or not before.at_rest:
            return None
        return before if height.least > before.tolerance else None

    def _tell(self, height: _Height, before: _Answer) -> Happening:
        self._told = True
        text = (
            f"called calm within {1e3 * before.tolerance:.1f} mm, but the {height.name} "
            f"height was at least {1e3 * height.least:.1f} mm and nothing moved"
        )
        return Happening(Cause.FALSE_CALM, height.stamp_ns, text)
