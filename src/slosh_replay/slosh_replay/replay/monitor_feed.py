"""Runs the monitor over recorded data in the order of their stamps."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Sequence
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_estimator.agreement import MotionWatch
from slosh_estimator.comparison import Comparison, EstimatePoint, MeasuredPoint
from slosh_estimator.limits import Event
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.tray import Tray
from slosh_replay.recording.heights import Measurements
from slosh_replay.replay.model_set import ModelHeights
from slosh_replay.replay.series import chosen
from slosh_replay.replay.setting import Setting

NAN = float("nan")
CHECK_NS = 100_000_000
"""How often the monitor looks whether a side has fallen silent, as the node does."""
LONG_SILENCE_NS = 100 * CHECK_NS
_NEVER = 2**63 - 1


class MonitoredHeights(NamedTuple):
    """Estimated heights with stamps and flags, in the input format of the monitor.

    Attributes:
        stamps: (M,) [ns].
        linear, nonlinear: (M,) heights of L and of NL [m].
        flags: (M,) bits of EstimateFlag.
        readings: (M, 2) what a sensor reads of L and of NL [m]; None: the heights.
        delays: (M,) by how much a measurement comes late [ns]; None: it does not.
        azimuths: (M,) of the NL heights [rad]; None: unknown.
        accelerations: (M, 3) that drove the models, gravity excluded [m/s²]; None: unknown.
        tray: (M, C) nonlinear height of each container of a tray [m]; None: there is none.
    """

    stamps: Integers
    linear: Array
    nonlinear: Array
    flags: Integers
    readings: Array | None = None
    delays: Integers | None = None
    azimuths: Array | None = None
    accelerations: Array | None = None
    tray: Array | None = None


class MonitorFeed:
    """Runs the monitor over a recording's estimates and measured heights.

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
        self._next_check = self._newest = -(2**62)

    def add(self, estimates: MonitoredHeights, measured: Measurements) -> list[Comparison]:
        """Adds estimates and measured heights; returns comparisons of both, in order.

        Args:
            estimates: increasing stamps, none before those of earlier calls.
            measured: as above.

        Returns:
            the comparisons in the order in which they were made.
        """
        accelerations = _Accelerations(estimates.stamps, estimates.accelerations)
        estimates = chosen(estimates, self._needed(estimates, measured.stamps))
        points = _points(estimates)
        images = _images(measured)
        found: list[Comparison] = []
        at = 0
        for image in images:
            end = int(np.searchsorted(estimates.stamps, image.stamp_ns, side="right"))
            found += self._estimates(points[at:end], accelerations)
            at = max(at, end)
            found += self._check_until(image.stamp_ns)
            found += self.monitor.add_measurement(image, image.stamp_ns)
        return found + self._estimates(points[at:], accelerations)

    def finish(self) -> list[Comparison]:
        """Returns the remaining comparisons of estimates and measured heights at the end."""
        return self.monitor.finish()

    def take_events(self) -> list[Event]:
        """Returns the limit events since the last call."""
        return self.monitor.take_events()

    def _needed(self, estimates: MonitoredHeights, images: Integers) -> NDArray[np.bool_]:
        """Returns which estimates can change the monitor's output; others may be skipped.

        These are the neighbours of the images, the last one before each look at the clock, and all
        around an excess of the limit, or of what is near enough to it to go on with one.
        """
        stamps = estimates.stamps
        if len(stamps) == 0:
            return np.empty(0, dtype=bool)
        widest = int(np.diff(stamps, prepend=self._newest).max())
        self._newest = int(stamps[-1])
        changes = bool(self._due) and self._due[0][0] < stamps[-1]
        if widest > CHECK_NS or changes or estimates.delays is not None:
            # After a silence the clock may be looked at in another rhythm; with a delay images
            # need other estimates than those around them, perhaps earlier than these.
            return np.ones(len(stamps), dtype=bool)
        ticks = np.arange(self._next_check, stamps[-1] + 1, CHECK_NS)
        behind = np.concatenate(
            (np.searchsorted(stamps, images, side="right"), np.searchsorted(stamps, ticks))
        )
        needed = self.monitor.can_matter(stamps, estimates.nonlinear)
        needed[np.clip(np.concatenate((behind - 1, behind)), 0, len(stamps) - 1)] = True
        needed[[0, -1]] = True
        return needed

    def _estimates(
        self, points: list[EstimatePoint], accelerations: _Accelerations
    ) -> list[Comparison]:
        """Passes estimates to the monitor, each after the accelerations up to its stamp."""
        found: list[Comparison] = []
        at = 0
        while at < len(points):
            found += self._check_until(points[at].stamp_ns)
            until = min(self._next_check, self._due[0][0] + 1 if self._due else _NEVER)
            end = bisect_left(points, until, at, key=lambda point: point.stamp_ns)
            found += self.monitor.add_estimates(points[at:end])
            accelerations.pass_on(self.monitor.motions, points[end - 1].stamp_ns)
            at = end
        return found

    def _check_until(self, stamp_ns: int) -> list[Comparison]:
        """Runs the monitor's timeout checks up to a stamp [ns], and applies changed limits."""
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


