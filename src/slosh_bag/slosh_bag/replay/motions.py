"""Finds the motions of a run in its accelerations."""

from __future__ import annotations

from bisect import bisect_right
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_files.nanoseconds import SECOND

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

BIN_NS = 50_000_000
"""Accelerations are averaged over this time: a sensor's noise moves nothing."""
MOVING = 0.15
"""Size of the averaged acceleration from which the container counts as moving [m/s²]."""
PAUSE_NS = SECOND
"""A rest of this length separates two motions."""


class MotionSpan(NamedTuple):
    """A motion, from its first to its last moving bin [ns]."""

    start_ns: int
    end_ns: int


class MotionFinder:
    """Takes accelerations in the order of their stamps and tells the motions so far."""

    def __init__(self) -> None:
        self._spans: list[MotionSpan] = []
        self._bin = -(2**62)
        self._sum = np.zeros(3)
        self._count = 0

    @property
    def spans(self) -> list[MotionSpan]:
        """The motions; the last may still go on."""
        return self._spans

    def add(self, stamps: Integers, accelerations: Array) -> None:
        """Takes samples.

        Args:
            stamps: (N,) increasing [ns].
            accelerations: (N, 3), gravity excluded [m/s²].
        """
        if len(stamps) == 0:
            return
        bins = stamps // BIN_NS
        starts = np.flatnonzero(np.diff(bins, prepend=bins[0] - 1))
        sums = np.add.reduceat(accelerations, starts, axis=0)
        counts = np.diff(np.append(starts, len(bins)))
        for number, total, count in zip(bins[starts].tolist(), sums, counts, strict=True):
            if number != self._bin:
                self._close_bin()
                self._bin, self._sum, self._count = number, np.zeros(3), 0
            self._sum = self._sum + total
            self._count += int(count)

    def finish(self) -> None:
        """Takes what is left; no samples follow."""
        self._close_bin()

    def number_at(self, stamps: Integers, after_ns: int) -> NDArray[np.int32]:
        """Which motion each moment belongs to; -1: none.

        Args:
            stamps: (N,) [ns].
            after_ns: how long after its end a motion's liquid still counts [ns].
        """
        if len(stamps) == 0:
            return np.empty(0, dtype=np.int32)
        place, grown = self._grown()
        first = max(bisect_right(self._spans, int(stamps.min()), key=_start) - 1, 0)
        # A run of hours has thousands: only those around the moments are looked at.
        near = [*self._spans[first:place], *grown]
        spans = np.array(near, dtype=np.int64).reshape(-1, 2)
        index = np.searchsorted(spans[:, 0], stamps, side="right") - 1
        ends = np.append(spans[:, 1] + after_ns, 0)
        within = (index >= 0) & (stamps <= ends[index])
        return np.where(within, first + index, -1).astype(np.int32)

    def _close_bin(self) -> None:
        place, grown = self._grown()
        self._spans[place:] = grown

    def _grown(self) -> tuple[int, list[MotionSpan]]:
        """From which place on the bin that is being filled changes the motions, and to what."""
        count = len(self._spans)
        if not self._count or np.linalg.norm(self._sum) <= MOVING * self._count:
            return count, []
        start, end = self._bin * BIN_NS, (self._bin + 1) * BIN_NS
        if self._spans and start - self._spans[-1].end_ns < PAUSE_NS:
            return count - 1, [MotionSpan(self._spans[-1].start_ns, end)]
        return count, [MotionSpan(start, end)]


def _start(span: MotionSpan) -> int:
    return span.start_ns
