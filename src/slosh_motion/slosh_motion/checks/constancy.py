"""Detects when a container is at rest, by a constant acceleration of any size.

A vector is averaged over bins of BIN_NS. A stretch of bins is constant as long as each bin lies
near the mean of those before it. What "near" means follows the sensor's noise, which the second
differences of the bins tell: a motion changes smoothly and hardly shows in them.

The models start from still liquid. Where the first samples move already, the wave that was there
before is not known. Poses and velocities show the speed at their first moment: a motion that
begins with the recording has none, however fast it starts. Accelerations show none; of them the
first ones must be small, or be constant, as those of a tilted or biased sensor are.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, Integers
from slosh_motion.checks.constant_meaning import FINE, Doubt
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
    """Averages vectors over time bins; samples may come one by one or in blocks."""

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


REST = TUNING.rest
DEPARTURE = TUNING.departure
_ZERO: Vector = (0.0, 0.0, 0.0)


class ConstantFinder:
    """Finds the constant part of an acceleration while the container is at rest."""

    def __init__(self) -> None:
        self.stretch = Stretch(TOLERANCE, MOST)
        self.restart()

    def restart(self) -> None:
        """Discards the present standstill and the integrated speed, after a gap in the input."""
        self.stretch.restart()
        self._earlier: Vector | None = None
        self._departed = False
        self.bias: Vector = _ZERO
        self._speed, self._time, self._last = _ZERO, 0.0, -(2**62)

    def take(self, number: int, mean: Vector, felt: Vector | None = None) -> Vector | None:
        """Adds a time bin; returns the constant acceleration at rest, or None if it is unknown.

        Args:
            mean: of the input [m/s²].
            felt: what moves the container, as far as it is known; None: the input [m/s²].
        """
        felt = felt or mean
        steps = number - self._last if self._time else 1
        self._last = number
        seconds = BIN * steps
        kept = math.exp(-seconds / TUNING.forgetting)
        speed, bias = self._speed, self.bias
        self._speed = (
            kept * speed[0] + seconds * (felt[0] - bias[0]),
            kept * speed[1] + seconds * (felt[1] - bias[1]),
            kept * speed[2] + seconds * (felt[2] - bias[2]),
        )
        self._time = kept * self._time + seconds
        before, lasted = self.stretch.mean, self.stretch.seconds
        if not self.stretch.take(number, mean) and lasted >= REST and math.hypot(*before) > FINE:
            self._earlier, self._departed = before, False
        if self._earlier is not None:
            self._departed |= math.dist(mean, self._earlier) > DEPARTURE
        if self.stretch.seconds < REST:
            return None
        constant = self.stretch.mean
        if math.hypot(*constant) <= FINE:
            self._earlier, self._departed, self.bias = None, False, constant
            return constant
        return constant if self._is_no_acceleration(constant) else None

    def adopt(self, constant: Vector) -> None:
        """Takes a constant acceleration as the input's bias, which is then subtracted."""
        self._earlier, self._departed, self.bias = None, False, constant
        self._speed, self._time = _ZERO, 0.0

    def _is_no_acceleration(self, constant: Vector) -> bool:
        """Returns whether a constant is no real acceleration, by the speed that it would cause."""
        left = math.dist(constant, self.bias)
        if left * self.stretch.seconds > TOP_SPEED:
            return True
        reached = math.hypot(*self._speed)
        whole = tuple(self._time * (constant[i] - self.bias[i]) for i in range(3))
        rest = math.dist(self._speed, whole)
        if reached > TOP_SPEED and rest <= TOP_SPEED:
            return True
        again = self._departed and self._earlier is not None
        if not again or math.dist(constant, self._earlier or constant) > 0.1 + 0.02 * reached:
            return False
        return reached >= 0.5 * TOP_SPEED and rest <= 0.25 * left * self._time

    def memory(self, base: int) -> list[float]:
        """Returns the state as numbers for `take_up`; time bins are counted from `base`."""
        last = float(self._last - base) if self._time else math.nan
        earlier = self._earlier or (math.nan,) * 3
        own = [*self._speed, self._time, last, *earlier, float(self._departed), *self.bias]
        return [*own, *self.stretch.memory(base)]

    def take_up(self, memory: Sequence[float], base: int) -> None:
        """Restores the state that `memory` returned."""
        vx, vy, vz, self._time, last, ex, ey, ez, departed, bx, by, bz, *stretch = memory
        self.bias = bx, by, bz
        self._speed = vx, vy, vz
        self._last = -(2**62) if math.isnan(last) else round(last) + base
        self._earlier = None if math.isnan(ex) else (ex, ey, ez)
        self._departed = bool(departed)
        self.stretch.take_up(stretch, base)


