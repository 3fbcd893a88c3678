"""Detects outliers: measured heights that fit neither the estimate nor other images.

An old picture, or one torn between two moments, is measured as well as any other, and its height
is wrong. How far measured and estimated height differ changes from image to image no faster than
the wave swings, whatever the model lacks; there it jumps, and jumps back.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

from slosh_estimator.comparison import Expected, MeasuredPoint
from slosh_estimator.tuning import TUNING


class StrayHeights:
    """Detects outliers among measured heights by comparison with the modelled heights."""

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
