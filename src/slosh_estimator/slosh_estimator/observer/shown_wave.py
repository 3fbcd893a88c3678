"""Wave amplitude from the newest heights measured at one place, without the observer.

A camera that tells a maximum but not where may see a part of the wall alone. The filter takes such
a height for the highest of all: where the crest is elsewhere, the lower ones pull its wave down.
The heights themselves go on to swing, and that is no calm liquid.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

from slosh_estimator.tuning import TUNING


class ShownWave:
    """Wave amplitude from the root mean square of the newest heights about the still level.

    The noise of the heights is taken off by their differences, in which a wave is small.
    """

    def __init__(self) -> None:
        self._heights: deque[tuple[int, float]] = deque()

    def clear(self) -> None:
        """Removes all heights, after a motion of the container or a change of the liquid."""
        self._heights.clear()

    def add(self, stamp_ns: int, height: float) -> None:
        """Adds a height [m] that was measured at a stamp [ns]."""
        self._heights.append((stamp_ns, height))
        while abs(stamp_ns - self._heights[0][0]) > TUNING.shown_ns:
            self._heights.popleft()

    def amplitude(self, stamp_ns: int, level: float) -> float:
        """Returns the wave's amplitude about a still level, both [m]; 0 with few new heights."""
        heights = [one for at_ns, one in self._heights if stamp_ns - at_ns <= TUNING.shown_ns]
        if len(heights) < TUNING.shown_least:
            return 0.0
        square = math.fsum((one - level) ** 2 for one in heights) / len(heights)
        steps = math.fsum((b - a) ** 2 for a, b in pairwise(heights))
        noise = 0.5 * steps / (len(heights) - 1)
        return math.sqrt(max(2.0 * (square - noise), 0.0))
