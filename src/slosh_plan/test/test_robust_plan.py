"""Tests that a robust plan, unlike a usual one, keeps its limits for unseen parameters."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from slosh_model.covariance import covariance_of
from slosh_model.parameters import parameter_value
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.standing import Standing
from slosh_model.tray import Tray, TrayContainer
from slosh_plan import SloshPlanError
from slosh_plan.planning import optimise, robust
from slosh_plan.planning.checked import LooseContainer, heights_after, standing_uses
from slosh_plan.planning.likely import likely_models
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import plan
from slosh_plan.planning.plan_tray import plan_container
from slosh_plan.planning.progress import Watch
from slosh_plan.planning.robust import plan_robust

NAMES = ("natural_frequency", "damping_ratio")
RADIUS = 0.05
LINE = path_through([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
LIMITS = PlanLimits(0.02, 0.002)
TALL = Standing(mass=0.05, centre_height=0.05, base_radius=0.012, friction=0.5)
"""A container that rather tips than slides."""


@pytest.fixture
def doubtful(cup):
    """Returns the cup with standard errors of its frequency and damping."""

    def make(frequency=0.01, damping=0.2):
        errors = [
            share * parameter_value(cup, name)
            for share, name in zip((frequency, damping), NAMES, strict=True)
        ]
        return replace(cup, covariance=covariance_of(NAMES, np.diag(np.square(errors))))

    return make


def test_likely_parameters_fill_the_region_of_95_percent(doubtful):
    model = doubtful(0.01, 0.1)
    found = likely_models(model, count=400)
    errors = model.covariance.standard_errors
    away = np.array(
        [
            [(parameter_value(one, n) - parameter_value(model, n)) for n in NAMES]
            for one in found.models
        ]
    )
    # 5.991 is the 95 % point of χ² with two degrees of freedom.
    distance = np.linalg.norm(away / errors, axis=1) / np.sqrt(5.991)
    assert distance[::2] == pytest.approx(1.0, rel=1e-3)
    assert distance.max() < 1.001
    # A uniform point of the unit disc lies within half of the radius in a quarter of all cases.
    assert np.mean(distance[1::2] < 0.5) == pytest.approx(0.25, abs=0.1)
    assert np.all(np.abs(away.mean(axis=0)) < 0.2 * errors)


def test_a_damping_ratio_stays_possible(doubtful):
    found = likely_models(doubtful(0.01, 2.0), count=200)
    assert all(one.damping_ratio >= 0.0 for one in found.models)


def test_without_a_covariance_it_says_what_to_do(cup):
    with pytest.raises(SloshPlanError, match="slosh identify"):
        plan_robust(cup, LINE, LIMITS)


def highest(models, motion):
    """Returns the maximum heights of many models during a motion and after its end [m]."""
    heights = list(heights_after(models, motion, None))
    end = len(motion.t) - 1
    return max(msh.max() for msh in heights), max(msh[end:].max() for msh in heights)


@pytest.mark.skipif(not optimise.available(), reason="no CasADi (requirements/plan.txt)")
def test_it_keeps_the_limits_for_parameters_that_it_has_not_seen(doubtful):
    model = doubtful()
    unseen = likely_models(model, count=300, seed=2).models
    usual = plan(replace(model, covariance=None), LINE, LIMITS)
    assert highest(unseen, usual.found.motion)[1] > 1.1 * LIMITS.residual
    answer, likely = plan_robust(model, LINE, LIMITS)
    peak, residual = highest(unseen, answer.found.motion)
    assert answer.method == "optimal"
    assert peak <= 1.001 * LIMITS.height
    assert residual <= 1.001 * LIMITS.residual
    assert likely.peak == pytest.approx(peak, rel=0.01)
    assert (
        likely.nominal_duration <= answer.found.motion.duration < 1.2 * usual.found.motion.duration
    )


@pytest.mark.long
@pytest.mark.skipif(not optimise.available(), reason="no CasADi (requirements/plan.txt)")
def test_the_planners_service_plans_robustly_for_one_container(doubtful):
    model, watch = doubtful(), Watch()
    tray = Tray((TrayContainer("", model),))
    found = plan_container(tray, LINE, LIMITS, time_limit=20.0, watch=watch, robust=True)
    answer = found.plan
    usual = plan_container(tray, LINE, LIMITS, time_limit=20.0).plan
    assert found.one.name == ""
    assert answer.found.motion.duration > usual.found.motion.duration


@pytest.mark.skipif(not optimise.available(), reason="no CasADi (requirements/plan.txt)")
@pytest.mark.parametrize("radius", [RADIUS, pytest.param(0.03, marks=pytest.mark.long)])
def test_a_tray_is_planned_robustly_for_all_its_containers(doubtful, radius):
    model = doubtful()
    other = replace(model, container=Cylinder(radius, 0.07))
    tray = Tray((TrayContainer("a", model), TrayContainer("b", other)))
    found = plan_container(tray, LINE, LIMITS, time_limit=40.0, robust=True)
    assert found.likely is not None
    for one in tray.containers:
        unseen = likely_models(one.model, count=300, seed=4).models
        peak, residual = highest(unseen, found.plan.found.motion)
        assert peak <= 1.001 * LIMITS.height
        assert residual <= 1.001 * LIMITS.residual


def test_a_robust_plan_of_a_tray_needs_every_covariance(doubtful, cup):
    tray = Tray((TrayContainer("a", doubtful()), TrayContainer("b", cup)))
    with pytest.raises(SloshPlanError, match="container b: a robust plan needs the covariance"):
        plan_container(tray, LINE, LIMITS, robust=True)


@pytest.mark.parametrize(
    ("solver", "errors"),
    [(False, (0.05, 0.3)), pytest.param(True, (0.02, 0.2), marks=[
        pytest.mark.long,
        pytest.mark.skipif(not optimise.available(), reason="no CasADi (requirements/plan.txt)"),
    ])],
    ids=["known law", "optimal"],
)  # fmt: skip
def test_a_loose_container_stands_for_parameters_that_it_has_not_seen(
    doubtful, monkeypatch, solver, errors
):
    if not solver:
        monkeypatch.setattr(optimise, "available", lambda: False)
        monkeypatch.setattr(robust, "likely_models", partial(likely_models, count=100))
    model, wide, loose = doubtful(*errors), PlanLimits(0.045, 0.045), LooseContainer(TALL)
    usual = plan(model, LINE, wide, loose=loose).found
    answer = plan_robust(model, LINE, wide, loose=loose, time_limit=60.0).plan.found
    unseen = likely_models(model, count=1000 if solver else 100, seed=5).models

    def largest(motion):
        return max(max(used) for used in standing_uses(unseen, motion, None, loose))

    # The usual plan lets liquids unlike the model's tip it.
    assert max(usual.standing.values()) <= 1.0
    assert largest(usual.motion) > 1.02
    assert largest(answer.motion) <= 1.001
    assert max(answer.standing.values()) >= largest(answer.motion) - 0.01
    assert usual.motion.duration < answer.motion.duration < 1.3 * usual.motion.duration


def test_known_laws_are_robust_where_there_is_no_solver(doubtful, monkeypatch):
    monkeypatch.setattr(optimise, "available", lambda: False)
    model = doubtful(0.02, 0.3)
    answer, likely = plan_robust(model, LINE, LIMITS)
    peak, residual = highest(likely_models(model, 300, seed=3).models, answer.found.motion)
    assert answer.method != "optimal"
    assert peak <= 1.001 * LIMITS.height
    assert residual <= 1.001 * LIMITS.residual
    assert likely.peak <= LIMITS.height
