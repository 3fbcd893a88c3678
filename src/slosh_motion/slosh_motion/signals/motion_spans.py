"""Finds the time spans in which a container moves, live or in a recording.

It lies beside alignment and metrics, since it says over which stretch heights are compared, and in
the lowest package that all three import: nothing below slosh_report asks when a motion begins.

A motion is a departure from the constant that the input shows at rest: a sensor that is mounted
askew, or has a bias, shows one. From the first sample on that is the constant of the beginning, or
zero. Later another constant takes its place when it can be no acceleration: it would have changed
the speed by too much, or it comes again (`ConstantFinder`).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_motion.checks.constancy import BIN_NS, ConstantFinder, Vector
from slosh_motion.tuning import TUNING

MOVING = TUNING.moving
TURNING = TUNING.turning
PAUSE_NS = TUNING.pause_ns
AFTER_NS = TUNING.after_ns
_NOTHING = (0.0,) * 5
"""Sums of three accelerations and two rates before the first sample."""


class MotionSpan(NamedTuple):
    """Time span of a motion, in whole time bins: start and end stamp [ns]."""

    start_ns: int
    end_ns: int


class MotionFinder:
    """Finds motions of the container from accelerations in order of time."""

    def __init__(self) -> None:
        self._spans: list[MotionSpan] = []
        self._bin = -(2**62)
        self._sums = list(_NOTHING)
        self._count = 0
        self._base = (0.0, 0.0, 0.0)
        self._finder = ConstantFinder()
        self._begins = True

    @property
    def spans(self) -> list[MotionSpan]:
        """The motions so far; the last one may continue; the current time bin is not included."""
        return self._spans

    def add(self, stamps: Integers, accelerations: Array, turning: Array | None = None) -> None:
        """Adds accelerations (and angular velocities if known) to the search for motions.

        Args:
            stamps: (N,) increasing [ns].
            accelerations: (N, 3), gravity excluded [m/s²].
            turning: (N, 3) angular velocity in the container's frame [rad/s]; None: not known. A
                round container's liquid does not follow its yaw: the third is not looked at.
        """
        if len(stamps) == 0:
            return
        values = accelerations
        if turning is not None:
            values = np.column_stack((accelerations, turning[:, :2]))
        bins = stamps // BIN_NS
        starts = np.flatnonzero(np.diff(bins, prepend=bins[0] - 1))
        sums = np.add.reduceat(values, starts, axis=0)
        counts = np.diff(np.append(starts, len(bins)))
        for number, total, count in zip(
            bins[starts].tolist(), sums.tolist(), counts.tolist(), strict=True
        ):
            self._take(number, total, count)

    def add_one(self, stamp_ns: int, acceleration: tuple[float, float, float]) -> None:
        """Adds one finite acceleration [m/s²]; faster than `add`."""
        if math.isfinite(sum(acceleration)):
            self._take(stamp_ns // BIN_NS, acceleration, 1)

    def finish(self) -> None:
        """Processes the remaining samples at the end of the input."""
        self._close_bin()

    def forget_first(self) -> None:
        """Drops the first motion; if it still continues, its remainder counts as a new motion."""
        del self._spans[0]

    def number_at(self, stamps: Integers) -> NDArray[np.int32]:
        """Returns the index of the motion to which each stamp belongs, or -1 for none.

        Args:
            stamps: (N,) [ns].
        """
        if len(stamps) == 0:
            return np.empty(0, dtype=np.int32)
        place, grown = self._grown()
        first = max(bisect_right(self._spans, int(stamps.min()), key=_start) - 1, 0)
        # A run of hours has thousands: only those around the moments are looked at.
        near = [*self._spans[first:place], *grown]
        spans = np.array(near, dtype=np.int64).reshape(-1, 2)
        index = np.searchsorted(spans[:, 0], stamps, side="right") - 1
        ends = np.append(spans[:, 1] + AFTER_NS, 0)
        within = (index >= 0) & (stamps <= ends[index])
        return np.where(within, first + index, -1).astype(np.int32)

    def _take(self, number: int, values: Iterable[float], count: int) -> None:
        if number != self._bin:
            self._close_bin()
            self._bin, self._sums, self._count = number, list(_NOTHING), 0
        for place, value in enumerate(values):
            self._sums[place] += value
        self._count += count

    def _close_bin(self) -> None:
        if not self._count:
            return
        place, grown = self._grown()
        self._spans[place:] = grown
        x, y, z = (total / self._count for total in self._sums[:3])
        resting = self._finder.take(self._bin, (x, y, z))
        self._begins &= self._finder.stretch.unbroken and not self._turns()
        self._follow_rest(resting)

    def _follow_rest(self, resting: Vector | None) -> None:
        """Treats a constant acceleration as standstill if it can only be an offset of the sensor.

        Args:
            resting: the constant where it can be no acceleration; None: it may be one [m/s²].
        """
        constant, seconds = self._finder.stretch.mean, self._finder.stretch.seconds
        away = math.dist(constant, self._base)
        if self._begins:
            if seconds >= TUNING.beginning and math.hypot(*constant) > MOVING:
                self._rest_at(constant)
                self._spans.clear()  # what seemed to move was the constant
        elif resting is not None and math.hypot(*resting) > MOVING:
            self._rest_at(resting)
        elif seconds >= TUNING.settled and any(self._base):
            if math.hypot(*constant) <= MOVING:
                self._rest_at((0.0, 0.0, 0.0))
            elif away <= MOVING:
                self._rest_at(constant)

    def _rest_at(self, constant: Vector) -> None:
        self._base = constant
        self._finder.adopt(constant)

    def _grown(self) -> tuple[int, list[MotionSpan]]:
        """Returns the motions that the current time bin extends or adds, and the first's index."""
        count = len(self._spans)
        if not self._moves():
            return count, []
        start, end = self._bin * BIN_NS, (self._bin + 1) * BIN_NS
        if self._spans and start - self._spans[-1].end_ns < PAUSE_NS:
            return count - 1, [MotionSpan(self._spans[-1].start_ns, end)]
        return count, [MotionSpan(start, end)]

    def _moves(self) -> bool:
        """Whether the container moves in the current time bin."""
        count, base = self._count, self._base
        away = [self._sums[axis] - count * base[axis] for axis in range(3)]
        return math.hypot(*away) > MOVING * count or self._turns()

    def _turns(self) -> bool:
        return math.hypot(*self._sums[3:]) > TURNING * self._count


def motion_spans(
    stamps: Integers, accelerations: Array, turning: Array | None = None
) -> list[MotionSpan]:
    """Returns the motions in a whole series; arguments as for `MotionFinder.add`."""
    finder = MotionFinder()
    finder.add(stamps, accelerations, turning)
    finder.finish()
    return finder.spans


def _start(span: MotionSpan) -> int:
    return span.start_ns
