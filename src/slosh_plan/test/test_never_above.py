"""Tests that every planned motion keeps every limit, by independent integration."""

import pytest

from slosh_model import Cylinder, Model, Rectangle
from slosh_plan.planning import optimise
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import NoSafeMotionError, plan

CONTAINERS = (Cylinder(0.05, 0.07), Cylinder(0.035, 0.09), Rectangle(0.08, 0.06, 0.07))
HEIGHTS = (0.005, 0.015, 0.025)
RESIDUAL = 0.002
COUNT = 200
QUICK = (2, 4)
"""A rectangle at 5 mm, a cylinder at 15 mm."""


@pytest.mark.first(1)
@pytest.mark.skipif(not optimise.available(), reason="no CasADi (requirements/plan.txt)")
@pytest.mark.parametrize(
    "seed",
    [
        seed if seed in QUICK else pytest.param(seed, marks=pytest.mark.long)
        for seed in range(COUNT)
    ],
)
def test_random_paths_keep_the_limits(seed, random_path, check_plan):
    """Tests random paths with different containers and limits, some with corners."""
    model = Model(CONTAINERS[seed % 3]).spatial().nonlinear()
    limits = PlanLimits(HEIGHTS[seed // 3 % 3], RESIDUAL, 9.5, 74.0)
    points = random_path(seed, -1.0 if seed % 5 == 1 else 0.6)
    answer = plan(model, path_through(points), limits)
    assert answer.seconds < 31.0
    check_plan(answer, points, model, limits)


@pytest.mark.long
def test_where_no_motion_is_safe_it_says_so():
    limits = PlanLimits(1e-8, 1e-8, 9.5, 74.0)
    line = path_through([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
    with pytest.raises(NoSafeMotionError, match="no motion of up to 120 s"):
        plan(Model(CONTAINERS[1]).spatial().nonlinear(), line, limits)
