"""Compares measured with estimated heights and checks both against limits.

Stamps say when something happened, arrival times say whether a side still speaks. Both are whole
nanoseconds and arguments; the two clocks may differ.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from slosh_estimator.agreement import MotionWatch
from slosh_estimator.comparison import (
    Comparison,
    Condition,
    EstimatePoint,
    Expected,
    MeasuredPoint,
    Waiting,
)
from slosh_estimator.height_checks import LevelWatch, RepeatedHeights, StrayHeights
from slosh_estimator.limits import Event, LimitChange, LimitTracker, Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.sight import (
    AMBIGUOUS,
    FROZEN,
    SATURATED,
    UNUSABLE,
    Sight,
    clocks_apart,
    estimate_obstacle,
    obstacle,
)
from slosh_estimator.tray_watch import TrayWatch
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag
from slosh_model.tray import Tray
from slosh_motion.inputs.sampling import SECONDS_PER_NS
from slosh_motion.signals.metrics import RunningAccuracy

NAN = float("nan")
MAXIMUM_WAITING = 1000
"""Measurements that wait for an estimate; the oldest goes when there are more."""
_NEVER = 2**63
_TOO_SLOW = int(EstimateFlag.INPUT_TOO_SLOW)
_NO_CONTAINER = int(EstimateFlag.NO_CONTAINER)
HEARTBEAT = 3
"""After so many looks at the clock without a comparison one says what holds."""


class Monitor:
    """Compares estimates with measurements as they arrive, and checks them against limits.

    >>> monitor = Monitor(MonitorSettings(measured_limit=0.02))  # m
    >>> monitor.add_measurement(MeasuredPoint(stamp_ns=10, msh=0.012), arrival_ns=10)
    []
    >>> len(monitor.add_estimate(EstimatePoint(10, linear=0.014, nonlinear=0.011), arrival_ns=10))
    1

    A measurement waits until an estimate of the moment that it shows, or a later one, has come, or
    until the estimator has long been silent. It is compared with what the model expects a sensor
    to read; the limit of the estimated height is that of the liquid itself. A saturated
    measurement is a lower bound: it enters MAE and ε only where it lies above the estimate, counts
    as disagreement only there, and does not end an excess of the measured height. Measurements
    without a height, and estimates from an unknown state or a doubtful input, are compared but do
    not enter MAE and ε; where there is nothing else for too long, the monitor is blind.

    Without a camera, by its settings, the estimate alone is watched, and each look at the clock
    gives a comparison of it with nothing.

    While the estimates say that the gripper is empty nothing is watched, and nothing is missed.

    Args:
        settings: limits and timeouts.
        number: gives each limit violation its number; None: they are counted here.

    Attributes:
        tray: the limits of a tray's containers, of the first of which the estimates are; None:
            there is none.
        level: whether the camera sees the level that the fill height tells.
        motions: how well motion by motion agrees, where the estimates' acceleration is known.
        obstruction: why nothing that comes can be believed, as the user of this object knows;
            empty: no reason is known.
        standstill: that the clock does not move, as the user of this object knows; empty: it does.
    """

    def __init__(self, settings: MonitorSettings, number: Callable[[], int] | None = None) -> None:
        self.settings = settings
        self._number = number or self.next_excess
        self.linear = RunningAccuracy()
        self.nonlinear = RunningAccuracy()
        self.motions = MotionWatch(settings.disagreement_limit)
        self.unmatched = 0
        self.late_estimates = 0
        self._estimates: deque[EstimatePoint] = deque()
        self._waiting: deque[Waiting] = deque()
        self._events: list[Event] = []
        self._excesses = 0
        self._measured_at: int | None = None
        self._estimated_at: int | None = None
        self._started_at: int | None = None
        self._last_measured = self._last_estimate_msh = NAN
        self._measured_stamp = 0
        self.tray: TrayWatch | None = None
        self._sight, self.level = Sight(settings.timeout), LevelWatch()
        self._pictures, self._strays = RepeatedHeights(), StrayHeights()
        self._met = False  # a measurement was compared since the last look at the clock
        self._silent_looks = 0
        self.obstruction = self.standstill = ""
        self._trackers = {
            source: LimitTracker(source, limit, settings.hysteresis, settings.limit_name(source))
            for source, limit in settings.limits.items()
        }
        self._changes: dict[Source, deque[LimitChange]] = {source: deque() for source in Source}

    def change_settings(self, settings: MonitorSettings, stamp_ns: int | None = None) -> int:
        """Changes the height limits for data with later stamps.

        Values up to that moment are judged by the old limits, later ones by the new limits,
        whenever they arrive. The other settings apply at once.

        Args:
            settings: the new ones.
            stamp_ns: the last moment of the old limits [ns]; None: the newest of what has come.

        Returns:
            the last moment of the old limits [ns]; 0: nothing has come yet.
        """
        if stamp_ns is None:
            stamp_ns = self._newest_stamp()
        self.settings = settings
        self._sight.timeout = settings.timeout
        self.level.forget()
        if self.tray is not None:
            self._events += self.tray.change_settings(settings, stamp_ns)
        self.motions.watch(settings.disagreement_limit)
        for source, limit in settings.limits.items():
            self._changes[source].append(
                LimitChange(stamp_ns, limit, settings.hysteresis, settings.limit_name(source))
            )
        return stamp_ns

    def carry(self, tray: Tray, stamp_ns: int = 0) -> None:
        """Sets the containers of the tray that are monitored, each with its own limit.

        Args:
            tray: the tray.
            stamp_ns: the last moment of the tray before, with the same places [ns].
        """
        if self.tray is None or self.tray.tray.names != tray.names:
            self.tray = TrayWatch(tray, self.settings, self._number)
        else:
            self.tray.carry(tray, stamp_ns)

    def add_tray(self, stamp_ns: int, heights: Sequence[float]) -> None:
        """Checks the height [m] of each container on the tray against the container's limit."""
        if self.tray is not None:
            self._events += self.tray.update(stamp_ns, heights)

    def reset_accuracy(self) -> None:
        """Resets the mean absolute error, the peak error and the count of motions."""
        self.linear.reset()
        self.nonlinear.reset()
        self.motions.reset()

    def add_estimate(self, point: EstimatePoint, arrival_ns: int) -> list[Comparison]:
        """Adds an estimate; returns its comparisons with measured heights that waited for it."""
        self._estimated_at = arrival_ns
        estimates = self._estimates
        if estimates and point.stamp_ns <= estimates[-1].stamp_ns:
            if estimates[-1].stamp_ns - point.stamp_ns < self.settings.buffer / SECONDS_PER_NS:
                self.late_estimates += 1
                return []
            self._forget(estimates[-1].stamp_ns)  # time was set back
        estimates.append(point)
        self._drop_old(point.stamp_ns)
        self._last_estimate_msh = point.nonlinear
        if self.tray is None:
            self._track(Source.ESTIMATED, point.stamp_ns, point.nonlinear)
        elif point.tray:
            self.add_tray(point.stamp_ns, point.tray)
        if self.vacant:
            for source in Source:
                self._close_one(source, point.stamp_ns, "no container")
        found = list(self._ready(arrival_ns)) if self._waiting else []
        if point.acceleration is not None:
            self.motions.add_acceleration(point.stamp_ns, point.acceleration)
        return found

    def add_estimates(self, points: Sequence[EstimatePoint]) -> list[Comparison]:
        """Adds estimates with increasing stamps, as if one by one, but faster."""
        found: list[Comparison] = []
        for index, point in enumerate(points):
            if self._is_quiet(points, index):
                rest = points[index:]
                self._estimates.extend(rest)
                self._drop_old(rest[-1].stamp_ns)
                self._estimated_at = rest[-1].stamp_ns
                self._last_estimate_msh = rest[-1].nonlinear
                for quiet in rest:
                    if quiet.acceleration is not None:
                        self.motions.add_acceleration(quiet.stamp_ns, quiet.acceleration)
                break
            found += self.add_estimate(point, point.stamp_ns)
        return found

    def add_measurement(self, point: MeasuredPoint, arrival_ns: int) -> list[Comparison]:
        """Adds a measured height; returns the comparisons with estimates that are now ready.

        Without a camera, by the settings, it is not looked at.
        """
        if not self.settings.camera:
            return []
        self._measured_at = arrival_ns
        usable = not point.flags & UNUSABLE and abs(point.msh) <= TUNING.highest
        height = point.msh if usable else NAN
        point = point._replace(msh=height)
        self._last_measured, self._measured_stamp = height, point.stamp_ns
        if not self.vacant:
            self._track(Source.MEASURED, point.stamp_ns, self._bounded(point))
        self._waiting.append(Waiting(point, arrival_ns))
        if len(self._waiting) > MAXIMUM_WAITING:
            self._waiting.popleft()
            self.unmatched += 1
        return list(self._ready(arrival_ns))

    def check(self, now_ns: int) -> list[Comparison]:
        """Checks timeouts; returns one-sided comparisons while camera or estimator is silent.

        Returns:
            where a side is silent, or no measurement has met an estimate since the last look:
            what the other side still says, with the state STALE or BLIND. Where nothing has been
            said for HEARTBEAT looks, that state alone.
        """
        if self._started_at is None:
            self._started_at = now_ns
        measured_stale, estimate_stale = self.silent_sides(now_ns)
        if estimate_stale:
            self._close(Source.ESTIMATED, self._last_stamp(), "estimates stopped")
        if measured_stale:
            self._close(Source.MEASURED, self._last_stamp(), "measurements stopped")
        if measured_stale or estimate_stale:
            self._close(
                Source.DISAGREEMENT, self._last_stamp(), "estimates or measurements stopped"
            )
        comparisons = []
        while estimate_stale and self._waiting and self._waiting[0].is_over(now_ns):
            comparisons.append(self._without_estimate(now_ns))
        idle, self._met = not self._met, False
        speaks = bool(self._estimates) and not estimate_stale
        alone = not self.settings.camera
        if alone and speaks:
            comparisons.append(self._alone(now_ns))
        elif speaks and (measured_stale or (idle and self.blindness(now_ns))):
            comparisons.append(self._unmeasured(self._estimates[-1], now_ns))
        self._silent_looks = 0 if comparisons or not idle else self._silent_looks + 1
        if self._silent_looks >= (1 if alone else HEARTBEAT) and self._is_out(now_ns):
            self._silent_looks = 0
            comparisons.append(self._unmeasured(None, now_ns))
        return comparisons

    def finish(self) -> list[Comparison]:
        """Returns comparisons without estimate for measured heights that still wait for one."""
        found = []
        while self._waiting and self._stale(self._estimated_at, self._waiting[-1].arrival_ns):
            found.append(self._without_estimate(self._waiting[-1].arrival_ns))
        return found

    def silent_sides(self, now_ns: int) -> tuple[bool, bool]:
        """Returns whether the camera is silent, and whether the estimator is."""
        measured = self.settings.camera and self._stale(self._measured_at, now_ns)
        return measured, self._stale(self._estimated_at, now_ns)

    def can_matter(
        self, stamps: NDArray[np.int64], heights: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Returns which estimates can cause a limit event; see `LimitTracker.can_matter`."""
        if self.tray is not None or self._changes[Source.ESTIMATED]:
            return np.ones(len(stamps), dtype=bool)
        return self._trackers[Source.ESTIMATED].can_matter(stamps, heights)

    def take_events(self) -> list[Event]:
        """Returns the limit events since the last call, in order."""
        events, self._events = self._events, []
        return events

    def blindness(self, now_ns: int) -> str:
        """Returns why no heights could be compared for too long; empty if they could."""
        if self.vacant:
            return ""
        if self.standstill or self.obstruction:
            return self.standstill or self.obstruction
        blindness = self._sight.blindness(now_ns)
        if not blindness or not self._measured_stamp or not self._estimates:
            return blindness
        return clocks_apart(self._measured_stamp, self._estimates[-1].stamp_ns) or blindness

    def condition(self, now_ns: int) -> Condition:
        """Returns the monitor's state, such as limit violation, timeout or nothing compared."""
        tray = self.tray
        if any(tracker.active for tracker in self._trackers.values()) or (tray and tray.active):
            return Condition.ERROR
        if any(self.silent_sides(now_ns)):
            return Condition.STALE
        if self.blindness(now_ns):
            return Condition.BLIND
        share = self.settings.warn_share
        if self.vacant:
            return Condition.WARN if tray is not None and tray.share > share else Condition.OK
        near = (
            self._last_measured > share * self._trackers[Source.MEASURED].limit
            or self._last_estimate_msh > share * self._trackers[Source.ESTIMATED].limit
        )
        near = near or (tray is not None and tray.share > share)
        warned = near or self.too_slow or self.motions.warning or self.level.text
        return Condition.WARN if warned else Condition.OK

    @property
    def at_rim(self) -> str:
        """Returns a warning if the liquid is known to be above the rim, else an empty text."""
        above = [
            tracker.limit_text
            for tracker in self._trackers.values()
            if tracker.active and tracker.at_rim
        ]
        return f"the liquid is above the {above[0]}" if above else ""

    @property
    def vacant(self) -> bool:
        """Whether the newest estimate says that the gripper is empty."""
        return bool(self._estimates) and self._estimates[-1].flags & _NO_CONTAINER != 0

    @property
    def too_slow(self) -> bool:
        """Whether the input's rate is too low for one of the sloshing modes."""
        return bool(self._estimates) and self._estimates[-1].flags & _TOO_SLOW != 0

    def _is_out(self, now_ns: int) -> bool:
        """Returns whether camera or estimator is silent, or their heights cannot be compared."""
        return any(self.silent_sides(now_ns)) or bool(self.blindness(now_ns))

    def _alone(self, now_ns: int) -> Comparison:
        """Returns a comparison with the newest estimate only, for use without a camera."""
        newest = self._estimates[-1]
        self._sight.look(now_ns, estimate_obstacle(newest.nonlinear, newest.flags))
        missing = MeasuredPoint(newest.stamp_ns, NAN)
        return self._compare(missing, newest.expected, now_ns, image=False)

    def _unmeasured(self, estimate: EstimatePoint | None, now_ns: int) -> Comparison:
        """Returns a comparison with an estimate only, since no height was measured for it."""
        newest = self._estimates[-1].stamp_ns if self._estimates else 0
        stamp_ns = estimate.stamp_ns if estimate else max(self._measured_stamp, newest)
        return self._compare(
            MeasuredPoint(stamp_ns, NAN),
            estimate.expected if estimate else None,
            now_ns,
            image=False,
            measured_stale=self.settings.camera,
            estimate_stale=estimate is None and self.silent_sides(now_ns)[1],
        )

    def _stale(self, at_ns: int | None, now_ns: int) -> bool:
        since = at_ns if at_ns is not None else self._started_at
        return since is not None and (now_ns - since) * SECONDS_PER_NS > self.settings.timeout

    def _last_stamp(self) -> int:
        newest = [self._estimates[-1].stamp_ns] if self._estimates else []
        newest += [self._waiting[-1].point.stamp_ns] if self._waiting else []
        return max(newest, default=0)

    def _is_quiet(self, points: Sequence[EstimatePoint], first: int) -> bool:
        """Returns whether the estimates still to add cause neither a comparison nor an event."""
        if self._waiting or self._changes[Source.ESTIMATED] or not self._estimates:
            return False
        if self.tray is not None:
            return False
        follow = points[first].stamp_ns > self._estimates[-1].stamp_ns
        if points[-1].flags & _NO_CONTAINER and any(t.active for t in self._trackers.values()):
            return False
        heights = (point.nonlinear for point in points[first:])
        return follow and self._trackers[Source.ESTIMATED].ignores(heights)

    def _drop_old(self, newest_ns: int) -> None:
        late = max(self._estimates[-1].delay_ns, 0)
        oldest = newest_ns - self.settings.buffer / SECONDS_PER_NS - late
        while self._estimates[0].stamp_ns < oldest:
            self._estimates.popleft()

    def _newest_stamp(self) -> int:
        """Returns the newest stamp of camera and estimator [ns], if they share one clock."""
        measured = self._measured_stamp
        if not self._estimates:
            return measured
        estimated = self._estimates[-1].stamp_ns
        return estimated if clocks_apart(measured, estimated) else max(measured, estimated)

    def _change_limit(self, source: Source, stamp_ns: int) -> None:
        """Applies the changes of limits that are due at a stamp [ns]."""
        changes = self._changes[source]
        while changes and changes[0].stamp_ns < stamp_ns:
            event = self._trackers[source].change(*changes.popleft())
            if event is not None:
                self._events.append(event)

    def _track(self, source: Source, stamp_ns: int, value: float) -> None:
        self._change_limit(source, stamp_ns)
        tracker = self._trackers[source]
        if not tracker.active and value > tracker.limit:
            tracker.identifier = self._number()
        event = tracker.update(stamp_ns, value)
        if event is not None:
            self._events.append(event)

    def next_excess(self) -> int:
        """Returns the number of the next limit violation, counting from 1."""
        self._excesses += 1
        return self._excesses

    def _close(self, source: Source, stamp_ns: int, reason: str) -> None:
        if source is Source.ESTIMATED and self.tray is not None:
            self._events += self.tray.close(stamp_ns, reason)
        self._close_one(source, stamp_ns, reason)

    def _close_one(self, source: Source, stamp_ns: int, reason: str) -> None:
        """Ends a limit violation of the tray's first container, not of other containers."""
        event = self._trackers[source].close(stamp_ns, reason)
        if event is not None:
            self._events.append(event)

    def _bounded(self, point: MeasuredPoint) -> float:
        """Returns the measured height [m] to check, or NaN for a lower bound below the limit."""
        self._change_limit(Source.MEASURED, point.stamp_ns)
        low = point.msh <= self._trackers[Source.MEASURED].release_level
        return NAN if point.flags & SATURATED and low else point.msh

    def _forget(self, stamp_ns: int) -> None:
        """Forgets everything that depends on stamps, since time jumped back."""
        self._estimates.clear()
        self._waiting.clear()
        self.motions.forget()
        for source in Source:
            self._close(source, stamp_ns, "time jumped back")
            self._change_limit(source, _NEVER)

    def _ready(self, now_ns: int) -> Iterator[Comparison]:
        """Yields comparisons for measurements whose stamps the estimates have reached."""
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
        """Returns a comparison with the oldest measured height only, which has no estimate."""
        point = self._waiting.popleft().point
        return self._compare(point, None, now_ns, estimate_stale=True)

    def _interpolated(self, seen_ns: int) -> Expected | None:
        """Interpolates the predicted measurement at a stamp [ns]; None outside the estimates.

        Each estimate's reading comes late by its own delay, which a drifting clock lets grow.
        """
        index = bisect_left(self._estimates, seen_ns, key=_seen_ns)
        after = self._estimates[min(index, len(self._estimates) - 1)]
        if _seen_ns(after) == seen_ns:
            return after.expected
        if index == 0 or index == len(self._estimates):
            return None
        before = self._estimates[index - 1]
        width = _seen_ns(after) - _seen_ns(before)
        if width * SECONDS_PER_NS > self.settings.max_gap:
            return None
        share = (seen_ns - _seen_ns(before)) / width
        return before.expected.towards(after.expected, share)

    def _compare(
        self,
        measured: MeasuredPoint,
        estimate: Expected | None,
        now_ns: int,
        *,
        image: bool = True,
        measured_stale: bool = False,
        estimate_stale: bool = False,
    ) -> Comparison:
        expected = estimate or Expected()
        linear, nonlinear, flags, _ = expected
        if image:
            self._met = True
            if self._pictures.look(measured, expected):
                measured = measured._replace(flags=measured.flags | FROZEN)
            if self._strays.look(measured, expected):
                measured = measured._replace(flags=measured.flags | AMBIGUOUS)
            self.level.look(measured, expected)
            found = obstacle(measured.msh, measured.flags, nonlinear, flags)
            self._sight.look(now_ns, found)
            if not found:
                self._judge(measured, expected)
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
            not self.settings.camera,
            bool(self.motions.warning),
        )

    def _judge(self, measured: MeasuredPoint, expected: Expected) -> None:
        """Adds a pair of heights to the accuracy; skips a lower bound below the estimate."""
        linear, nonlinear, _, wave = expected
        bound = bool(measured.flags & SATURATED)
        if not (bound and measured.msh <= nonlinear):
            self.motions.add_pair(
                measured.stamp_ns, measured.msh, measured.stddev, nonlinear,
                (measured.wave, wave, measured.axis),
            )  # fmt: skip
        for accuracy, value in ((self.linear, linear), (self.nonlinear, nonlinear)):
            if not (bound and measured.msh <= value):
                accuracy.update(measured.msh, value)

    def _watch_disagreement(self, measured: MeasuredPoint, nonlinear: float) -> None:
        difference = measured.msh - nonlinear
        gap = max(difference, 0.0) if measured.flags & SATURATED else abs(difference)
        self._track(Source.DISAGREEMENT, measured.stamp_ns, gap)


def _seen_ns(point: EstimatePoint) -> int:
    """Returns the stamp [ns] at which the sensor measures the state of an estimate."""
    return point.stamp_ns + point.delay_ns
