"""Tests that the monitor compares sensor readings with the readings that it expects."""

import math

import numpy as np
import pytest

from slosh_estimator.comparison import Comparison, EstimatePoint, MeasuredPoint
from slosh_estimator.limits import Source
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.readings import Reading, ReadingJoiner, has_readings

MS = 1_000_000
READ = "3D-NL+height_scale"


def wave(at_ms: float) -> float:
    return 0.01 + 0.005 * math.sin(0.02 * at_ms)


def run(monitor: Monitor, delay_ms: int, latency_ms: int = 32) -> list[Comparison]:
    """Returns comparisons with images that show the liquid `delay_ms` before their stamps."""
    found: list[Comparison] = []
    for at in range(0, 4000, 4):
        height = wave(at)
        point = EstimatePoint(
            at * MS, 2.0 * height, height, 0, None, (2.4 * height, 1.2 * height), delay_ms * MS
        )
        found += monitor.add_estimate(point, at * MS)
        exposed = at - latency_ms
        if exposed >= 0 and exposed % 20 == 0:
            read = 1.2 * wave(exposed - delay_ms)
            found += monitor.add_measurement(MeasuredPoint(exposed * MS, read), at * MS)
    return found


@pytest.mark.parametrize("delay_ms", [0, 50, -50, 1000, -1000, 7, -7])
def test_a_delay_of_either_sign_is_taken_off_the_stamps(delay_ms: int) -> None:
    monitor = Monitor(MonitorSettings(buffer=0.1))
    found = run(monitor, delay_ms)
    known = [c for c in found if not math.isnan(c.estimated_nonlinear)]
    assert len(known) > 140
    for comparison in known:
        assert comparison.estimated_nonlinear == pytest.approx(comparison.measured, abs=1e-5)
        shown = comparison.stamp_ns / MS - delay_ms
        assert comparison.estimated_linear == pytest.approx(2.4 * wave(shown), abs=1e-5)
    assert monitor.nonlinear.count == len(known)
    assert monitor.nonlinear.sigma < 1e-5


def test_the_limit_is_that_of_the_liquid_and_not_of_what_a_sensor_can_see() -> None:
    """Tests that the limit applies to the liquid's height, not to what the camera can see."""
    monitor = Monitor(MonitorSettings(measured_limit=0.012, estimated_limit=0.012))
    for at in range(0, 400, 4):
        height, seen = wave(at), min(wave(at), 0.008)
        monitor.add_estimate(EstimatePoint(at * MS, height, height, 0, None, (seen, seen)), at)
        monitor.add_measurement(MeasuredPoint(at * MS, seen), at)
    events = monitor.take_events()
    assert events
    assert {event.source for event in events} == {Source.ESTIMATED}
    assert max(event.peak for event in events) == pytest.approx(0.015, rel=1e-3)
    assert monitor.nonlinear.sigma == 0.0


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("2D-L", False),
        ("3D-NL+gravity_tilt", False),
        ("3D-NL+gravity_tilt+height_scale", True),
        ("3D-L+time_offset", True),
        ("3D-L+of_another_version", False),
    ],
)
def test_the_model_s_name_tells_whether_readings_come(name: str, read: bool) -> None:
    assert has_readings(name) == read


def point(at: int) -> EstimatePoint:
    return EstimatePoint(at * MS, 0.02, 0.01)


def reading(at: int) -> Reading:
    return Reading(at * MS, 0.03, 0.01 * at, 5)


@pytest.mark.parametrize("seed", range(5))
def test_whichever_comes_first_each_estimate_gets_its_own_reading(seed: int) -> None:
    random, joiner, found = np.random.default_rng(seed), ReadingJoiner(), []
    estimates, readings = list(range(1, 200)), list(range(1, 200))
    while estimates or readings:
        if estimates and (not readings or random.random() < 0.5):
            found += joiner.add_estimate(point(estimates.pop(0)), READ)
        else:
            found += joiner.add_reading(reading(readings.pop(0)))
    assert [p.stamp_ns for p in found] == [at * MS for at in range(1, 200)]
    assert all(p.reading == (0.03, 0.01 * (p.stamp_ns / MS)) for p in found)
    assert {p.delay_ns for p in found} == {5}
    assert joiner.lost == 0


def test_an_estimate_whose_reading_was_lost_is_compared_with_nothing() -> None:
    joiner, monitor = ReadingJoiner(), Monitor(MonitorSettings(estimated_limit=0.005))
    joiner.add_estimate(point(1), READ)
    (alone,) = joiner.add_reading(reading(2))
    assert joiner.lost == 1
    monitor.add_estimate(alone, MS)
    assert [event.source for event in monitor.take_events()] == [Source.ESTIMATED]
    (comparison,) = monitor.add_measurement(MeasuredPoint(MS, 0.01), MS)
    assert math.isnan(comparison.residual_nonlinear)
    assert monitor.nonlinear.count == 0
    assert monitor.take_events() == []


def test_time_that_was_set_back_is_overcome() -> None:
    joiner = ReadingJoiner()
    joiner.add_reading(reading(5000))  # its estimate never came
    found = []
    for at in range(1, 20):
        found += joiner.add_estimate(point(at), READ)
        found += joiner.add_reading(reading(at))
    assert found[-1].reading == (0.03, pytest.approx(0.19))
