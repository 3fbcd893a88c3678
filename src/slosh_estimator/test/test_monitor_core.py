import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_estimator.comparison import Comparison, Condition, EstimatePoint, MeasuredPoint
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.limits import Event, Hysteresis, Kind, LimitTracker, Source
from slosh_estimator.monitor import MAXIMUM_WAITING, Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.sight import SATURATED, SurfaceFlag
from slosh_estimator.validity import EstimateFlag
from slosh_motion.signals.metrics import mean_absolute_error, peak_error

MS = 1_000_000
NOT_FOUND, BAD_IMAGE = 32, 128


def estimate(monitor: Monitor, at: int, height: float, flags: int = 0) -> list[Comparison]:
    return monitor.add_estimate(EstimatePoint(at * MS, 2 * height, height, flags), at * MS)


def measure(monitor: Monitor, at: int, height: float, flags: int = 0) -> list[Comparison]:
    return monitor.add_measurement(MeasuredPoint(at * MS, height, 1e-4, flags), at * MS)


def events(monitor: Monitor) -> list[tuple[Source, Kind, int]]:
    return [(event.source, event.kind, event.id) for event in monitor.take_events()]


def test_a_measurement_waits_for_the_estimate_beyond_it_and_takes_the_line_between() -> None:
    monitor = Monitor(MonitorSettings())
    estimate(monitor, 10, 0.010)
    assert measure(monitor, 15, 0.013) == []
    (comparison,) = estimate(monitor, 20, 0.020)
    assert comparison.estimated_nonlinear == pytest.approx(0.015)
    assert comparison.residual_nonlinear == pytest.approx(-0.002)
    assert comparison.residual_linear == pytest.approx(0.013 - 0.030)
    assert comparison.state is Condition.OK


@pytest.mark.parametrize("forged", [1e304, -1e304, 10.1, math.inf])
def test_a_height_that_no_container_has_spoils_nothing(forged: float) -> None:
    monitor = Monitor(MonitorSettings())
    for at in range(10, 100, 10):
        estimate(monitor, at, 0.010)
        measure(monitor, at, forged if at == 50 else 0.011)
    assert monitor.nonlinear.sigma == pytest.approx(0.001)
    assert monitor.nonlinear.count == 8
    assert monitor.nonlinear.epsilon == pytest.approx(-1.0 / 11.0)
    assert monitor.take_events() == []


def test_too_early_too_old_and_across_a_gap_is_unmatched() -> None:
    monitor = Monitor(MonitorSettings(buffer=0.1))
    for at in (1000, 1010, 1100):
        estimate(monitor, at, 0.01)
    for at in (500, 1050):
        (comparison,) = measure(monitor, at, 0.01)
        assert math.isnan(comparison.estimated_nonlinear)
    assert monitor.unmatched == 2
    assert monitor.nonlinear.count == 0


def test_the_queue_of_waiting_measurements_is_bounded() -> None:
    monitor = Monitor(MonitorSettings())
    estimate(monitor, 10, 0.01)
    for k in range(MAXIMUM_WAITING + 5):
        monitor.add_measurement(MeasuredPoint((100 + k) * MS, 0.01), 10 * MS)
    assert monitor.unmatched == 5


@given(st.lists(st.tuples(st.floats(0.0, 0.1), st.floats(0.0, 0.1)), min_size=1, max_size=50))
def test_running_indices_equal_those_of_the_whole_record(pairs: list[tuple[float, float]]) -> None:
    monitor = Monitor(MonitorSettings())
    for k, (measured, height) in enumerate(pairs):
        estimate(monitor, 10 * k, height)
        (last,) = measure(monitor, 10 * k, measured)
    heights, answers = zip(*pairs, strict=True)
    assert last.count == len(pairs)
    assert last.sigma_nonlinear == pytest.approx(mean_absolute_error(heights, answers))
    assert last.epsilon_nonlinear == pytest.approx(peak_error(heights, answers), nan_ok=True)


def test_a_lower_bound_counts_only_where_it_contradicts_the_estimate() -> None:
    monitor = Monitor(MonitorSettings(disagreement_limit=0.01))
    estimate(monitor, 10, 0.05)
    measure(monitor, 10, 0.03, SATURATED)
    assert monitor.nonlinear.count == 0
    assert events(monitor) == []
    estimate(monitor, 20, 0.01)
    measure(monitor, 20, 0.03, SATURATED)
    assert monitor.nonlinear.count == 1
    assert events(monitor) == [(Source.DISAGREEMENT, Kind.START, 1)]


