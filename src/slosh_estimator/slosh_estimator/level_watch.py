"""Checks whether the camera sees the still liquid at the level of the given fill height."""

from __future__ import annotations

import math
import statistics
from collections import deque
from typing import NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.comparison import Expected, MeasuredPoint
from slosh_estimator.sight import AMBIGUOUS, SATURATED, UNSOUND, UNUSABLE
from slosh_estimator.tuning import TUNING

_UNCLEAR = UNUSABLE | SATURATED | AMBIGUOUS


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
