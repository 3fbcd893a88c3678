"""Checks of measured heights before they are compared: outliers, repeated images, the level."""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import islice, pairwise
from typing import NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.comparison import Expected, MeasuredPoint
from slosh_estimator.sight import AMBIGUOUS, SATURATED, UNSOUND, UNUSABLE
from slosh_estimator.tuning import TUNING

_UNCLEAR = UNUSABLE | SATURATED | AMBIGUOUS


class StrayHeights:
    """Detects outliers among measured heights by comparison with the modelled heights.

    An old picture, or one torn between two moments, is measured as well as any other, and its
    height is wrong. How far measured and estimated height differ changes from image to image no
    faster than the wave swings, whatever the model lacks; there it jumps, and jumps back.
    """

    def __init__(self) -> None:
        self._kept: deque[tuple[int, float]] = deque(maxlen=TUNING.stray_kept)
        self._strays = 0

    def look(self, measured: MeasuredPoint, expected: Expected) -> bool:
        """Adds a measured height and its estimate; returns whether the height is an outlier."""
        off = measured.msh - expected.nonlinear
        if not math.isfinite(off):
            return False
        kept, at = self._kept, measured.stamp_ns
        if kept and not 0 < at - kept[-1][0] < TUNING.stray_pause_ns:
            self._forget()
        stray = self._jumps(off, measured.stddev if math.isfinite(measured.stddev) else 0.0)
        self._strays = self._strays + 1 if stray else 0
        if self._strays > TUNING.lasting:
            self._forget()
            stray = False
        if not stray:
            kept.append((at, off))
        return stray

    def _jumps(self, off: float, stddev: float) -> bool:
        values = [one[1] for one in self._kept]
        if len(values) < TUNING.stray_least:
            return False
        usual = max(abs(b - a) for a, b in pairwise(values))
        return abs(off - values[-1]) > max(
            TUNING.jump, TUNING.jump_times * usual, TUNING.jump_noise * stddev
        )

    def _forget(self) -> None:
        self._kept.clear()
        self._strays = 0


class RepeatedHeights:
    """Compares successive measured heights with modelled ones to detect repeated images.

    A picture that is repeated with fresh noise, or coded anew, has no pixel in common with itself.
    But what is measured in it stays, though the container's motion swings the liquid on.
    """

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


class _Level(NamedTuple):
    """A still level that the camera measured [m], its stamp [ns], its standard deviation [m]."""

    stamp_ns: int
    height: float
    stddev: float


class LevelWatch:
    """Compares the measured still level with the fill height of the model.

    A wave of the first mode, and of every odd one, lifts one as much as it lowers the other. The
    median of most of a second of rest counts; it is off where it exceeds its standard deviation
    so many times, and more than a calibration's error may explain.

    Attributes:
        offset: of the level that was last found off [m]; NaN: it is not.
        stddev: of the offset [m].
    """

    def __init__(self) -> None:
        self._levels: deque[_Level] = deque()
        self.forget()

    def forget(self) -> None:
        """Forgets all measured levels, for example after a change of the container."""
        self._levels.clear()
        self.offset = self.stddev = math.nan

    def look(self, measured: MeasuredPoint, expected: Expected) -> None:
        """Adds a measured and an estimated height of the same time to the check."""
        levels = self._levels
        rests = not expected.flags & UNSOUND and expected.nonlinear < TUNING.still
        if not rests or (levels and measured.stamp_ns <= levels[-1].stamp_ns):
            levels.clear()
        if not rests or measured.flags & _UNCLEAR or not math.isfinite(measured.level):
            return
        levels.append(_Level(measured.stamp_ns, measured.level, measured.stddev))
        while measured.stamp_ns - levels[0].stamp_ns > TUNING.level_window_ns:
            levels.popleft()
        span = levels[-1].stamp_ns - levels[0].stamp_ns
        if len(levels) < TUNING.level_least or span < TUNING.level_window_ns - SECOND // 4:
            return
        heights = [level.height for level in levels]
        middle = statistics.median(heights)
        noise = [level.stddev for level in levels if math.isfinite(level.stddev)]
        stddev = math.hypot(statistics.median(noise or [0.0]), statistics.pstdev(heights))
        off = abs(middle) > max(TUNING.level_noise * stddev, TUNING.least_level)
        self.offset, self.stddev = (middle, stddev) if off else (math.nan, math.nan)

    @property
    def text(self) -> str:
        """Returns one line on a wrong level and what to check; empty if the level is right."""
        if math.isnan(self.offset):
            return ""
        return (
            f"at rest the camera sees the level {1e3 * self.offset:+.1f} ± "
            f"{max(1e3 * self.stddev, 0.1):.1f} mm from the fill height: check the fill height, "
            "which container it is, and whether the camera has moved"
        )