def test_a_lower_bound_does_not_end_an_excess() -> None:
    monitor = Monitor(MonitorSettings(measured_limit=0.03, hysteresis=Hysteresis(0.9, 0)))
    measure(monitor, 10, 0.04)
    measure(monitor, 20, 0.01, SATURATED)
    assert events(monitor) == [(Source.MEASURED, Kind.START, 1)]
    measure(monitor, 30, 0.01)
    assert events(monitor) == [(Source.MEASURED, Kind.END, 1)]


@pytest.mark.parametrize("marked", ["before", "after"])
def test_an_image_between_two_estimates_bears_the_flags_of_both(marked: str) -> None:
    """Tests that a measurement between two estimates has the flags of both."""
    monitor = Monitor(MonitorSettings())
    settling, doubtful = int(EstimateFlag.SETTLING), int(EstimateFlag.DIVERGED)
    estimate(monitor, 10, 0.01, settling if marked == "before" else 0)
    measure(monitor, 15, 0.02)
    (comparison,) = estimate(monitor, 20, 0.01, settling if marked == "after" else doubtful)
    assert comparison.estimate_flags & settling
    assert bool(comparison.estimate_flags & doubtful) == (marked == "before")
    assert comparison.count == 0


def feed(
    monitor: Monitor, camera_until: int, estimator_until: int, until: int
) -> list[Comparison]:
    """Returns comparisons of estimates at 100 Hz and images at 50 Hz; times in ms."""
    seen = []
    for at in range(0, until, 10):
        if at < estimator_until:
            seen += estimate(monitor, at, 0.01)
        if at % 20 == 0 and at < camera_until:
            seen += measure(monitor, at, 0.01)
        if at % 100 == 0:
            seen += monitor.check(at * MS)
    return seen


def test_a_silent_camera_is_told_within_half_a_second_and_estimates_go_on() -> None:
    monitor = Monitor(MonitorSettings(estimated_limit=0.03))
    seen = feed(monitor, 1000, 3000, 1500)
    assert [c.state for c in seen if c.stamp_ns < 1000 * MS] == [Condition.OK] * 50
    assert seen[-1].measured_stale
    assert not seen[-1].estimate_stale
    assert seen[-1].state is Condition.STALE
    assert seen[-1].estimated_nonlinear == 0.01
    first = next(c for c in seen if c.measured_stale)
    assert first.stamp_ns <= 1500 * MS
    estimate(monitor, 1510, 0.05)
    assert events(monitor) == [(Source.ESTIMATED, Kind.START, 1)]


def test_a_silent_estimator_is_told_within_half_a_second_and_measurements_go_on() -> None:
    monitor = Monitor(MonitorSettings(measured_limit=0.03))
    seen = feed(monitor, 3000, 1000, 1500)
    assert seen[-1].estimate_stale
    assert not seen[-1].measured_stale
    assert seen[-1].state is Condition.STALE
    assert seen[-1].measured == 0.01
    # Those of the last 0.2 s wait for an estimator that may come back.
    assert len(seen) == 66
    assert len(monitor.finish()) == 9
    assert monitor.finish() == []
    measure(monitor, 1510, 0.05)
    assert events(monitor) == [(Source.MEASURED, Kind.START, 1)]


def test_an_excess_ends_where_its_side_falls_silent() -> None:
    monitor = Monitor(MonitorSettings(measured_limit=0.03))
    monitor.check(0)
    measure(monitor, 10, 0.05)
    monitor.check(400 * MS)
    assert events(monitor) == [(Source.MEASURED, Kind.START, 1), (Source.MEASURED, Kind.END, 1)]


def test_states_by_height() -> None:
    monitor = Monitor(MonitorSettings(estimated_limit=0.03, hysteresis=Hysteresis(0.9, 0)))
    states = []
    for k, height in enumerate((0.01, 0.025, 0.031, 0.01)):
        estimate(monitor, 10 * k, height)
        states += [c.state for c in measure(monitor, 10 * k, 0.01)]
    assert states == [Condition.OK, Condition.WARN, Condition.ERROR, Condition.OK]


def test_time_set_back_ends_excesses_and_starts_the_buffer_anew() -> None:
    monitor = Monitor(MonitorSettings(estimated_limit=0.03))
    estimate(monitor, 60_000, 0.05)
    estimate(monitor, 10, 0.01)
    (event_start, event_end) = monitor.take_events()
    assert event_end.kind is Kind.END
    assert event_end.duration_ns >= 0
    assert event_start.id == event_end.id
    assert len(measure(monitor, 10, 0.01)) == 1


