"""Tests the comparison of a camera with one container of a tray."""

import math

import pytest

from slosh_estimator.comparison import Condition, EstimatePoint, MeasuredPoint
from slosh_estimator.container_monitor import ContainerMonitor
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model_text import parse_model
from slosh_model.tray import Tray, TrayContainer

MS = 1_000_000
CUP = parse_model(
    "container: {shape: cylinder, radius: 0.04, fill_height: 0.06, rim_height: 0.09}"
)
LOW = parse_model(
    "container: {shape: cylinder, radius: 0.04, fill_height: 0.06, rim_height: 0.065}"
)
SETTINGS = MonitorSettings(0.02, 0.02, 0.01)
TRAY = Tray((
    TrayContainer("left", CUP), TrayContainer("right", CUP, limit=0.012),
    TrayContainer("low", LOW),
))  # fmt: skip


def compared(monitor: ContainerMonitor, measured: float, estimated: float, at: int = 10):
    core = monitor.core
    core.add_measurement(MeasuredPoint(at * MS, measured), at * MS)
    (found,) = core.add_estimate(EstimatePoint(at * MS, estimated, estimated), at * MS)
    return found


@pytest.mark.parametrize(
    ("name", "measured", "limit"),
    [("right", 0.013, 0.012), ("low", 0.0055, 0.005), ("right", 0.0119, None)],
)
def test_a_height_is_judged_by_the_containers_own_limit_or_rim(name, measured, limit):
    monitor = ContainerMonitor(TRAY, name, SETTINGS)
    found = compared(monitor, measured, 0.0)
    events = [event for event in monitor.take_events() if event.source is Source.MEASURED]
    assert [event.limit for event in events] == ([] if limit is None else [pytest.approx(limit)])
    assert all(event.description.startswith(f"container {name}: ") for event in events)
    assert (found.state is Condition.ERROR) == bool(
        events or measured > SETTINGS.disagreement_limit
    )


def test_the_estimated_height_is_reported_for_the_whole_tray_and_counts_here():
    monitor = ContainerMonitor(TRAY, "right", SETTINGS)
    assert compared(monitor, 0.01, 0.015).state is Condition.ERROR
    assert monitor.take_events() == []


def test_another_container_brings_its_limit_from_its_stamp_on():
    monitor = ContainerMonitor(TRAY, "right", SETTINGS)
    tray = TRAY.with_container(1, TrayContainer("right", CUP, limit=0.004))
    monitor.carry(tray, 15 * MS)
    compared(monitor, 0.008, 0.008, at=10)
    assert monitor.take_events() == []
    compared(monitor, 0.008, 0.008, at=20)
    (event,) = monitor.take_events()
    assert (event.limit, event.source) == (0.004, Source.MEASURED)


@pytest.mark.parametrize(
    ("tray", "name", "why"),
    [
        (TRAY, "left", "the first of the tray; its camera names no container"),
        (TRAY, "top", "no container of the tray .left, right, low."),
        (Tray((TrayContainer("", CUP),)), "left", "the cell carries no tray"),
    ],
)
def test_a_camera_needs_a_container_behind_the_first(tray, name, why):
    with pytest.raises(SloshEstimatorError, match=why):
        ContainerMonitor(tray, name, SETTINGS)


def test_an_unknown_height_ends_nothing():
    monitor = ContainerMonitor(TRAY, "right", SETTINGS)
    found = compared(monitor, math.nan, 0.001)
    assert math.isnan(found.measured)
    assert monitor.core.nonlinear.count == 0
