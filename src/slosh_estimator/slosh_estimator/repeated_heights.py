"""Detects a camera that repeats old images while the liquid must be moving.

A picture that is repeated with fresh noise, or coded anew, has no pixel in common with itself. But
what is measured in it stays, though the container's motion swings the liquid on.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice

from slosh_estimator.comparison import Expected, MeasuredPoint
from slosh_estimator.tuning import TUNING


class RepeatedHeights:
    """Compares successive measured heights with modelled ones to detect repeated images."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, complex, complex, float]] = deque()

    def look(self, measured: MeasuredPoint, expected: Expected) -> bool:
        """Returns whether the newest measurement belongs to a cycle of repeated old images."""
        height, wave = measured.msh, measured.wave
        if not (math.isfinite(height) and math.isfinite(expected.nonlinear)):
            return False
        both = math.isfinite(abs(wave)) and math.isfinite(abs(expected.wave))
        if both and not math.isfinite(measured.axis):
            told = wave, expected.wave
        else:  # a side view shows the component in the image plane alone
            told = complex(height), complex(expected.nonlinear)
        seen = self._seen
        if seen and not 0 < measured.stamp_ns - seen[-1][0] < TUNING.repeat_window_ns:
            seen.clear()
        stddev = measured.stddev if math.isfinite(measured.stddev) else 0.0
        seen.append((measured.stamp_ns, *told, stddev))
        while measured.stamp_ns - seen[0][0] > TUNING.repeat_window_ns:
            seen.popleft()
        long = measured.stamp_ns - seen[0][0] >= TUNING.repeat_least_ns
        return height > TUNING.repeat_wave and long and self._repeats()

    def _repeats(self) -> bool:
        same = min(
            max(TUNING.same, TUNING.same_noise * max(one[3] for one in self._seen)),
            TUNING.same_most,
        )
        moves = max(TUNING.moves, TUNING.moves_times * same)
        if _spread([one[2] for one in self._seen]) <= moves:
            return False
        return any(self._in_turn(count, same, moves) for count in range(1, TUNING.in_turn + 1))

    def _in_turn(self, count: int, same: float, moves: float) -> bool:
        """Returns whether the last measured heights repeat a cycle of `count` images."""
        turns = list(self._turns(count))
        if len(turns[-1]) < TUNING.each or any(
            _spread([one[1] for one in turn]) > same for turn in turns
        ):
            return False
        return max(_spread([one[2] for one in turn]) for turn in turns) > moves

    def _turns(self, count: int) -> Iterator[Sequence[tuple[int, complex, complex, float]]]:
        newest = list(reversed(self._seen))
        recent = sum(newest[0][0] - one[0] <= TUNING.repeat_least_ns for one in newest)
        newest = newest[: max(count * 2 * TUNING.each, recent)]
        for first in range(count):
            yield list(islice(newest, first, None, count))


def _spread(values: Sequence[complex]) -> float:
    """Returns the largest distance [m] of wave vectors or heights from the first of them."""
    return max(abs(value - values[0]) for value in values)
