"""The container's pose, differentiated twice.

The filter is a least-squares cubic over a sliding window (Savitzky and Golay's, for stamps that
need not be regular), evaluated at the window's middle sample and stamped with that sample's stamp:
the answer comes half a window late, but has no phase error. A quadratic gives the same value where
the stamps are symmetric about the middle; the cubic also does where they are not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from slosh_model.compile_cache import use_compile_cache

from slosh_estimator.checks import in_range
from slosh_estimator.gate import SampleGate
from slosh_estimator.sample import Sample, Start

use_compile_cache()

MINIMUM_SAMPLES = 5
_CAPACITY = 4096
_ROW = 4  # x, y, z, yaw


@dataclass(frozen=True, slots=True)
class PoseSettings:
    """The filter.

    Attributes:
        window: its length [s]; half of it is the latency. White position noise of standard
            deviation s at the rate F becomes about 27 s F² / N^2.5 of acceleration, N = window · F.
        max_speed: a faster change between two samples is a jump of the tracker [m/s].

    Raises:
        SloshEstimatorError: a value out of range.
    """

    window: float = 0.06
    max_speed: float = 10.0

    def __post_init__(self) -> None:
        in_range("window", self.window, 0.005, 2.0, "s")
        in_range("max_speed", self.max_speed, 0.01, 1000.0, "m/s")


class PoseInput:
    """Turns poses in the world into samples.

    The acceleration stays in world axes: without the container's attitude in the model (effect
    `gravity_tilt`), a tilt changes nothing. The yaw is the attitude's twist about the vertical.

    Args:
        gate: the gate, shared with the estimator; it judges the poses as they come.
        settings: the filter.

    Attributes:
        jumps: poses that lay too far from the one before: the filter starts anew there.
    """

    def __init__(self, gate: SampleGate, settings: PoseSettings | None = None) -> None:
        self._gate = gate
        self._settings = settings or PoseSettings()
        self._window_ns = round(self._settings.window * 1e9)
        self._stamps = np.zeros(_CAPACITY, dtype=np.int64)
        self._rows = np.zeros((_CAPACITY, _ROW))
        self.jumps = 0
        self.reset()

    def reset(self) -> None:
        """Empties the window; the next sample is a first one."""
        self._first = self._count = 0
        self._emitted_ns: int | None = None
        self._start = Start.FIRST

    def update(
        self,
        stamp_ns: int,
        position: tuple[float, float, float],
        attitude: tuple[float, float, float, float],
        receive_ns: int | None = None,
    ) -> Sample | None:
        """Takes a pose.

        Args:
            stamp_ns: its stamp [ns].
            position: of the container's origin in the world [m].
            attitude: quaternion x, y, z, w, world ← container; not of unit length: dropped.
            receive_ns: its time of arrival [ns].

        Returns:
            the sample at the window's middle, or None while there is none.
        """
        x, y, z = position
        norm = sum(part * part for part in attitude)
        valid = math.isfinite(x + y + z) and abs(norm - 1.0) < 0.02
        start = self._gate.check(stamp_ns, valid, receive_ns)
        if start is None:
            return None
        if start is not Start.CONTINUES:
            self._restart(start)
        elif self._jumped(stamp_ns, position):
            self.jumps += 1
            self._restart(Start.AFTER_GAP)
        self._append(stamp_ns, x, y, z, 2.0 * math.atan2(attitude[2], attitude[3]))
        return self._middle()

    @property
    def warning(self) -> str:
        """What is wrong with the messages, one line; '' where nothing is."""
        if self._count == _CAPACITY:
            return f"more than {_CAPACITY} poses in a window: shorten it"
        if self.jumps:
            return f"{self.jumps} jumps in the pose: the tracker loses the container"
        return ""

    def _restart(self, start: Start) -> None:
        # A gap that is followed by another before the first answer stays what it was: a start.
        if not (self._start is Start.FIRST and self._emitted_ns is None):
            self._start = start
        self._first = self._count = 0

    def _jumped(self, stamp_ns: int, position: tuple[float, float, float]) -> bool:
        if not self._count:
            return False
        last = self._first + self._count - 1
        before, dt = self._rows[last], (stamp_ns - int(self._stamps[last])) / 1e9
        distance = math.dist(position, (before[0], before[1], before[2]))
        return distance > self._settings.max_speed * dt

    def _append(self, stamp_ns: int, x: float, y: float, z: float, yaw: float) -> None:
        end = self._first + self._count
        if end == _CAPACITY:
            keep = min(self._count, _CAPACITY // 2)
            self._stamps[:keep] = self._stamps[end - keep : end]
            self._rows[:keep] = self._rows[end - keep : end]
            self._first, self._count, end = 0, keep, keep
        self._stamps[end] = stamp_ns
        row = self._rows[end]
        row[0], row[1], row[2], row[3] = x, y, z, yaw
        self._count += 1
        while stamp_ns - int(self._stamps[self._first]) > self._window_ns:
            self._first += 1
            self._count -= 1

    def _middle(self) -> Sample | None:
        if self._count < MINIMUM_SAMPLES:
            return None
        first, end = self._first, self._first + self._count
        # Until the window is full, its answers would come from fewer samples: noisier than stated.
        span = int(self._stamps[end - 1] - self._stamps[first])
        if span + span // (self._count - 1) < self._window_ns:
            return None
        middle = first + self._count // 2
        stamp_ns = int(self._stamps[middle])
        if self._emitted_ns is not None and self._start is Start.CONTINUES:
            if stamp_ns <= self._emitted_ns:
                return None
        ax, ay, az = second_derivative(self._stamps, self._rows, first, end, middle)
        start, self._start, self._emitted_ns = self._start, Start.CONTINUES, stamp_ns
        return Sample(stamp_ns, ax, ay, az, float(self._rows[middle, 3]), start)


@njit(cache=True)
def second_derivative(stamps: Any, rows: Any, first: int, end: int, middle: int) -> Any:
    """Second derivative of the least-squares cubic through rows[first:end, :3] at `middle` [1/s²].

    Args:
        stamps: (N,) int64 [ns].
        rows: (N, ≥3) positions.
        first, end, middle: the window and the sample at which the answer holds.
    """
    scale = 0.5e-9 * float(stamps[end - 1] - stamps[first])
    normal = np.zeros((4, 4))
    right = np.zeros((4, 3))
    powers = np.ones(4)
    for i in range(first, end):
        # Stamps are subtracted as integers: as floats they would lose nanoseconds.
        t = 1e-9 * float(stamps[i] - stamps[middle]) / scale
        for p in range(1, 4):
            powers[p] = powers[p - 1] * t
        for p in range(4):
            for q in range(4):
                normal[p, q] += powers[p] * powers[q]
            for axis in range(3):
                right[p, axis] += powers[p] * (rows[i, axis] - rows[middle, axis])
    solution = np.linalg.solve(normal, right)
    factor = 2.0 / (scale * scale)
    return solution[2, 0] * factor, solution[2, 1] * factor, solution[2, 2] * factor