def test_late_estimates_are_counted_and_change_nothing() -> None:
    monitor = Monitor(MonitorSettings())
    estimate(monitor, 20, 0.01)
    estimate(monitor, 10, 0.09)
    assert monitor.late_estimates == 1
    (comparison,) = measure(monitor, 20, 0.01)
    assert comparison.estimated_nonlinear == 0.01


def track(values: list[float], hold: int = 20) -> list[Event]:
    tracker = LimitTracker(Source.MEASURED, 1.0, Hysteresis(0.8, hold * MS))
    found = [tracker.update(10 * k * MS, value) for k, value in enumerate(values)]
    return [event for event in found if event is not None]


@given(st.lists(st.floats(0.0, 2.0) | st.just(math.nan), max_size=100))
def test_starts_and_ends_alternate_and_peaks_are_true(values: list[float]) -> None:
    found = track(values)
    assert [e.kind for e in found] == [Kind.START, Kind.END] * (len(found) // 2) + [Kind.START] * (
        len(found) % 2
    )
    for start, end in zip(found[::2], found[1::2], strict=False):
        inside = values[start.stamp_ns // (10 * MS) : end.stamp_ns // (10 * MS)]
        assert end.peak == max(v for v in inside if not math.isnan(v))
        assert start.stamp_ns <= end.peak_stamp_ns < end.stamp_ns


def test_settings_that_make_no_sense_are_refused() -> None:
    with pytest.raises(SloshEstimatorError, match="release"):
        Hysteresis(release=0.0)
    with pytest.raises(SloshEstimatorError, match="timeout"):
        MonitorSettings(timeout=0.0)


def both_speak(
    monitor: Monitor,
    *,
    measured_flags: int = 0,
    estimate_flags: int = 0,
    shift: int = 0,
    height: float = 0.001,
) -> Comparison:
    """Returns the last comparison after camera and estimator sent data for a second."""
    said: list[Comparison] = []
    for at in range(10_000, 11_000, 10):
        point = EstimatePoint(at * MS, height, height, estimate_flags)
        said += monitor.add_estimate(point, at * MS)
        if at % 20 == 0:
            image = MeasuredPoint((at + shift) * MS, height, 1e-4, measured_flags)
            said += monitor.add_measurement(image, at * MS)
        if at % 100 == 0:
            said += monitor.check(at * MS)
    return said[-1]


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"measured_flags": BAD_IMAGE}, "BAD_IMAGE"),
        ({"measured_flags": NOT_FOUND}, "is its lens covered"),
        ({"measured_flags": int(SurfaceFlag.FROZEN)}, "FROZEN"),
        ({"height": math.nan}, "measures no height"),
        ({"shift": -10_000}, "10.0.0 s behind those of the estimates"),
        ({"shift": 10_000}, "(9.99|10.0)0 s ahead of those of the estimates"),
        ({"estimate_flags": int(EstimateFlag.SETTLING)}, "SETTLING"),
        ({"estimate_flags": int(EstimateFlag.INPUT_DOUBTFUL)}, "input is not plausible"),
        ({"estimate_flags": int(EstimateFlag.INPUT_CONTESTED)}, "several publishers"),
    ],
)
def test_who_cannot_compare_is_blind_and_says_why(given: dict[str, int], reason: str) -> None:
    monitor = Monitor(MonitorSettings())
    assert both_speak(monitor, **given).state is Condition.BLIND
    assert re.search(reason, monitor.blindness(11_000 * MS))
    assert monitor.nonlinear.count == 0


def test_a_short_moment_without_sight_is_no_blindness() -> None:
    monitor = Monitor(MonitorSettings())
    both_speak(monitor)
    for at in (11_000, 11_100, 11_250):
        estimate(monitor, at, 0.001)
        (comparison,) = measure(monitor, at, 0.001, BAD_IMAGE)
        assert comparison.state is Condition.OK
    estimate(monitor, 11_300, 0.001)
    (comparison,) = measure(monitor, 11_300, 0.001, BAD_IMAGE)
    assert comparison.state is Condition.BLIND
    (comparison,) = measure(monitor, 11_300, 0.001)
    assert comparison.state is Condition.OK


def test_an_exceeded_limit_weighs_more_than_blindness_and_a_silent_side_too() -> None:
    monitor = Monitor(MonitorSettings(estimated_limit=0.02))
    assert both_speak(monitor, measured_flags=BAD_IMAGE, height=0.03).state is Condition.ERROR
    calm = Monitor(MonitorSettings())
    both_speak(calm, measured_flags=BAD_IMAGE)
    assert calm.condition(12_000 * MS) is Condition.STALE


