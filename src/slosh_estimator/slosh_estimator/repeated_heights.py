"""Whether a camera hands out old pictures in turn: its heights repeat while the liquid must move.

A picture that is repeated with fresh noise, or coded anew, has no pixel in common with itself. But
what is measured in it stays, though the container's motion swings the liquid on.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.comparison import Expected, MeasuredPoint

WINDOW_NS = SECOND // 2
"""Images of so much time at most are looked at [ns]: some periods of a wave."""
LEAST_NS = 3 * SECOND // 20
"""And of so much at least: a crest stands for a shorter time [ns]."""
IN_TURN = 3
"""So many old pictures at most are handed out in turn."""
EACH = 4
"""So often each of them is seen before it counts as one."""
SAME, NOISES, ROUGHEST = 1.5e-4, 4.0, 6e-4
"""Heights of one picture differ by less than this, or so many standard deviations; at most by the
last [m]."""
WAVE = 2e-3
"""An old picture without such a wave is a side without a wave, see `wave_presence` [m]."""
MOVES, TIMES = 3e-3, 8.0
"""The liquid moves where the expected wave does by this [m] and so many times what is the same."""


class RepeatedHeights:
    """Takes both sides of moments in their order."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, complex, complex, float]] = deque()

    def look(self, measured: MeasuredPoint, expected: Expected) -> bool:
        """Whether the newest measurement is one of old pictures that come in turn."""
        height, wave = measured.msh, measured.wave
        if not (math.isfinite(height) and math.isfinite(expected.nonlinear)):
            return False
        both = math.isfinite(abs(wave)) and math.isfinite(abs(expected.wave))
        if both and not math.isfinite(measured.axis):
            told = wave, expected.wave
        else:  # a side view shows the component in the image plane alone
            told = complex(height), complex(expected.nonlinear)
        seen = self._seen
        if seen and not 0 < measured.stamp_ns - seen[-1][0] < WINDOW_NS:
            seen.clear()
        stddev = measured.stddev if math.isfinite(measured.stddev) else 0.0
        seen.append((measured.stamp_ns, *told, stddev))
        while measured.stamp_ns - seen[0][0] > WINDOW_NS:
            seen.popleft()
        long = measured.stamp_ns - seen[0][0] >= LEAST_NS
        return height > WAVE and long and self._repeats()

    def _repeats(self) -> bool:
        same = min(max(SAME, NOISES * max(one[3] for one in self._seen)), ROUGHEST)
        moves = max(MOVES, TIMES * same)
        if _spread([one[2] for one in self._seen]) <= moves:
            return False
        return any(self._in_turn(count, same, moves) for count in range(1, IN_TURN + 1))

    def _in_turn(self, count: int, same: float, moves: float) -> bool:
        """Whether so many pictures come in turn."""
        turns = list(self._turns(count))
        if len(turns[-1]) < EACH or any(
            _spread([one[1] for one in turn]) > same for turn in turns
        ):
            return False
        return max(_spread([one[2] for one in turn]) for turn in turns) > moves

    def _turns(self, count: int) -> Iterator[Sequence[tuple[int, complex, complex, float]]]:
        newest = list(reversed(self._seen))
        recent = sum(newest[0][0] - one[0] <= LEAST_NS for one in newest)
        newest = newest[: max(count * 2 * EACH, recent)]
        for first in range(count):
            yield list(islice(newest, first, None, count))


def _spread(values: Sequence[complex]) -> float:
    """Greatest distance from the first of them [m]."""
    return max(abs(value - values[0]) for value in values)
