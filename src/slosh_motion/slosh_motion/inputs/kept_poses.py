"""Stores the poses of a sliding window as columns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from slosh_motion.checks.message_checks import Leap
from slosh_motion.tuning import TUNING

NUMBERS = 7
"""Of a pose: position and quaternion."""


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
