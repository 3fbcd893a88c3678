"""Tests that the monitor limits the liquid to the rim if it is below the limit."""

import math

import pytest

from slosh_estimator.comparison import Condition, EstimatePoint, MeasuredPoint
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.limits import Kind, Source
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder

MS = 1_000_000
CUP = Model(Cylinder(0.05, 0.07, rim_height=0.085))


def fed(monitor: Monitor, heights: list[float], begin: int = 0) -> Monitor:
    for at, height in enumerate(heights, begin):
        stamp = 10 * at * MS
        monitor.add_estimate(EstimatePoint(stamp, height, height), stamp)
        monitor.add_measurement(MeasuredPoint(stamp, height, 1e-4), stamp)
    return monitor


@pytest.mark.parametrize("limit", [0.03, math.nan])
def test_the_lower_of_limit_and_rim_holds_and_is_named(limit: float) -> None:
    settings = MonitorSettings(limit, limit, math.nan).under_rim(CUP)
    monitor = fed(Monitor(settings), [0.0, 0.014, 0.016, 0.017])
    found = monitor.take_events()
    assert [(event.source, event.kind) for event in found] == [
        (Source.ESTIMATED, Kind.START), (Source.MEASURED, Kind.START)
    ]  # fmt: skip
    assert all(event.limit == pytest.approx(0.015) for event in found)
    assert all("(rim 15.0 mm" in event.description for event in found)
    assert monitor.condition(40 * MS) is Condition.ERROR
    assert monitor.at_rim == "the liquid is above the rim 15.0 mm"


def test_a_rim_that_becomes_known_holds_for_what_follows_and_for_further_changes() -> None:
    monitor = fed(Monitor(MonitorSettings(0.03, 0.03)), [0.02, 0.02])
    assert monitor.take_events() == []
    monitor.change_settings(monitor.settings.under_rim(CUP))
    fed(monitor, [0.02, 0.02], 2)
    assert len(monitor.take_events()) == 2
    recorded = {
        "measured_limit": 0.5, "estimated_limit": 0.5, "disagreement_limit": 0.1,
        "warn_share": 0.8, "release": 0.9, "hold": 0.1, "timeout": 0.3, "buffer": 2.0,
    }  # fmt: skip
    told = MonitorSettings.from_parameters({**recorded, "rim": 0.015})
    assert told.limits[Source.ESTIMATED] == 0.015


def test_a_distance_to_the_rim_is_a_limit_and_is_named() -> None:
    settings = MonitorSettings(0.03, 0.03, rim_distance=0.004).under_rim(CUP)
    monitor = fed(Monitor(settings), [0.0, 0.010, 0.012])
    found = monitor.take_events()
    assert [event.limit for event in found] == pytest.approx([0.011, 0.011])
    assert all("(rim limit 11.0 mm" in event.description for event in found)
    assert settings.limit_name(Source.MEASURED) == "rim limit"
    lower = MonitorSettings(0.01, 0.01, rim_distance=0.004).under_rim(CUP)
    assert lower.limits[Source.MEASURED] == 0.01
    assert lower.limit_name(Source.MEASURED) == "limit"


def test_where_a_distance_cannot_be_kept_the_rim_holds_and_the_complaint_says_why() -> None:
    rim, complaint = MonitorSettings(rim_distance=0.02).near_rim(CUP)
    assert rim == pytest.approx(0.015)
    assert "must be 0 … 0.015 m" in complaint
    rim, complaint = MonitorSettings(rim_distance=0.02).near_rim(Model(Cylinder(0.05, 0.07)))
    assert math.isnan(rim)
    assert "the rim is not known" in complaint
    assert MonitorSettings().near_rim(CUP) == (pytest.approx(0.015), "")
    with pytest.raises(SloshEstimatorError, match=r"rim_distance = -0\.01 m"):
        MonitorSettings(rim_distance=-0.01)
