"""Feeds the monitor's core in stamp order, with the stamps as its clock."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from itertools import repeat
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.recording.heights import Measurements
from slosh_bag.replay.columns import chosen
from slosh_estimator.comparison import Comparison, EstimatePoint, MeasuredPoint
from slosh_estimator.limits import Event
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CHECK_NS = 100_000_000
"""How often the monitor looks whether a side has fallen silent, as the node does."""
LONG_SILENCE_NS = 100 * CHECK_NS
_NEVER = 2**63 - 1


class Heights(NamedTuple):
    """The estimates that are monitored.

    Attributes:
        stamps: (M,) [ns].
        linear, nonlinear: (M,) heights of L and of NL [m].
        flags: (M,) bits of EstimateFlag.
        readings: (M, 2) what a sensor reads of L and of NL [m]; None: the heights.
        delays: (M,) by how much a measurement comes late [ns]; None: it does not.
    """

    stamps: Integers
    linear: Array
    nonlinear: Array
    flags: Integers
    readings: Array | None = None
    delays: Integers | None = None


class MonitorFeed:
    """The monitor's core over a recording.

    Whether a side still speaks is judged by the stamps: a recording has no other clock that two
    replays agree on.

    Args:
        settings: what the monitor watches.
        changes: what it watches for data with stamps after these [ns], in order.
    """

    def __init__(
        self, settings: MonitorSettings, changes: Sequence[tuple[int, MonitorSettings]] = ()
    ) -> None:
        self.settings = settings
        self.changes = tuple(changes)
        self.monitor = Monitor(settings)
        self._due = deque(changes)
        self._next_check = self._newest = self._loud = -(2**62)
        every = [settings, *(later for _, later in changes)]
        self._loud_level = min(_release_level(one) for one in every)
        self._hold_ns = max(one.hysteresis.hold_ns for one in every)

    def add(self, estimates: Heights, measured: Measurements) -> list[Comparison]:
        """Takes what comes next on both sides; an estimate comes before an image of its moment.

        Args:
            estimates: increasing stamps, none before those of earlier calls.
            measured: as above.

        Returns:
            the comparisons in the order in which they were made.
        """
        estimates = chosen(estimates, self._needed(estimates, measured.stamps))
        points = _points(estimates)
        images = [MeasuredPoint(*row) for row in _rows(measured)]
        found: list[Comparison] = []
        at = 0
        for image in images:
            end = int(np.searchsorted(estimates.stamps, image.stamp_ns, side="right"))
            found += self._estimates(points[at:end])
            at = max(at, end)
            found += self._check_until(image.stamp_ns)
            found += self.monitor.add_measurement(image, image.stamp_ns)
        return found + self._estimates(points[at:])

    def finish(self) -> list[Comparison]:
        """Nothing follows: the comparisons that are left."""
        return self.monitor.finish()

    def take_events(self) -> list[Event]:
        """The events since the last call."""
        return self.monitor.take_events()

    def _needed(self, estimates: Heights, images: Integers) -> NDArray[np.bool_]:
        """Which estimates can change what the monitor says; the others it would only store.

        These are the neighbours of the images, the last one before each look at the clock, and all
        around an excess of the limit, or of what is near enough to it to go on with one.
        """
        stamps = estimates.stamps
        if len(stamps) == 0:
            return np.empty(0, dtype=bool)
        loud = ~(estimates.nonlinear <= self._loud_level)
        last_loud = np.maximum.accumulate(np.where(loud, stamps, self._loud))
        widest = int(np.diff(stamps, prepend=self._newest).max())
        self._loud, self._newest = int(last_loud[-1]), int(stamps[-1])
        if widest > CHECK_NS or estimates.delays is not None:
            # After a silence the clock may be looked at in another rhythm; with a delay images
            # need other estimates than those around them, perhaps earlier than these.
            return np.ones(len(stamps), dtype=bool)
        near = stamps - last_loud <= self._hold_ns + CHECK_NS
        ticks = np.arange(self._next_check, stamps[-1] + 1, CHECK_NS)
        behind = np.concatenate(
            (np.searchsorted(stamps, images, side="right"), np.searchsorted(stamps, ticks))
        )
        needed = near
        needed[1:] |= near[:-1].copy()
        needed[np.clip(np.concatenate((behind - 1, behind)), 0, len(stamps) - 1)] = True
        needed[[0, -1]] = True
        return needed

    def _estimates(self, points: list[EstimatePoint]) -> list[Comparison]:
        found: list[Comparison] = []
        at = 0
        while at < len(points):
            found += self._check_until(points[at].stamp_ns)
            until = min(self._next_check, self._due[0][0] + 1 if self._due else _NEVER)
            end = bisect_left(points, until, at, key=lambda point: point.stamp_ns)
            found += self.monitor.add_estimates(points[at:end])
            at = end
        return found

    def _check_until(self, stamp_ns: int) -> list[Comparison]:
        """Looks at the clock at every tick up to a moment; takes over what holds at it."""
        if stamp_ns - self._next_check > LONG_SILENCE_NS:
            # Both sides were silent; after the first tick the others would say nothing new.
            self._next_check = stamp_ns
        found: list[Comparison] = []
        while self._next_check <= stamp_ns:
            found += self.monitor.check(self._next_check)
            self._next_check += CHECK_NS
        while self._due and self._due[0][0] < stamp_ns:
            last_ns, settings = self._due.popleft()
            self.monitor.change_settings(settings, last_ns)
        return found


def _release_level(settings: MonitorSettings) -> float:
    """Estimates up to this height neither begin nor hold an excess [m]."""
    limit = settings.estimated_limit
    return settings.hysteresis.release * limit if np.isfinite(limit) else np.inf


def _points(estimates: Heights) -> list[EstimatePoint]:
    stamps, linear, nonlinear, flags = (column.tolist() for column in estimates[:4])
    if estimates.readings is None and estimates.delays is None:
        return list(map(EstimatePoint, stamps, linear, nonlinear, flags))
    count = len(stamps)
    readings = (
        repeat(None, count)
        if estimates.readings is None
        else map(tuple, estimates.readings.tolist())
    )
    delays = repeat(0, count) if estimates.delays is None else estimates.delays.tolist()
    return list(
        map(EstimatePoint, stamps, linear, nonlinear, flags, repeat(None), readings, delays)
    )


def _rows(measured: Measurements) -> zip[tuple[int, float, float, int]]:
    return zip(
        measured.stamps.tolist(),
        measured.heights.tolist(),
        measured.stddev.tolist(),
        measured.flags.tolist(),
        strict=True,
    )
