"""The monitor's core: compares measured with estimated heights and watches limits.

Stamps say when something happened, arrival times say whether a side still speaks. Both are whole
nanoseconds and arguments; the two clocks may differ.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from slosh_estimator.agreement import MotionWatch
from slosh_estimator.comparison import Comparison, Condition, EstimatePoint, MeasuredPoint
from slosh_estimator.limits import Event, LimitTracker, Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.sample import SECONDS
from slosh_estimator.sight import SATURATED, UNUSABLE, Sight, clocks_apart, obstacle
from slosh_report.metrics import RunningAccuracy

NAN = float("nan")
MAXIMUM_WAITING = 1000
"""Measurements that wait for an estimate; the oldest goes when there are more."""
PATIENCE_NS = 100_000_000
"""So long a measurement waits for an estimator that is silent: at its start, and after a pause,
the first image may be here before the first estimate [ns]."""


class Monitor:
    """Takes estimates and measurements as they come, and gives comparisons and events.

    A measurement waits until an estimate of the moment that it shows, or a later one, has come, or
    until the estimator has long been silent. It is compared with what the model expects a sensor
    to read; the limit of the estimated height is that of the liquid itself. A saturated
    measurement is a lower bound: it enters σ and ε only where it lies above the estimate, counts
    as disagreement only there, and does not end an excess of the measured height. Measurements
    without a height, and estimates from an unknown state or a doubtful input, are compared but do
    not enter σ and ε; where there is nothing else for too long, the monitor is blind.

    Attributes:
        motions: how well motion by motion agrees, where the estimates' acceleration is known.
        obstruction: why nothing that comes can be believed, as the user of this object knows;
            empty: no reason is known.
    """

    def __init__(self, settings: MonitorSettings) -> None:
        self.settings = settings
        self.linear = RunningAccuracy()
        self.nonlinear = RunningAccuracy()
        self.motions = MotionWatch(settings.disagreement_limit)
        self.unmatched = 0
        self.late_estimates = 0
        self._estimates: deque[EstimatePoint] = deque()
        self._waiting: deque[_Waiting] = deque()
        self._events: list[Event] = []
        self._excesses = 0
        self._measured_at: int | None = None
        self._estimated_at: int | None = None
        self._started_at: int | None = None
        self._last_measured = self._last_estimate_msh = NAN
        self._measured_stamp = 0
        self._sight = Sight(settings.timeout)
        self._met = False  # a measurement was compared since the last look at the clock
        self.obstruction = ""
        limits = (settings.measured_limit, settings.estimated_limit, settings.disagreement_limit)
        self._trackers = {
            source: LimitTracker(source, limit, settings.hysteresis)
            for source, limit in zip(Source, limits, strict=True)
        }

    def reset_accuracy(self) -> None:
        """Starts σ and ε, and the count of motions, anew."""
        self.linear.reset()
        self.nonlinear.reset()
        self.motions.reset()

    def add_estimate(self, point: EstimatePoint, arrival_ns: int) -> list[Comparison]:
        """Takes an estimate; returns the comparisons for which it was awaited."""
        self._estimated_at = arrival_ns
        estimates = self._estimates
        if estimates and point.stamp_ns <= estimates[-1].stamp_ns:
            if estimates[-1].stamp_ns - point.stamp_ns < self.settings.buffer / SECONDS:
                self.late_estimates += 1
                return []
            self._forget(estimates[-1].stamp_ns)  # time was set back
        estimates.append(point)
        self._drop_old(point.stamp_ns)
        self._last_estimate_msh = point.nonlinear
        self._track(Source.ESTIMATED, point.stamp_ns, point.nonlinear)
        found = list(self._ready(arrival_ns)) if self._waiting else []
        if point.acceleration is not None:
            self.motions.add_acceleration(point.stamp_ns, point.acceleration)
        return found

    def add_estimates(self, points: Sequence[EstimatePoint]) -> list[Comparison]:
        """Takes estimates of increasing stamps that arrive at these; as one by one, but faster."""
        found: list[Comparison] = []
        for index, point in enumerate(points):
            if self._is_quiet(points, index):
                self._estimates.extend(points[index:])
                self._drop_old(points[-1].stamp_ns)
                self._estimated_at = points[-1].stamp_ns
                self._last_estimate_msh = points[-1].nonlinear
                break
            found += self.add_estimate(point, point.stamp_ns)
        return found

    def add_measurement(self, point: MeasuredPoint, arrival_ns: int) -> list[Comparison]:
        """Takes a measurement; returns the comparisons that are possible now."""
        self._measured_at = arrival_ns
        height = NAN if point.flags & UNUSABLE else point.msh
        point = point._replace(msh=height)
        self._last_measured, self._measured_stamp = height, point.stamp_ns
        self._track(Source.MEASURED, point.stamp_ns, self._bounded(point))
        self._waiting.append(_Waiting(point, arrival_ns))
        if len(self._waiting) > MAXIMUM_WAITING:
            self._waiting.popleft()
            self.unmatched += 1
        return list(self._ready(arrival_ns))

    def check(self, now_ns: int) -> list[Comparison]:
        """Looks at the clock, several times within the timeout.

        Returns:
            where a side is silent, or no measurement has met an estimate since the last look:
            what the other side still says, with the state STALE or BLIND.
        """
        if self._started_at is None:
            self._started_at = now_ns
        measured_stale, estimate_stale = self.silent_sides(now_ns)
        if estimate_stale:
            self._close(Source.ESTIMATED, self._last_stamp(), "the estimate fell silent")
        if measured_stale:
            self._close(Source.MEASURED, self._last_stamp(), "the camera fell silent")
        if measured_stale or estimate_stale:
            self._close(Source.DISAGREEMENT, self._last_stamp(), "a side fell silent")
        comparisons = []
        while estimate_stale and self._waiting and self._waiting[0].is_over(now_ns):
            comparisons.append(self._without_estimate(now_ns))
        idle, self._met = not self._met, False
        speaks = bool(self._estimates) and not estimate_stale
        if speaks and (measured_stale or (idle and self.blindness(now_ns))):
            newest = self._estimates[-1]
            missing = MeasuredPoint(newest.stamp_ns, NAN)
            comparisons.append(
                self._compare(missing, _as_read(newest), now_ns, measured_stale=True)
            )
        return comparisons

    def finish(self) -> list[Comparison]:
        """Nothing follows: the comparisons of what still waits for an estimator that is silent."""
        found = []
        while self._waiting and self._stale(self._estimated_at, self._waiting[-1].arrival_ns):
            found.append(self._without_estimate(self._waiting[-1].arrival_ns))
        return found

    def silent_sides(self, now_ns: int) -> tuple[bool, bool]:
        """Whether the camera and whether the estimator is silent."""
        return self._stale(self._measured_at, now_ns), self._stale(self._estimated_at, now_ns)

    def take_events(self) -> list[Event]:
        """The events since the last call."""
        events, self._events = self._events, []
        return events

    def blindness(self, now_ns: int) -> str:
        """Why nothing could be compared for too long, though both sides speak; empty: it could."""
        if self.obstruction:
            return self.obstruction
        blindness = self._sight.blindness(now_ns)
        if not blindness or not self._measured_stamp or not self._estimates:
            return blindness
        return clocks_apart(self._measured_stamp, self._estimates[-1].stamp_ns) or blindness

    def condition(self, now_ns: int) -> Condition:
        """The state: an exceeded limit weighs most, then a silent side, then blindness."""
        if any(tracker.active for tracker in self._trackers.values()):
            return Condition.ERROR
        if any(self.silent_sides(now_ns)):
            return Condition.STALE
        if self.blindness(now_ns):
            return Condition.BLIND
        share = self.settings.warn_share
        near = (
            self._last_measured > share * self._trackers[Source.MEASURED].limit
            or self._last_estimate_msh > share * self._trackers[Source.ESTIMATED].limit
        )
        return Condition.WARN if near else Condition.OK

    def _stale(self, at_ns: int | None, now_ns: int) -> bool:
        since = at_ns if at_ns is not None else self._started_at
        return since is not None and (now_ns - since) * SECONDS > self.settings.timeout

    def _last_stamp(self) -> int:
        newest = [self._estimates[-1].stamp_ns] if self._estimates else []
        newest += [self._waiting[-1].point.stamp_ns] if self._waiting else []
        return max(newest, default=0)

    def _is_quiet(self, points: Sequence[EstimatePoint], first: int) -> bool:
        """True where the estimates from the first on complete no comparison and cause no event."""
        tracker = self._trackers[Source.ESTIMATED]
        if self._waiting or tracker.active or not self._estimates:
            return False
        follow = points[first].stamp_ns > self._estimates[-1].stamp_ns
        return follow and all(point.nonlinear <= tracker.limit for point in points[first:])

    def _drop_old(self, newest_ns: int) -> None:
        late = max(self._estimates[-1].delay_ns, 0)
        oldest = newest_ns - self.settings.buffer / SECONDS - late
        while self._estimates[0].stamp_ns < oldest:
            self._estimates.popleft()

    def _track(self, source: Source, stamp_ns: int, value: float) -> None:
        tracker = self._trackers[source]
        if not tracker.active and value > tracker.limit:
            self._excesses += 1
            tracker.identifier = self._excesses
        event = tracker.update(stamp_ns, value)
        if event is not None:
            self._events.append(event)

    def _close(self, source: Source, stamp_ns: int, reason: str) -> None:
        event = self._trackers[source].close(stamp_ns, reason)
        if event is not None:
            self._events.append(event)

    def _bounded(self, point: MeasuredPoint) -> float:
        """The height for the limit; NaN where a lower bound cannot tell that an excess ends."""
        low = point.msh <= self._trackers[Source.MEASURED].release_level
        return NAN if point.flags & SATURATED and low else point.msh

    def _forget(self, stamp_ns: int) -> None:
        """Ends everything that hangs on stamps, at the newest of them."""
        self._estimates.clear()
        self._waiting.clear()
        self.motions.forget()
        for source in Source:
            self._close(source, stamp_ns, "time was set back")

    def _ready(self, now_ns: int) -> Iterator[Comparison]:
        """Comparisons of the waiting measurements that the estimates have reached."""
        if not self._estimates:
            return
        delay = self._estimates[-1].delay_ns
        newest = self._estimates[-1].stamp_ns + delay
        # All of them: one stamp far in the future must not hold up those behind it.
        ready = [one.point for one in self._waiting if one.point.stamp_ns <= newest]
        if not ready:
            return
        self._waiting = deque(one for one in self._waiting if one.point.stamp_ns > newest)
        for point in ready:
            estimate = self._interpolated(point.stamp_ns)
            if estimate is None:
                self.unmatched += 1
            yield self._compare(point, estimate, now_ns)

    def _without_estimate(self, now_ns: int) -> Comparison:
        """The comparison of the measurement that has waited longest."""
        point = self._waiting.popleft().point
        return self._compare(point, None, now_ns, estimate_stale=True)

    def _interpolated(self, seen_ns: int) -> EstimatePoint | None:
        """The reading that is stamped so, linear between its neighbours; None: not in the buffer.

        Each estimate's reading comes late by its own delay, which a drifting clock lets grow.
        """
        index = bisect_left(self._estimates, seen_ns, key=_seen_ns)
        after = self._estimates[min(index, len(self._estimates) - 1)]
        if _seen_ns(after) == seen_ns:
            return _as_read(after)
        if index == 0 or index == len(self._estimates):
            return None
        before = self._estimates[index - 1]
        width = _seen_ns(after) - _seen_ns(before)
        if width * SECONDS > self.settings.max_gap:
            return None
        share = (seen_ns - _seen_ns(before)) / width
        stamp_ns = before.stamp_ns + round(share * (after.stamp_ns - before.stamp_ns))
        before, after = _as_read(before), _as_read(after)
        return EstimatePoint(
            stamp_ns,
            before.linear + share * (after.linear - before.linear),
            before.nonlinear + share * (after.nonlinear - before.nonlinear),
            before.flags | after.flags,
        )

    def _compare(
        self,
        measured: MeasuredPoint,
        estimate: EstimatePoint | None,
        now_ns: int,
        *,
        measured_stale: bool = False,
        estimate_stale: bool = False,
    ) -> Comparison:
        linear, nonlinear, flags = (
            (estimate.linear, estimate.nonlinear, estimate.flags) if estimate else (NAN, NAN, 0)
        )
        if not measured_stale:
            self._met = True
            found = obstacle(measured.msh, measured.flags, nonlinear, flags)
            self._sight.look(now_ns, found)
            if not found:
                self._judge(measured, linear, nonlinear)
        self._watch_disagreement(measured, nonlinear)
        return Comparison(
            measured.stamp_ns,
            measured.msh,
            measured.stddev,
            linear,
            nonlinear,
            measured.msh - linear,
            measured.msh - nonlinear,
            self.linear.sigma,
            self.nonlinear.sigma,
            self.linear.epsilon,
            self.nonlinear.epsilon,
            self.nonlinear.count,
            self.condition(now_ns),
            measured_stale,
            estimate_stale,
            measured.flags,
            flags,
        )

    def _judge(self, measured: MeasuredPoint, linear: float, nonlinear: float) -> None:
        """Takes a pair into σ and ε; a lower bound only where it lies above the estimate."""
        bound = bool(measured.flags & SATURATED)
        if not (bound and measured.msh <= nonlinear):
            self.motions.add_pair(measured.stamp_ns, measured.msh, measured.stddev, nonlinear)
        for accuracy, value in ((self.linear, linear), (self.nonlinear, nonlinear)):
            if not (bound and measured.msh <= value):
                accuracy.update(measured.msh, value)

    def _watch_disagreement(self, measured: MeasuredPoint, nonlinear: float) -> None:
        difference = measured.msh - nonlinear
        gap = max(difference, 0.0) if measured.flags & SATURATED else abs(difference)
        self._track(Source.DISAGREEMENT, measured.stamp_ns, gap)


class _Waiting(NamedTuple):
    """A measurement that waits for its estimate since it arrived [ns]."""

    point: MeasuredPoint
    arrival_ns: int

    def is_over(self, now_ns: int) -> bool:
        """Whether it has waited long enough for one who is silent; a clock may be set back."""
        return not 0 <= now_ns - self.arrival_ns < PATIENCE_NS


def _seen_ns(point: EstimatePoint) -> int:
    """The stamp of a measurement of what was estimated [ns]."""
    return point.stamp_ns + point.delay_ns


def _as_read(point: EstimatePoint) -> EstimatePoint:
    """The estimate with what a sensor reads in place of the liquid's heights."""
    if point.reading is None:
        return point
    linear, nonlinear = point.reading
    return point._replace(linear=linear, nonlinear=nonlinear)
