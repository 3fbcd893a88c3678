"""Frames that a camera took and that never arrived, told from the stamps of those that did."""

from __future__ import annotations

from collections import deque

from slosh_base.files.nanoseconds import SECOND

_REMEMBERED = 40
_ENOUGH = 8


class FrameGaps:
    """Counts missing frames.

    A gap of more than a second is a pause of the camera, not a loss. Where every second frame is
    lost from the start, nothing in the stamps shows it: then only a stated rate does.

    Args:
        rate: frames per second of the camera [Hz]; 0: the one that the stamps show.
    """

    def __init__(self, rate: float = 0.0) -> None:
        self._period_ns = SECOND / rate if rate > 0.0 else 0.0
        self._intervals: deque[int] = deque(maxlen=_REMEMBERED)
        self._last_ns: int | None = None
        self.missing = 0

    def add(self, stamp_ns: int) -> None:
        """Takes the stamp of the next frame [ns]; one that runs back starts anew."""
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is None or not 0 < stamp_ns - last_ns <= SECOND:
            return
        interval = stamp_ns - last_ns
        period = self._period_ns or self._learned()
        self._intervals.append(interval)
        if period > 0.0:
            self.missing += max(round(interval / period) - 1, 0)

    def _learned(self) -> float:
        if len(self._intervals) < _ENOUGH:
            return 0.0
        # The lower quartile: right as long as three of four gaps may be due to losses.
        return float(sorted(self._intervals)[len(self._intervals) // 4])