class _Accelerations:
    """Accelerations of the container, passed in portions to the detection of its motions."""

    def __init__(self, stamps: Integers, accelerations: Array | None) -> None:
        self._stamps, self._accelerations = stamps, accelerations
        self._told = 0

    def pass_on(self, motions: MotionWatch, until_ns: int) -> None:
        """Passes on the accelerations up to a stamp [ns] that were not yet passed on."""
        if self._accelerations is None:
            return
        part = slice(self._told, int(np.searchsorted(self._stamps, until_ns, side="right")))
        self._told = part.stop
        motions.add_accelerations(self._stamps[part], self._accelerations[part])


def _points(estimates: MonitoredHeights) -> list[EstimatePoint]:
    stamps, linear, nonlinear, flags = (column.tolist() for column in estimates[:4])
    if all(
        column is None
        for column in (estimates.readings, estimates.delays, estimates.azimuths, estimates.tray)
    ):
        return list(map(EstimatePoint, stamps, linear, nonlinear, flags))
    count = len(stamps)
    readings = (
        repeat(None, count)
        if estimates.readings is None
        else map(tuple, estimates.readings.tolist())
    )
    delays = repeat(0, count) if estimates.delays is None else estimates.delays.tolist()
    azimuths = repeat(NAN, count) if estimates.azimuths is None else estimates.azimuths.tolist()
    return list(
        map(
            EstimatePoint,
            stamps,
            linear,
            nonlinear,
            flags,
            repeat(None),
            readings,
            delays,
            azimuths,
            repeat((), count) if estimates.tray is None else map(tuple, estimates.tray.tolist()),
        )
    )


def _images(measured: Measurements) -> list[MeasuredPoint]:
    columns: list[NDArray[Any]] = [
        measured.stamps, measured.heights, measured.stddev, measured.flags,
    ]  # fmt: skip
    if measured.waves is not None and measured.axes is not None:
        columns += [measured.waves, measured.axes]
        columns += [] if measured.levels is None else [measured.levels]
    rows: Any = zip(*(column.tolist() for column in columns), strict=True)
    return [MeasuredPoint(*row) for row in rows]


class ReplayedMonitor:
    """The monitor of a replay.

    Args:
        setting: of the replay.

    Attributes:
        feed: of the core.
        events: limit events so far.
    """

    def __init__(self, setting: Setting) -> None:
        self.feed = MonitorFeed(setting.limits, setting.limit_changes)
        if setting.tray is not None:
            self.feed.monitor.carry(setting.tray)
        self._carried = 0
        self.events: list[Event] = []
        self._outputs = setting.outputs

    def carry(self, trays: Sequence[tuple[int, Tray]]) -> None:
        """Applies the trays that are new, each after its stamp [ns]."""
        for last_ns, tray in trays[self._carried :]:
            self.feed.monitor.carry(tray, last_ns)
        self._carried = len(trays)

    def update(
        self, estimates: ModelHeights | None, own: tuple[int, int], measured: Measurements,
        *, final: bool,
    ) -> list[Comparison]:  # fmt: skip
        """Processes estimates and measured heights, and tells and returns comparisons and events.

        Args:
            estimates: of all models; None: there are none yet.
            own: which of them are the loaded model's L and NL twin.
            measured: heights.
            final: nothing follows.
        """
        given = _NOTHING if estimates is None else monitored(estimates, own)
        comparisons = self.feed.add(given, measured)
        if final:
            comparisons += self.feed.finish()
        events = self.feed.take_events()
        self.events += events
        if comparisons:
            self._outputs.comparisons(comparisons)
        if events:
            self._outputs.events(events)
        return comparisons


def monitored(estimates: ModelHeights, own: tuple[int, int]) -> MonitoredHeights:
    """Converts estimates of all models to the input format of the monitor.

    Args:
        estimates: of all models.
        own: which of them are the loaded model's L and NL twin.
    """
    columns = list(own)
    heights, readings = estimates.heights[:, columns], estimates.as_read[:, columns]
    delayed = estimates.delays is not None and estimates.delays.any()
    return MonitoredHeights(
        estimates.stamps,
        heights[:, 0],
        heights[:, 1],
        estimates.flags,
        None if np.array_equal(heights, readings, equal_nan=True) else readings,
        estimates.delays if delayed else None,
        estimates.azimuth,
        estimates.accelerations,
        estimates.tray,
    )


_FLOATS, _WHOLE = np.empty(0), np.empty(0, dtype=np.int64)
_NOTHING = MonitoredHeights(_WHOLE, _FLOATS, _FLOATS, _WHOLE)
