"""Whether one image shows what neither the estimate nor the images around it explain.

An old picture, or one torn between two moments, is measured as well as any other, and its height
is wrong. How far measured and estimated height differ changes from image to image no faster than
the wave swings, whatever the model lacks; there it jumps, and jumps back.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.comparison import Expected, MeasuredPoint

KEPT = 12
"""Images back to which is compared: some periods of a wave at a camera's least rate."""
LEAST = 6
"""Of so many the usual change must be known."""
PAUSE_NS = SECOND // 5
"""After so long without an image the difference may be any [ns]."""
JUMP, TIMES, NOISES = 2e-3, 2.0, 8.0
"""A difference jumps where it changes by more than this [m], so many times the largest change
before, and so many standard deviations of the height."""
LASTING = 2
"""What jumps so often in a row and stays is no stray."""


class StrayHeights:
    """Takes both sides of moments in their order."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, float]] = deque(maxlen=KEPT)
        self._strays = 0

    def look(self, measured: MeasuredPoint, expected: Expected) -> bool:
        """Whether the newest measurement is a stray one."""
        off = measured.msh - expected.nonlinear
        if not math.isfinite(off):
            return False
        kept, at = self._kept, measured.stamp_ns
        if kept and not 0 < at - kept[-1][0] < PAUSE_NS:
            self._forget()
        stray = self._jumps(off, measured.stddev if math.isfinite(measured.stddev) else 0.0)
        self._strays = self._strays + 1 if stray else 0
        if self._strays > LASTING:
            self._forget()
            stray = False
        if not stray:
            kept.append((at, off))
        return stray

    def _jumps(self, off: float, stddev: float) -> bool:
        values = [one[1] for one in self._kept]
        if len(values) < LEAST:
            return False
        usual = max(abs(b - a) for a, b in pairwise(values))
        return abs(off - values[-1]) > max(JUMP, TIMES * usual, NOISES * stddev)

    def _forget(self) -> None:
        self._kept.clear()
        self._strays = 0
