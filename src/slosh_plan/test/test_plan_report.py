import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from headless_browser import View

from slosh_model import Cylinder, Inputs, Model, simulate
from slosh_model.covariance import Covariance
from slosh_model.tray import TrayContainer
from slosh_plan.plan_report.comparison import PROPOSAL, height_band, make_report, proposed_motion
from slosh_plan.plan_report.document import drawn, plan_document
from slosh_plan.plan_report.words import plan_lines
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import plan
from slosh_plan.planning.plan_tray import TrayPlan
from slosh_plan.planning.robust import LikelyHeights
from slosh_plan.planning.tolerance import Tolerance
from slosh_plan.planning.waypoints import Waypoints
from slosh_report.page.html import html_page
from slosh_report.text import json_text
from slosh_testing.reports import LOOK, at

CUP = replace(Model(Cylinder(0.05, 0.07)).spatial().nonlinear(), natural_frequency=19.0)
UNSURE = replace(CUP, covariance=Covariance(("natural_frequency",), ((0.01,),)))
LIMITS = PlanLimits(0.015, 0.002, 9.5, 74.0)
POINTS = np.array([[0.0, 0.0, 0.0], [0.1, 0.02, 0.02], [0.2, 0.06, 0.03], [0.3, 0.06, 0.0]])
ONE = TrayContainer("", UNSURE)
BORNE = Tolerance(0.005, 0.0152, 0.00213)
EVIL = '</style><script>window.hacked=1</script><img src=x onerror="hacked=1"> \x00' + "W" * 300


def render_plan(report):
    return html_page(plan_document(report))


def proposal_of(report):
    """Returns the motion in the waypoints' own times; None if there is none."""
    return next((one for one in report.motions if one.title == PROPOSAL), None)


def report_of(model=UNSURE, times=(0.0, 0.2, 0.4, 0.6), points=POINTS, limits=LIMITS):
    """Returns a report on the fastest known time law."""
    waypoints = Waypoints(np.array(times), points, None)
    answer = plan(model, path_through(points), limits, time_limit=0.0)
    return make_report(model, TrayPlan(answer, ONE), waypoints, BORNE, "path.csv with model.yaml")


@pytest.fixture(scope="module")
def report():
    return report_of()


def test_the_proposal_is_the_motion_through_the_waypoints_in_their_times(report):
    motion = proposal_of(report).found.motion
    assert motion.duration == pytest.approx(0.6)
    for t, point in zip((0.0, 0.2, 0.4, 0.6), POINTS, strict=True):
        assert motion.position[round(1000 * t)] == pytest.approx(point, abs=1e-9)
    # Its columns are derivatives of each other, from rest to rest.
    velocity = np.gradient(motion.position, 1e-3, axis=0)
    assert np.linalg.norm(velocity, axis=1)[5:-5] == pytest.approx(motion.speed[5:-5], abs=1e-3)
    assert motion.speed[[0, -1]] == pytest.approx([0.0, 0.0], abs=1e-9)
    change = np.gradient(velocity, 1e-3, axis=0)
    assert change[5:-5] == pytest.approx(motion.acceleration[5:-5], abs=0.05)


def test_what_exceeds_a_limit_is_told(report):
    motions = plan_document(report).data["motions"]
    before, after = motions[0], motions[-1]
    assert before["title"] == "the waypoints’ own times"
    assert {"height", "residual"} <= set(before["exceeds"])
    assert after["exceeds"] == []
    assert after["peak"] == report.plan.found.peak


def test_waypoints_whose_times_tell_no_motion_are_noted():
    report = report_of(times=(0.0, 1e-4, 2e-4, 3e-4))
    assert proposal_of(report) is None
    assert any("The waypoints’ own times are not shown" in note for note in report.remarks)
    assert "The waypoints’ own times are not shown" in render_plan(report)


def test_a_line_between_two_points_has_no_own_motion_to_be_noted():
    report = report_of(times=(0.0, 1.0), points=POINTS[[0, 3]])
    assert proposal_of(report) is None
    assert not any("own times" in note for note in report.remarks)


def test_remarks_on_the_motion_are_on_the_page(report):
    waypoints = Waypoints(np.array([0.0, 0.2, 0.4, 0.6]), POINTS, None)
    page = render_plan(
        make_report(
            UNSURE, TrayPlan(report.plan, ONE), waypoints, BORNE, remarks=["planarity lost"]
        )
    )
    assert "Remarks: planarity lost." in page


