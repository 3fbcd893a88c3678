"""Compares a sensor with a motion while samples of both arrive."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_motion.mounting.columns import (
    Aligned,
    MotionColumns,
    SensorColumns,
    aligned,
    sensor_columns,
)
from slosh_motion.mounting.mounting_fit import best_fit
from slosh_motion.mounting.tuning import TUNING
from slosh_motion.mounting.verdict import Expected, MountingVerdict, judge

Vector = tuple[float, float, float]
_NAN: Vector = (np.nan, np.nan, np.nan)
_MARGIN_NS = round((TUNING.farthest_lag + 1.5 * max(TUNING.boxes)) * 1e9)
_PART_NS = 500_000_000
"""So much of the rest beside a motion is compared, too: gravity is what is left then."""
MOST_SAID = 1e7
"""No sensor says more, in mm/s² or degrees/s."""
MOST = 100_000
"""Samples of either side that wait for a look."""


class _Motion(NamedTuple):
    """Start and end stamp of a motion that has ended [ns]."""

    begin: int
    end: int


class MountingWatch:
    """Collects samples of sensor and motion, and judges the mounting after each motion.

    Args:
        in_world: whether its axes are the world's.

    Attributes:
        verdict: of the motions so far that belong together; None: nothing has moved yet.
    """

    def __init__(self, expected: Expected, *, in_world: bool = False) -> None:
        self.expected, self._in_world = expected, in_world
        self.verdict: MountingVerdict | None = None
        self.motions = 0
        self._sensor: deque[tuple[float, ...]] = deque(maxlen=MOST)
        self._motion: deque[tuple[float, ...]] = deque(maxlen=MOST)
        self._sensor_ns: deque[int] = deque(maxlen=MOST)
        self._motion_ns: deque[int] = deque(maxlen=MOST)
        self._begin = self._moved = 0
        self._kept: list[tuple[Aligned, ...]] = []

    def take_sensor(self, stamp_ns: int, force: Vector, rate: Vector | None = None) -> None:
        """Adds a sensor reading in the sensor's axes and unit; ignores impossible values."""
        if not _possible(force):
            return
        if not self._sensor_ns or stamp_ns > self._sensor_ns[-1]:
            self._sensor_ns.append(stamp_ns)
            turn = rate if rate is not None and _possible(rate) else _NAN
            self._sensor.append((*force, *turn))
        elif stamp_ns < self._sensor_ns[-1] - _PART_NS:
            self._forget()

    def take_motion(
        self, stamp_ns: int, acceleration: Vector, pose: Sequence[float] | None
    ) -> None:
        """Adds the acceleration and rotation of the container at a stamp.

        Args:
            stamp_ns: the moment [ns].
            acceleration: in the world's axes [m/s²].
            pose: attitude x, y, z, w, angular velocity and acceleration in its own axes; None:
                upright, and it does not turn.
        """
        if self._motion_ns and stamp_ns <= self._motion_ns[-1]:
            if stamp_ns < self._motion_ns[-1] - _PART_NS:
                self._forget()
            return
        turned = tuple(pose or (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        self._motion_ns.append(stamp_ns)
        self._motion.append((*acceleration, *turned))
        x, y, z = acceleration
        p, q, r = turned[4:7]
        if x * x + y * y + z * z > TUNING.moving**2 or p * p + q * q + r * r > TUNING.turning**2:
            self._begin = self._begin or stamp_ns
            self._moved = stamp_ns

    def look(self, *, finished: bool = False) -> bool:
        """Judges the mounting if a motion has ended since the last call; returns whether one has.

        Args:
            finished: whether nothing more comes.
        """
        if not self._begin or len(self._sensor_ns) < 2:
            self._drop(self._motion_ns[-1] if self._motion_ns else 0)
            return False
        now = self._motion_ns[-1]
        over = now - self._moved > TUNING.rest_ns or now - self._begin > TUNING.longest_ns
        # What both have told of it by now.
        heard = self._sensor_ns[-1] > self._moved + _PART_NS + _MARGIN_NS
        if not finished and not (over and (heard or now - self._moved > 4 * _MARGIN_NS)):
            return False
        motion = _Motion(self._begin - _PART_NS, self._moved + _PART_NS)
        self._begin = 0
        judged = (motion.end - motion.begin - 2 * _PART_NS) * 1e-9 >= TUNING.least
        if judged:
            self._judge(motion)
        self._drop(motion.end)
        return judged

    def _judge(self, motion: _Motion) -> None:
        columns = np.array(self._motion)
        moved = MotionColumns(
            np.array(self._motion_ns, dtype=np.int64), columns[:, :3], columns[:, 3:7],
            columns[:, 7:10], columns[:, 10:13],
        )  # fmt: skip
        heard = np.array(self._sensor)
        sensor = SensorColumns(
            np.array(self._sensor_ns, dtype=np.int64), heard[:, :3], heard[:, 3:6]
        )
        both = aligned(
            sensor,
            moved.stamps,
            sensor_columns(moved, in_world=self._in_world),
            motion.begin,
            motion.end,
        )
        newest = self._verdict([both])
        if newest is None:
            return
        self.motions += 1
        self._kept.append(both)
        while len(self._kept) > 1 and self._seconds() > TUNING.kept:
            del self._kept[0]
        together = self._verdict(self._kept) if len(self._kept) > 1 else newest
        if together is None or (bool(together.wrong) != bool(newest.wrong) and _sees(newest)):
            # Something was mended, or has slipped: what was before says nothing more.
            self._kept, together = [both], newest
        self.verdict = together

    def _verdict(self, parts: Sequence[tuple[Aligned, ...]]) -> MountingVerdict | None:
        widths = [joined(of_width) for of_width in zip(*parts, strict=True)]
        fit = best_fit(widths, self.expected.rotation.T, -self.expected.to_origin)
        return None if fit is None else judge(fit, self.expected)

    def _seconds(self) -> float:
        return sum(len(one[0].used) for one in self._kept) * TUNING.step

    def _drop(self, before_ns: int) -> None:
        """Drops stored samples that no later motion needs."""
        last = before_ns - _PART_NS - 2 * _MARGIN_NS
        for stamps, values in ((self._sensor_ns, self._sensor), (self._motion_ns, self._motion)):
            while stamps and stamps[0] < last:
                stamps.popleft()
                values.popleft()

    def _forget(self) -> None:
        """Clears all samples, because time went back."""
        for part in (self._sensor, self._motion, self._sensor_ns, self._motion_ns):
            part.clear()
        self._begin = self._moved = 0


def _possible(values: Vector) -> bool:
    """Whether values are small enough for a reading of the sensor, in any known unit."""
    x, y, z = values
    return -MOST_SAID < x < MOST_SAID and -MOST_SAID < y < MOST_SAID and -MOST_SAID < z < MOST_SAID


def _sees(verdict: MountingVerdict) -> bool:
    """Returns whether a motion suffices to determine the orientation of the sensor."""
    return not verdict.unseen or verdict.error < TUNING.unseen


def joined(parts: Sequence[Aligned]) -> Aligned:
    """Joins the aligned samples of several motions, with gaps between them."""
    if len(parts) == 1:
        return parts[0]
    lags = parts[0].lags
    blank = np.full((2 * lags, parts[0].motion.shape[1]), np.nan)
    motion: list[Array] = []
    used = []
    for one in parts[:-1]:
        motion += [one.motion, blank]
        used += [one.used, np.zeros(2 * lags, dtype=bool)]
    return Aligned(
        np.concatenate([*motion, parts[-1].motion]),
        np.concatenate([one.force for one in parts]),
        np.concatenate([one.rate for one in parts]),
        np.concatenate([one.known for one in parts]),
        np.concatenate([*used, parts[-1].used]),
        lags,
        sum(one.noise * len(one.used) for one in parts) / sum(len(one.used) for one in parts),
    )