def test_a_changed_limit_holds_for_data_after_the_newest_estimate_whenever_they_arrive() -> None:
    monitor = Monitor(MonitorSettings(measured_limit=0.02))
    estimate(monitor, 100, 0.0)
    assert monitor.change_settings(MonitorSettings(measured_limit=0.01)) == 100 * MS
    measure(monitor, 90, 0.015)
    measure(monitor, 100, 0.015)
    assert events(monitor) == []
    measure(monitor, 110, 0.015)
    (event,) = monitor.take_events()
    assert (event.kind, event.stamp_ns, event.limit) == (Kind.START, 110 * MS, 0.01)


def test_an_excess_ends_with_the_old_limit_and_begins_with_the_new_one() -> None:
    monitor = Monitor(MonitorSettings(estimated_limit=0.01))
    estimate(monitor, 100, 0.011)
    estimate(monitor, 200, 0.018)
    monitor.change_settings(MonitorSettings(estimated_limit=0.015))
    estimate(monitor, 210, 0.016)
    start, end, again = monitor.take_events()
    assert (start.kind, start.id, start.limit) == (Kind.START, 1, 0.01)
    assert (end.kind, end.id, end.limit, end.stamp_ns) == (Kind.END, 1, 0.01, 200 * MS)
    assert (end.peak, end.duration_ns) == (0.018, 100 * MS)
    assert "limit changed to 15.0 mm after 0.10 s" in end.description
    assert (again.kind, again.id, again.limit, again.stamp_ns) == (
        Kind.START, 2, 0.015, 210 * MS,
    )  # fmt: skip
    monitor.change_settings(MonitorSettings(estimated_limit=0.03))
    estimate(monitor, 220, 0.016)
    assert events(monitor) == [(Source.ESTIMATED, Kind.END, 2)]
    assert monitor.condition(220 * MS) is not Condition.ERROR


def test_where_nothing_comes_a_heartbeat_says_so_at_least_twice_a_second() -> None:
    monitor = Monitor(MonitorSettings())
    told = [(at, one) for at in range(0, 5000, 100) for one in monitor.check(at * MS)]
    times = [at for at, _ in told]
    assert max(np.diff([0, *times, 5000])) <= 400
    for _, one in told:
        assert one.state is Condition.STALE
        assert (one.measured_stale, one.estimate_stale, one.stamp_ns) == (True, True, 0)
    # The last stamp of either side is what is known.
    estimate(monitor, 5100, 0.01)
    measure(monitor, 5150, 0.01)
    told = [(at, one) for at in range(5200, 9000, 100) for one in monitor.check(at * MS)]
    silent = [one for at, one in told if at > 5600]
    assert len(silent) > 8
    assert {(one.state, one.stamp_ns) for one in silent} == {(Condition.STALE, 5150 * MS)}


def test_a_clock_that_stands_is_blind_and_has_a_heartbeat() -> None:
    monitor = Monitor(MonitorSettings())
    monitor.standstill = "the clock stands"
    estimate(monitor, 0, 0.01)
    (comparison,) = measure(monitor, 0, 0.01)
    assert comparison.state is Condition.BLIND
    assert monitor.blindness(0) == "the clock stands"
    # The monitor's own time is that clock's.
    assert sum(len(monitor.check(0)) for _ in range(20)) >= 5
    monitor.standstill = ""
    assert monitor.condition(0) is Condition.OK


def test_without_a_camera_the_estimate_alone_makes_the_state() -> None:
    monitor = Monitor(MonitorSettings(estimated_limit=0.02, measured_limit=0.01, camera=False))
    assert measure(monitor, 0, 0.05) == []  # not looked at
    found: list[Comparison] = []
    heights = [0.001] * 10 + [0.018] * 10 + [0.025] * 10
    for k, height in enumerate(heights):
        assert estimate(monitor, 50 * k, height) == []
        if k % 2:
            found += monitor.check(50 * k * MS)
    states = [one.state for one in found]
    assert states == [Condition.OK] * 5 + [Condition.WARN] * 5 + [Condition.ERROR] * 5
    assert all(one.without_camera and not one.measured_stale for one in found)
    assert [one.estimated_nonlinear for one in found[::5]] == [0.001, 0.018, 0.025]
    assert {source for source, _, _ in events(monitor)} == {Source.ESTIMATED}
    (silent, *_) = monitor.check(2000 * MS)
    assert silent.state is Condition.STALE
    assert (silent.measured_stale, silent.estimate_stale) == (False, True)