def test_the_page_tells_what_the_terminal_tells_of_law_models_tilt_and_joints(report):
    found = replace(report.plan.found, joints={"joint_velocity": 0.5}, tilt=0.1)
    answer = replace(report.plan, found=found, limits=replace(LIMITS, tilt=0.2))
    likely = LikelyHeights(("natural_frequency",), 7, 0.012, 0.001, 1.0, 3)
    planned = TrayPlan(answer, ONE, likely=likely)
    lines = plan_lines(planned, None, BORNE)
    waypoints = Waypoints(np.array([0.0, 0.2, 0.4, 0.6]), POINTS, None)
    page = html.unescape(render_plan(make_report(UNSURE, planned, waypoints, BORNE)))
    told = [line for line in lines if line.startswith(("with 7 likely", "tilt", "joints use"))]
    assert len(told) == 3
    for line in (*told, lines[1]):
        assert line[1:] in page


@pytest.mark.long
def test_a_slow_proposal_stands_in_the_table_but_does_not_squeeze_the_charts():
    report = report_of(times=(0.0, 10.0, 20.0, 30.0))
    assert proposal_of(report) in report.motions
    assert proposal_of(report) not in drawn(report)
    assert "too long to be drawn" in render_plan(report)


def test_the_band_holds_what_models_two_standard_errors_away_do(report):
    lower, upper = report.band
    motion, count = report.planned.found.motion, len(report.planned.found.msh)
    t = np.arange(count) / 1000
    acceleration = np.zeros((count, 3))
    acceleration[: len(motion.t)] = motion.acceleration
    for frequency in (18.8, 19.2):
        other = replace(CUP, natural_frequency=frequency)
        heights = simulate(other, Inputs(t, acceleration))[0].msh
        assert (heights <= upper + 1e-9).all()
        assert (heights >= lower - 1e-9).all()
    assert report.upper[0] == upper.max() > report.planned.found.peak
    assert report.upper[1] > report.planned.found.residual
    assert height_band(CUP, report.planned.found, None) is None


@pytest.mark.long
def test_an_interval_above_a_limit_is_a_warning(report):
    assert "The interval exceeds a limit" in render_plan(report)
    assert "Keeps every limit" in render_plan(report_of(model=CUP))


def test_the_page_tells_the_frequency_tolerance_as_the_terminal_does(report):
    text = re.sub(r"<[^>]*>", "", render_plan(report))
    assert "frequency tolerance0.5 %" in text
    assert "up to which the limits hold; 1 % off: 15.20 mm, after the end 2.13 mm" in text
    none = replace(report, borne=replace(BORNE, error=0.0))
    assert "already 0.1 % exceeds a limit" in render_plan(none)


def test_a_motion_of_the_waypoints_that_is_none():
    with pytest.raises(ValueError, match="less than two milliseconds"):
        proposed_motion(Waypoints(np.array([0.0, 5e-4, 1e-3]), 1e-5 * POINTS[:3], None))


def test_every_number_is_that_of_the_document(report):
    document = json.loads(json_text(plan_document(report).data))
    found = re.findall(r'<data value="([^"]*)" data-path="([^"]*)">', render_plan(report))
    assert len(found) > 25
    for value, path in found:
        assert json.loads(value) == at(document, path)


@pytest.fixture(scope="module")
def seen(headless, report):
    page = render_plan(report)
    views = {
        "screen": View(page),
        "dark": View(page, dark=True),
        "phone": View(page, width=390),
        "hostile": View(render_plan(replace(report, subtitle=EVIL, remarks=(EVIL,))), width=390),
    }
    look = headless.look(list(views.values()), LOOK)
    return {**dict(zip(views, look.values, strict=True)), "console": look.console}


@pytest.mark.long
def test_the_page_in_a_browser(seen):
    assert seen["console"] == []
    for view in ("screen", "phone", "hostile"):
        assert seen[view]["wanted"] <= seen[view]["width"]
        assert (seen[view]["hacked"], seen[view]["scripts"]) == (None, 0)
        assert len(seen[view]["charts"]) == 6
        assert min(seen[view]["letters"]) >= 9.0
        assert seen[view]["named"]
    assert seen["screen"]["background"] != seen["dark"]["background"]
    assert seen["screen"]["line"] != seen["dark"]["line"]
