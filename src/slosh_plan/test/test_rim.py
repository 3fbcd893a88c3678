"""Tests that the rim limits the height of every planned motion."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_plan import HeightLimits, predict, safe_scales
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import NoSafeMotionError, plan

RIM = 0.02


@pytest.fixture
def low_cup(cup):
    """Returns the cup with its rim 20 mm above the liquid."""
    container = replace(cup.container, rim_height=cup.container.fill_height + RIM)
    return replace(cup, container=container)


@pytest.mark.parametrize("asked", [None, HeightLimits(0.5), HeightLimits(0.03)])
def test_a_motion_over_the_rim_is_not_kept(cup, low_cup, line, asked):
    motion = line(0.5)
    (free,) = predict(replace(cup, container=replace(cup.container, rim_height=None)), motion)
    assert free.nonlinear.peak > RIM
    (found,) = predict(low_cup, motion, limits=asked)
    assert not found.kept
    assert found.excess == pytest.approx(free.nonlinear.peak - RIM)
    assert found.limits.height == pytest.approx(RIM)
    assert found.limits.height_name == "rim"


def test_no_time_scale_is_safe_that_spills(low_cup, line):
    motion = line(0.5)
    by_rim = safe_scales(low_cup, motion, HeightLimits(0.5))
    assert by_rim == safe_scales(low_cup, motion, HeightLimits(low_cup.container.freeboard))
    assert by_rim.safe_from > 1.0


def test_a_plan_stays_below_the_rim(low_cup):
    path = path_through(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    answer = plan(low_cup, path, PlanLimits(0.5, 0.5), time_limit=3.0)
    assert answer.found.peak <= RIM
    assert answer.limits.at_rim


def test_a_distance_to_the_rim_is_the_limit_that_it_leaves(low_cup, line):
    motion, asked = line(0.5), HeightLimits(0.5, rim_distance=0.005)
    (found,) = predict(low_cup, motion, limits=asked)
    (same,) = predict(low_cup, motion, limits=HeightLimits(RIM - 0.005))
    assert found.excess == pytest.approx(same.excess)
    assert found.limits.height_name == "rim limit"
    assert found.distance_to_rim == pytest.approx(RIM - found.upper)
    path = path_through(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    answer = plan(low_cup, path, PlanLimits(rim_distance=0.005), time_limit=3.0)
    assert answer.found.peak <= RIM - 0.005
    assert answer.limits.residual == answer.limits.height
    assert answer.distance_to_rim == pytest.approx(RIM - answer.found.peak)


def test_a_distance_that_cannot_be_kept_is_refused(cup, low_cup, line):
    with pytest.raises(SloshPlanError, match="the distance of the still liquid"):
        predict(low_cup, line(0.5), limits=HeightLimits(rim_distance=0.025))
    unknown = replace(cup, container=replace(cup.container, rim_height=None))
    with pytest.raises(SloshPlanError, match="the rim is not known"):
        predict(unknown, line(0.5), limits=HeightLimits(rim_distance=0.025))
    with pytest.raises(SloshPlanError, match="did you mean 5 mm"):
        HeightLimits(rim_distance=5.0)


def test_a_margin_larger_than_the_room_below_the_rim_is_refused(low_cup):
    path = path_through(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    with pytest.raises((SloshPlanError, NoSafeMotionError), match="20 mm"):
        plan(low_cup, path, PlanLimits(0.5, 0.5), margin=0.03)


@pytest.mark.parametrize("value", [10.0, 20.0])
def test_millimetres_are_no_metres(value):
    with pytest.raises(SloshPlanError, match=f"did you mean {value:g} mm, {value / 1e3:g}"):
        HeightLimits(value)
    assert HeightLimits(math.inf).height == math.inf