FINDER_MEMORY = 12 + STRETCH_MEMORY
"""Numbers in the memory of a ConstantFinder."""


BEGAN = "begins in motion"
"""Part of what is told, by which others find it."""


def began_doubt(shown: str) -> Doubt:
    """Returns what is told of an input that begins in motion.

    Args:
        shown: its speed or acceleration, with the unit.
    """
    return Doubt(
        f"the input {BEGAN} ({shown}): the liquid's state is not known there, and heights are "
        "wrong until the wave from before has decayed; begin while the container rests"
    )


def speed_at_start(t: Array, values: Array, derivative: int) -> float:
    """Returns the speed at the first of some moments [m/s]; 0 if the values do not show one.

    It is that of a parabola along the way. A motion that begins at the first moment, or later,
    bends away from a parabola such that its speed there is none, or leads back.

    Args:
        t: (N,) rising [s].
        values: (N, 3) positions [m], or velocities [m/s].
        derivative: of the values that the speed is: 1 of positions, 0 of velocities.
    """
    freedom = len(t) - 3
    along = values[-1] - values[0] if derivative else values[0]
    size = float(np.linalg.norm(along))
    if freedom < 1 or size == 0.0:
        return 0.0
    length = float(t[-1] - t[0])
    way = (values - values[0] if derivative else values) @ along / size
    powers = np.vander((t - t[0]) / length, 3, increasing=True)
    inverse = np.linalg.pinv(powers)
    terms = inverse @ way
    variance = float(np.sum((way - powers @ terms) ** 2)) / freedom
    noises = TUNING.began_noises * (1.0 + TUNING.began_few / (freedom * freedom))
    scale = length**-derivative
    error = scale * math.sqrt(variance) * float(np.linalg.norm(inverse[derivative]))
    speed = scale * float(terms[derivative])
    return speed if speed > max(TUNING.began_speed, noises * error) else 0.0


class Beginning:
    """Tells by the first accelerations of an input whether it begins in motion.

    Attributes:
        open: whether that is not decided yet.
        size: the first acceleration along the floor, where it is one of a motion [m/s²]; 0: none.
    """

    def __init__(self) -> None:
        self.open = True
        self.size = 0.0
        self._first_ns: int | None = None
        self._number = 0
        self._first: list[Vector] = []
        self._newest: list[Vector] = []
        self._all: list[Vector] = []

    def take(self, stamp_ns: int, acceleration: Vector) -> bool:
        """Adds an acceleration, gravity excluded [m/s²]; returns whether it shows a motion.

        That is told once.
        """
        if not self.open:
            return False
        if self._first_ns is None:
            self._first_ns, self._first = stamp_ns, self._newest
        number = (stamp_ns - self._first_ns) // BIN_NS
        if number != self._number:
            self._judge()
            self._newest, self._number = [], number
            self.open = self.open and number * BIN_NS <= TUNING.rest * SECOND
        self._newest.append(acceleration)
        self._all.append(acceleration)
        return self.size > 0.0

    def _judge(self) -> None:
        """Compares the newest time bin with the first."""
        first, last = _line(self._first, 0.0), _line(self._newest, 0.5)
        size, apart = float(np.hypot(*first)), float(np.hypot(*(last - first)))
        # Of what changes smoothly the second differences are small.
        bends = np.diff(np.array(self._all)[:, :2], 2, axis=0)
        noise = math.sqrt(float(np.mean(bends**2)) / 6.0) if len(bends) else 0.0
        if size <= max(TUNING.began_acceleration, TUNING.began_shakes * noise):
            self.open = False
        elif len(bends) >= TUNING.began_poses and apart > max(
            TUNING.departure, TUNING.began_noises * noise
        ):
            self.open, self.size = False, size


def _line(samples: list[Vector], share: float) -> Array:
    """Returns the value (2,) of a line through accelerations along the floor [m/s²]."""
    values = np.array(samples)[:, :2]
    if len(values) < 4:
        found: Array = values.mean(axis=0)
        return found
    powers = np.vander(np.linspace(0.0, 1.0, len(values)), 2, increasing=True)
    terms = np.linalg.pinv(powers) @ values
    value: Array = terms[0] + share * terms[1]
    return value
