"""Tests that a replay reports drifting clocks, and limits the liquid to its model's rim."""

from dataclasses import replace

import numpy as np
import pytest

from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_motion.recorded.settings import NodeStart
from slosh_motion.tables.motion_table import MotionTable
from slosh_replay.in_force import in_force
from slosh_replay.replay.replay_table import replay_table
from slosh_replay.replay.report import replay_report, report_start
from slosh_report.run_report import render_report

MODEL = Model(Cylinder(0.05, 0.07), damping_ratio=0.02).spatial().nonlinear()


@pytest.mark.first(1)
@pytest.mark.parametrize("rate", [0.0, 0.0004, -0.003])
def test_a_drift_of_the_heights_clock_is_a_warning_in_ppm(rate: float) -> None:
    t = np.arange(0.0, 66.0, 0.01)
    since = (t - 2.0) % 8.0
    swell = np.where((since < 2.0) & (t > 2.0), np.sin(0.5 * np.pi * since) ** 2, 0.0)
    moved = swell[:, None] * np.array([1.8, 0.9, 0.0]) * np.sin(13.0 * since)[:, None]
    seen = simulate(MODEL, Inputs(t, moved))[0].msh
    read = np.interp(t / (1.0 + rate), t, seen) + np.random.default_rng(2).normal(0, 5e-5, len(t))
    read[1::2] = np.nan  # images at 50 Hz
    found = replay_table("table", MotionTable(t, moved, msh=read), MODEL).warnings
    told = [line for line in found if "ppm" in line]
    assert len(told) == (rate != 0.0)
    if told:
        value, _, error = told[0].split(" runs ")[1].split()[:3]
        assert float(value) == pytest.approx(1e6 * abs(rate), abs=4.0 * float(error))
        assert ("fast" in told[0]) == (rate > 0.0)


def test_a_replay_holds_the_liquid_to_the_rim_of_its_model() -> None:
    low = Model(Cylinder(0.05, 0.07, rim_height=0.075), damping_ratio=0.02).spatial().nonlinear()
    t = np.arange(0.0, 6.0, 0.01)
    moved = np.where((t > 1.0) & (t < 3.0), np.sin(14.0 * t), 0.0)[:, None] * np.array([2.0, 0, 0])
    seen = simulate(MODEL, Inputs(t, moved))[0].msh
    events = replay_table("table", MotionTable(t, moved, msh=seen), low).events
    assert events
    assert all("(rim 5.0 mm" in event.description for event in events)
    assert replay_table("table", MotionTable(t, moved, msh=seen), MODEL).events == ()


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        ({}, "measured 20 mm, estimated 15 mm, disagreement 10 mm"),
        ({"rim": 0.0123}, "measured 12.3 mm (rim), estimated 12.3 mm (rim), disagreement 10 mm"),
        ({"rim": 0.05}, "measured 20 mm, estimated 15 mm, disagreement 10 mm, rim 50.0 mm"),
    ],
)
def test_the_limits_in_force_name_the_rim(told: dict[str, float], expected: str) -> None:
    given = {"measured_limit": 0.02, "estimated_limit": 0.015, "disagreement_limit": 0.01}
    start = NodeStart("monitor", 0, 0, "", "", {**given, **told}, {})
    assert in_force({"monitor": start})["limits"] == expected


def test_the_page_draws_the_limit_that_holds_and_names_it() -> None:
    t = np.arange(0.0, 3.0, 0.01)
    moved = np.where(t > 1.0, np.sin(14.0 * t), 0.0)[:, None] * np.array([2.0, 0.0, 0.0])
    table = MotionTable(t, moved, msh=simulate(MODEL, Inputs(t, moved))[0].msh)
    replayed = replay_table("table", table, MODEL)
    given = MonitorSettings(0.02, 0.02)
    low, high = replace(given, rim=0.005), replace(given, rim=0.05)
    # As in each run: the monitor learns of the rim before the first input.
    for settings, expected in ((low, (0.005, "rim")), (high, (0.02, "limit"))):
        found = replay_report(replace(replayed, limits=given, limit_changes=((0, settings),)))
        assert (found.limit, found.limit_name) == expected
        assert f"{expected[1]} {1e3 * expected[0]:g} mm" in render_report(found)
    later = report_start(replayed) + 1
    found = replay_report(replace(replayed, limits=given, limit_changes=((later, low),)))
    assert found.limit is None
