"""Poses of a sliding window as columns, and whether the next one follows or leaps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.tuning import TUNING

NUMBERS = 7
"""Of a pose: position and quaternion."""


class Leap(NamedTuple):
    """The change from one pose to the next: distance [m], angle [rad], time between them [s]."""

    distance: float
    angle: float
    seconds: float

    @classmethod
    def between(cls, one: Sequence[float], other: Sequence[float], seconds: float) -> Leap:
        """Returns the change between two poses: position and a quaternion of any length."""
        cosine = abs(sum(a * b for a, b in zip(one[3:], other[3:], strict=True)))
        lengths = math.hypot(*one[3:]) * math.hypot(*other[3:])
        angle = 2.0 * math.acos(min(cosine / lengths, 1.0))
        return cls(math.dist(one[:3], other[:3]), angle, seconds)

    def is_small(self) -> bool:
        """Returns whether the change is none that matters."""
        return self.distance <= TUNING.leap_distance and self.angle <= TUNING.leap_angle

    def is_way_of(self, steps: Sequence[Leap]) -> bool:
        """Returns whether steps that add up to this change lead there without a detour."""
        way, turn = sum(step.distance for step in steps), sum(step.angle for step in steps)
        return (
            way <= TUNING.leap_detour * self.distance + TUNING.leap_distance
            and turn <= TUNING.leap_detour * self.angle + TUNING.leap_angle
        )

    def is_beyond(self, before: Sequence[Leap], usual: float) -> bool:
        """Returns whether no motion that went on as `before` leads so far.

        Args:
            before: the last changes from pose to pose; none: only its speed tells.
            usual: time between two poses [s]; 0: not known.
        """
        if not before:
            return self.distance > TUNING.leap_distance + TUNING.leap_speed * self.seconds
        longer = [max(self.seconds / max(one.seconds, 0.25 * usual), 1.0) for one in before]
        far, turn = (
            TUNING.leap_steps * max(size * time for size, time in zip(sizes, longer, strict=True))
            for sizes in ([one.distance for one in before], [one.angle for one in before])
        )
        square = 0.5 * max(self.seconds, usual) ** 2
        return (
            self.distance > TUNING.leap_distance + far + TUNING.leap_acceleration * square
            or self.angle > TUNING.leap_angle + turn + TUNING.leap_spin * square
        )


def leap_doubt(count: int, largest: Leap, noun: str) -> Doubt:
    """Returns what is told of poses that leapt away and back."""
    return Doubt(
        f"{count} of the {noun} leap by up to {largest.distance:.2g} m and "
        f"{math.degrees(largest.angle):.2g}° and back: they are not used; a driver that sends "
        "zeros, or a joint that jumps, must be mended",
        wrong=False,
    )


class KeptPoses:
    """Poses of a sliding window, stored as columns.

    Attributes:
        stamps: (N,) [ns].
        values: (N, 7) position [m] and quaternion x, y, z, w.
    """

    def __init__(self) -> None:
        self._all_stamps = np.zeros(64, dtype=np.int64)
        self._all_values = np.zeros((64, NUMBERS))
        self.clear()

    def __len__(self) -> int:
        return self._size

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest pose [ns]."""
        return int(self._all_stamps[self._size - 1])

    def changes(self) -> list[Leap]:
        """Returns the last changes from pose to pose, TUNING.leap_before of them at most."""
        first = max(self._size - 1 - TUNING.leap_before, 0)
        stamps, values = self.stamps[first:].tolist(), self.values[first:].tolist()
        pairs = zip(pairwise(values), pairwise(stamps), strict=True)
        return [Leap.between(*poses, (after - before) * 1e-9) for poses, (before, after) in pairs]

    def clear(self) -> None:
        """Removes all poses."""
        self._resize(0)

    def append(self, stamp_ns: int, values: tuple[float, ...]) -> None:
        """Adds a pose to the end of the window."""
        if self._size == len(self._all_stamps):
            self._all_stamps = np.concatenate([self._all_stamps, self._all_stamps])
            self._all_values = np.concatenate([self._all_values, self._all_values])
        self._all_stamps[self._size], self._all_values[self._size] = stamp_ns, values
        self._resize(self._size + 1)

    def forget(self, count: int) -> int:
        """Removes the `count` oldest poses; returns how many were removed."""
        if count <= 0:
            return 0
        rest = self._size - count
        self._all_stamps[:rest] = self._all_stamps[count : self._size]
        self._all_values[:rest] = self._all_values[count : self._size]
        self._resize(rest)
        return count

    def rows(self, first: int) -> list[float]:
        """Returns poses as a flat list: stamp relative to the newest, position, quaternion."""
        back = (self.stamps[first:] - self.stamps[-1:]).astype(np.float64)
        table: list[float] = np.column_stack([back, self.values[first:]]).ravel().tolist()
        return table

    def fill(self, newest_ns: int, rows: Sequence[float]) -> None:
        """Restores poses that `rows` returned, given the stamp of the newest one [ns]."""
        self.clear()
        for back, *values in np.reshape(rows, (-1, NUMBERS + 1)).tolist():
            self.append(newest_ns + round(back), tuple(values))

    def _resize(self, size: int) -> None:
        self._size = size
        self.stamps, self.values = self._all_stamps[:size], self._all_values[:size]
