"""Where the rim is known and lower than a limit, the monitor holds the liquid to it."""

import math

import pytest

from slosh_estimator.comparison import Condition, EstimatePoint, MeasuredPoint
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
