"""Tests plans of a container that may tilt."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_model import Cylinder, Model, Rectangle
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning import optimise
from slosh_plan.planning.checked import checked
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import plan

pytestmark = pytest.mark.skipif(
    not optimise.available(), reason="no CasADi (requirements/plan.txt)"
)

CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
TANK = Model(Rectangle(0.08, 0.06, 0.07)).spatial().nonlinear()
LIMITS = PlanLimits(0.015, 0.002, 9.5, 74.0)
LINE = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
TEN = replace(LIMITS, tilt=math.radians(10.0))


@pytest.fixture(scope="module")
def tilting():
    """Returns a plan for a cup that may tilt by 10°."""
    return plan(CUP, path_through(LINE), TEN)


def test_a_cup_that_tilts_is_faster(tilting, check_plan):
    assert tilting.method == "optimal"
    assert tilting.found.motion.duration < 0.73
    assert tilting.found.tilt > 0.95 * TEN.tilt
    check_plan(tilting, LINE, CUP, TEN)
    # The tilt goes with the acceleration: a waiter leans the tray into it.
    motion = tilting.found.motion
    lean = motion.tilt.attitude[:, 1]
    assert np.corrcoef(lean, motion.acceleration[:, 0])[0, 1] > 0.7


@pytest.mark.long
def test_a_turned_rectangle_that_tilts_keeps_the_limits(random_path, check_plan):
    points, half = random_path(2), np.array([0.0, 0.0, math.sin(0.3), math.cos(0.3)])
    answer = plan(TANK, path_through(points), TEN, attitude=half)
    assert answer.found.tilt > 0.0
    assert answer.found.motion.tilt.attitude[-1] == pytest.approx(half, abs=1e-9)
    check_plan(answer, points, TANK, TEN)


@pytest.mark.long
@pytest.mark.parametrize("tilt", [1e-4, 1e-3])
def test_hardly_any_tilt_is_hardly_any_gain(tilt):
    upright = plan(CUP, path_through(LINE), LIMITS).found.motion.duration
    answer = plan(CUP, path_through(LINE), replace(LIMITS, tilt=tilt))
    gained = upright - answer.found.motion.duration
    # 10° gain 0.11 s.
    assert -1e-9 <= gained <= 0.002 + 2.0 * tilt


@pytest.mark.long
def test_a_lever_arm_counts_in_what_is_checked(tilting):
    model = CUP.with_effect("gravity_tilt").with_effect("lever_arm", x=0.0, y=0.0, z=0.02)
    assert checked(model, [tilting.found.motion], None)[0].excess(TEN)["residual"] > 1.0
    answer = plan(model, path_through(LINE), TEN)
    assert checked(model, [answer.found.motion], None)[0].keeps(TEN)
    # The search knows no lever arm: what it finds is slowed, and the tilt still gains time.
    assert answer.found.tilt > 0.5 * TEN.tilt
    assert answer.found.motion.duration < 0.8 * answer.scaled.found.motion.duration


@pytest.mark.parametrize("tilt", [-0.1, 1.0, math.nan])
def test_tilts_that_are_none(tilt):
    with pytest.raises(SloshPlanError, match="limit of tilt"):
        replace(LIMITS, tilt=tilt)
