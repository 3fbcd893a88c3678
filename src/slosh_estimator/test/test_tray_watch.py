"""Tests the limits of a tray: one for each container, and the worst by name."""

import math
from dataclasses import replace

from slosh_estimator.comparison import Condition, EstimatePoint
from slosh_estimator.limits import Kind
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.validity import EstimateFlag
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.tray import Tray, TrayContainer

MS = 1_000_000
CUP, BRIMFUL = Model(Cylinder(0.04, 0.06, 0.09)), Model(Cylinder(0.04, 0.06, 0.068))
TRAY = Tray(
    (
        TrayContainer("own", CUP, limit=0.015),
        TrayContainer("common", CUP),
        TrayContainer("rim", BRIMFUL),
    )
)


def monitor():
    made = Monitor(MonitorSettings(estimated_limit=0.02, camera=False))
    made.carry(TRAY)
    return made


def tell(watching, first, count, *heights):
    for k in range(first, first + count):
        point = EstimatePoint(k * MS, heights[0], heights[0], tray=heights)
        watching.add_estimate(point, k * MS)
    return watching.take_events()


def test_each_container_has_its_own_limit_and_the_event_names_it():
    watching = monitor()
    assert not tell(watching, 0, 100, 0.014, 0.019, 0.007)
    events = tell(watching, 100, 100, 0.016, 0.019, 0.009)
    assert [event.description.partition(":")[0] for event in events] == [
        "container own", "container rim",
    ]  # fmt: skip
    assert [event.limit for event in events] == [0.015, 0.068 - 0.06]
    assert len({event.id for event in events}) == 2
    assert watching.condition(200 * MS) is Condition.ERROR
    ended = tell(watching, 200, 200, 0.001, 0.001, 0.001)
    assert [event.kind for event in ended] == [Kind.END] * 2
    assert watching.condition(400 * MS) is Condition.OK


def test_the_worst_is_named_and_warned_of_before_its_limit():
    watching = monitor()
    tell(watching, 0, 10, 0.002, 0.017, 0.003)
    assert watching.tray.text == "worst container common: 17.0 mm, limit 20.0 mm"
    assert watching.condition(10 * MS) is Condition.WARN
    tell(watching, 10, 10, 0.002, 0.001, 0.007)
    assert watching.tray.text == "worst container rim: 7.0 mm, rim 8.0 mm"
    assert watching.tray.facts() == {
        "worst container": "rim",
        "container own": "2.0 mm, limit 15.0 mm",
        "container common": "1.0 mm, limit 20.0 mm",
        "container rim": "7.0 mm, rim 8.0 mm",
    }


def test_a_limit_that_changes_is_that_of_those_without_their_own():
    watching = monitor()
    tell(watching, 0, 10, 0.002, 0.012, 0.003)
    watching.change_settings(MonitorSettings(estimated_limit=0.01, camera=False), 10 * MS)
    (event,) = tell(watching, 11, 10, 0.012, 0.012, 0.003)
    assert event.description.startswith("container common")


def test_unknown_heights_and_silence_end_nothing_wrongly():
    watching = monitor()
    tell(watching, 0, 10, 0.016, 0.0, 0.0)
    assert not tell(watching, 10, 10, math.nan, math.nan, math.nan)
    assert watching.tray.text == ""
    watching.check(2_000 * MS)
    (event,) = watching.take_events()
    assert event.kind is Kind.END
    assert "estimates stopped" in event.description


def test_another_container_in_a_place_ends_its_excess_from_a_stamp_on():
    watching = monitor()
    (began,) = tell(watching, 0, 100, 0.016, 0.001, 0.001)
    assert began.kind is Kind.START
    shallow = TrayContainer("own", BRIMFUL, limit=0.03)
    watching.carry(TRAY.with_container(0, shallow), 149 * MS)
    assert not tell(watching, 100, 50, 0.016, 0.001, 0.001)  # of the container before
    ended, again = tell(watching, 150, 50, 0.016, 0.001, 0.001)
    assert (ended.kind, ended.id, ended.stamp_ns) == (Kind.END, began.id, 149 * MS)
    assert "another container" in ended.description
    assert (again.kind, again.limit) == (Kind.START, 0.068 - 0.06)


def test_an_empty_place_has_no_worst_and_the_others_are_watched_on():
    watching = monitor()
    gone = [replace(one, empty=True) for one in TRAY.containers]
    watching.carry(TRAY.with_container(0, gone[0]), 9 * MS)
    nothing = int(EstimateFlag.NO_CONTAINER)
    for k in range(10, 20):
        heights = (math.nan, 0.025, 0.001)
        watching.add_estimate(EstimatePoint(k * MS, math.nan, math.nan, nothing, tray=heights), k)
    (event,) = watching.take_events()
    assert event.description.startswith("container common: ")
    assert watching.condition(20 * MS) is Condition.ERROR
    assert watching.tray.facts()["container own"] == "none"
    assert watching.tray.facts()["worst container"] == "common"
