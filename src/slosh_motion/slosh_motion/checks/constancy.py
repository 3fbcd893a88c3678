"""Detects when a container is at rest, by a constant acceleration of any size.

A vector is averaged over bins of BIN_NS. A stretch of bins is constant as long as each bin lies
near the mean of those before it. What "near" means follows the sensor's noise, which the second
differences of the bins tell: a motion changes smoothly and hardly shows in them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, Integers
from slosh_motion.tuning import TUNING

Vector = tuple[float, float, float]

BIN_NS = TUNING.bin_ns
BIN = BIN_NS / SECOND
_MEDIAN = math.sqrt(6.0) * 1.538
"""Median length of a second difference of white noise in three axes, in standard deviations."""
TOLERANCE = TUNING.tolerance
MOST = TUNING.most_tolerance
TOP_SPEED = TUNING.top_speed
STRETCH_MEMORY = 13 + TUNING.looked_back
"""Numbers in the memory of a Stretch."""


class Bin(NamedTuple):
    """Mean of the samples in a time bin, with the bin's number (stamp // BIN_NS)."""

    number: int
    mean: tuple[float, ...]


class Bins:
    """Averages vectors over time bins; samples may come one by one or in blocks.

    Args:
        width: numbers in a vector.
    """

    def __init__(self, width: int) -> None:
        self._number = -(2**62)
        self._sums = [0.0] * width
        self._count = 0

    def add(self, stamp_ns: int, values: Sequence[float]) -> Bin | None:
        """Adds a sample; returns the time bin that the sample completes, or None."""
        number = stamp_ns // BIN_NS
        closed = None
        if number != self._number:
            closed = self.close(number)
        sums = self._sums
        for place, value in enumerate(values):
            sums[place] += value
        self._count += 1
        return closed

    def add_many(self, stamps: Integers, values: Array) -> list[tuple[int, Bin]]:
        """Adds samples; returns each completed bin with the index of the sample that completes it.

        Args:
            stamps: (N,) [ns], N > 0.
            values: (N, width).
        """
        numbers = stamps // BIN_NS
        starts = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1))
        group = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(stamps))))
        # bincount adds up in the order of the rows, as `add` does.
        totals = [np.bincount(group, weights=column).tolist() for column in values.T]
        closed = []
        first = int(numbers[0])
        if first == self._number and self._count:
            rows = int(starts[1]) if len(starts) > 1 else len(stamps)
            for place, column in enumerate(values[:rows].T):
                joined = np.concatenate(([self._sums[place]], column))
                totals[place][0] = float(np.bincount(np.zeros(rows + 1, np.intp), joined)[0])
        counts = np.bincount(group).tolist()
        for index, row in enumerate(starts.tolist()):
            number = int(numbers[row])
            if number != self._number:
                found = self.close(number)
                if found is not None:
                    closed.append((row, found))
            self._sums = [total[index] for total in totals]
            self._count += counts[index]
        return closed

    def close(self, number: int = -(2**62)) -> Bin | None:
        """Returns the finished bin, or None if it was empty; begins the next bin."""
        found = None
        if self._count:
            found = Bin(self._number, tuple(total / self._count for total in self._sums))
        self._number, self._count = number, 0
        self._sums = [0.0] * len(self._sums)
        return found

    def memory(self, base: int) -> list[float]:
        """Returns the state as numbers for `take_up`; time bins are counted from `base`."""
        return [_told(self._number, base), float(self._count), *self._sums]

    def take_up(self, memory: Sequence[float], base: int) -> None:
        """Restores the state that `memory` returned."""
        number, count, *sums = memory
        self._number, self._count, self._sums = _heard(number, base), round(count), sums


class Stretch:
    """Time span in which the mean values of successive time bins stay constant.

    Args:
        tolerance: how far from the mean a bin of a noiseless sensor may lie.
        most: how far at most, whatever the noise.

    Attributes:
        mean: of the stretch.
        count: its bins; 0: none has come.
    """

    def __init__(self, tolerance: float, most: float) -> None:
        self._tolerance, self._most = tolerance, most
        self.restart()

    def restart(self) -> None:
        """Begins a new time span of constant values."""
        self.mean: Vector = (0.0, 0.0, 0.0)
        self.count = 0
        self._start = self._last = self._all = 0
        self._one: Vector = (math.nan,) * 3
        self._two: Vector = (math.nan,) * 3
        self._bends: deque[float] = deque(maxlen=TUNING.looked_back)

    @property
    def unbroken(self) -> bool:
        """Whether all time bins since the last restart belong to one constant time span."""
        return self._all == self.count

    @property
    def first(self) -> bool:
        """Whether exactly one time bin was added since the last restart."""
        return self.count == 1 and math.isnan(self._two[0])

    @property
    def seconds(self) -> float:
        """Duration of the time span of constant values [s]."""
        return (self._last + 1 - self._start) * BIN if self.count else 0.0

    @property
    def noise(self) -> float:
        """Standard deviation of the noise of a time bin's mean along one axis [m/s²]."""
        if not self._bends:
            return 0.0
        return sorted(self._bends)[len(self._bends) // 2] / _MEDIAN

    def take(self, number: int, value: Vector) -> bool:
        """Adds a time bin; returns whether it continues the time span of constant values."""
        one, two = self._one, self._two
        bends = [value[i] - 2.0 * one[i] + two[i] for i in range(3)]
        # By products: a power raises OverflowError where they are infinite.
        bend = math.sqrt(sum(part * part for part in bends))
        if bend == bend:  # two bins are known before it
            self._bends.append(bend)
        self._two, self._one = one, value
        allowed = min(self._tolerance + TUNING.constancy_noises * self.noise, self._most)
        continues = self.count > 0 and math.dist(value, self.mean) <= allowed
        if continues:
            self.count += 1
            share = 1.0 / self.count
            mean = self.mean
            self.mean = (
                mean[0] + share * (value[0] - mean[0]),
                mean[1] + share * (value[1] - mean[1]),
                mean[2] + share * (value[2] - mean[2]),
            )
        else:
            self.mean, self.count, self._start = value, 1, number
        self._last = number
        self._all += 1
        return continues

    def memory(self, base: int) -> list[float]:
        """Returns the state as numbers for `take_up`; time bins are counted from `base`."""
        bends = [*self._bends, *[math.nan] * (TUNING.looked_back - len(self._bends))]
        counts = float(self.count), float(self._all)
        places = [_told(self._start, base), _told(self._last, base), *counts]
        return [*places, *self.mean, *self._one, *self._two, *bends]

    def take_up(self, memory: Sequence[float], base: int) -> None:
        """Restores the state that `memory` returned."""
        start, last, count, total, mx, my, mz, ox, oy, oz, tx, ty, tz, *bends = memory
        self._start, self._last = _heard(start, base), _heard(last, base)
        self.count, self._all, self.mean = round(count), round(total), (mx, my, mz)
        self._one, self._two = (ox, oy, oz), (tx, ty, tz)
        self._bends = deque((bend for bend in bends if bend == bend), maxlen=TUNING.looked_back)


def _told(number: int, base: int) -> float:
    """Returns a bin's number relative to `base` as a float, or NaN if there is no bin."""
    return math.nan if number <= -(2**61) else float(number - base)


def _heard(told: float, base: int) -> int:
    return -(2**62) if math.isnan(told) else round(told) + base
