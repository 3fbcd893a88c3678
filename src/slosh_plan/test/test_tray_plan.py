"""Tests motions of a tray: the worst container, and plans that all containers keep."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_model.standing import Standing
from slosh_model.tray import Tray, TrayContainer
from slosh_plan import HeightLimits, LiquidState, Trajectory, predict, safe_scales
from slosh_plan.planning.checked import LooseContainer, checked
from slosh_plan.planning.known_laws import known_laws
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import NoSafeMotionError, plan
from slosh_plan.planning.plan_tray import TrayPlan, plan_container, plan_tray
from slosh_plan.tray import limits_of, predict_tray, tray_scales

T = np.arange(0.0, 2.0, 2e-3)
STEP = 1e-4


class Motion:
    """A smooth random motion of a tray with position and attitude, from rest to rest."""

    def __init__(self, random):
        self._sizes = random.normal(size=(2, 3)) * [[0.15], [0.5]]
        self._rates = random.uniform(4.0, 14.0, size=(2, 3))
        self._phases = random.uniform(0.0, 6.0, size=(2, 3))

    def _swung(self, t, row):
        swell = np.sin(np.pi * np.clip(t / T[-1], 0.0, 1.0)) ** 4
        waves = np.sin(self._rates[row] * np.asarray(t)[..., None] + self._phases[row])
        return self._sizes[row] * waves * swell[..., None]

    def attitude(self, t):
        return Rotation.from_rotvec(self._swung(t, 1))

    def place(self, t, arm):
        return self._swung(t, 0) + self.attitude(t).apply(arm)

    def acceleration(self, t, arm):
        """Returns the acceleration of a place on the tray by differences of its positions."""
        before, now, after = (self.place(t + k * STEP, arm) for k in (-1, 0, 1))
        return (after - 2.0 * now + before) / STEP**2


def random_tray(random):
    """Returns a tray with four cups of different sizes, fills, places and limits."""
    cups = []
    for index in range(4):
        radius = random.uniform(0.025, 0.05)
        model = Model(Cylinder(radius, random.uniform(1.0, 2.0) * radius)).spatial().nonlinear()
        place = tuple((random.uniform(-0.25, 0.25, size=3) * [1.0, 1.0, 0.2]).tolist())
        cups.append(TrayContainer(f"cup_{index}", model, place, random.uniform(0.01, 0.03)))
    return Tray(tuple(cups))


@pytest.mark.parametrize("seed", range(100))
def test_the_worst_cup_of_a_simulated_tray_is_the_named_one(seed):
    """Tests the worst cup against simulations driven by the acceleration of each place."""
    random = np.random.default_rng(seed)
    tray, motion = random_tray(random), Motion(random)
    attitude = motion.attitude(T).as_quat()
    given = Trajectory(T, motion.acceleration(T, np.zeros(3)), attitude)
    (found,) = predict_tray(tray, [given])
    peaks = {}
    for one in tray.containers:
        inputs = Inputs(T, motion.acceleration(T, np.array(one.place)), attitude)
        peaks[one.name] = float(simulate(one.model.with_gravity_tilt(), inputs)[0].msh.max())
        assert found.containers[one.name].nonlinear.peak == pytest.approx(
            peaks[one.name], rel=0.03, abs=2e-4
        )
    shares = {one.name: peaks[one.name] / one.limit for one in tray.containers}
    assert shares[found.worst] > 0.97 * max(shares.values())


def push(size=2.0):
    t = np.arange(0.0, 1.0, 2e-3)
    return Trajectory(t, np.outer(size * np.sin(2.0 * np.pi * t), [1.0, 0.0, 0.0]), name="push")


def test_a_plain_model_is_a_tray_of_one():
    model = Model(Cylinder(0.04, 0.06))
    tray = Tray((TrayContainer("", model),))
    (found,) = predict_tray(tray, [push()], limits=HeightLimits(0.02))
    (alone,) = predict(model, push(), limits=HeightLimits(0.02))
    assert repr(found.of_worst) == repr(alone)
    assert found.of_worst.nonlinear == alone.nonlinear
    scales = tray_scales(tray, push(), HeightLimits(0.02), found)
    assert scales == safe_scales(model, push(), HeightLimits(0.02))


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2))])
def test_a_scale_is_safe_where_every_container_keeps_its_limit(seed):
    random = np.random.default_rng(seed)
    tray, limits = Tray(random_tray(random).containers[:2]), HeightLimits(0.02)
    motion = push(random.uniform(1.0, 6.0))
    (found,) = predict_tray(tray, [motion], limits=limits)
    shared = tray_scales(tray, motion, limits, found)
    each = [safe_scales(one.placed, motion, limits_of(one, limits)) for one in tray.containers]
    assert shared.intervals
    assert shared.safe_from == max(one.safe_from for one in each)
    for low, high in shared.intervals:
        for one in each:
            ends = [(a, math.inf if b == one.slowest else b) for a, b in one.intervals]
            assert any(a <= low < high <= b for a, b in ends)


def test_the_lower_of_two_limits_holds_and_the_residual_with_it():
    one = TrayContainer("a", Model(Cylinder(0.04, 0.06)), limit=0.01)
    assert limits_of(one, HeightLimits(0.02, 0.01)) == HeightLimits(0.01, 0.005)
    assert limits_of(one, HeightLimits(0.005, 0.001)) == HeightLimits(0.005, 0.001)
    assert limits_of(one, HeightLimits()) == HeightLimits(0.01)


@pytest.mark.long
def test_all_containers_keep_the_plan():
    """Tests a plan for a wide cup with a slow wave and a narrow cup with a lower limit."""
    wide = Model(Cylinder(0.06, 0.05)).spatial()
    narrow = Model(Cylinder(0.025, 0.05)).spatial()
    cups = (TrayContainer("wide", wide, limit=0.012), TrayContainer("narrow", narrow, limit=0.008))
    tray = Tray(cups)
    limits = PlanLimits(0.02, 0.01)
    path = path_through(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]))
    made = []

    def make(one, kept):
        made.append(one.name)
        return TrayPlan(plan(one.placed, path, kept, time_limit=5.0), one)

    found = plan_tray(tray, limits, make)
    assert made[0] == "narrow"
    motion = found.plan.found.motion
    given = Trajectory(motion.t, motion.acceleration)
    for one in tray.containers:
        (answer,) = predict(one.model, given, limits=limits_of(one, HeightLimits(0.02, 0.01)))
        assert answer.nonlinear.peak <= one.limit * (1.0 + 1e-6)
        assert math.isfinite(answer.nonlinear.residual)
    alone = plan(narrow, path, limits_of(tray.containers[1], limits), time_limit=5.0)
    assert motion.duration >= alone.found.motion.duration - 1e-9


STANDING = Standing(mass=0.15, centre_height=0.05, base_radius=0.03, friction=0.2)


@pytest.mark.parametrize("friction", [0.15, 0.6])
def test_safe_time_scales_count_sliding_and_tipping(friction):
    """Tests the scales at which a loose cup slides or tips, though its liquid stays low."""
    model = Model(Cylinder(0.04, 0.06)).spatial()
    standing = replace(STANDING, base_radius=0.02, friction=friction)
    tray = Tray((TrayContainer("loose", model, standing=standing),))
    limits, motion = HeightLimits(0.03), push(4.0)

    def use(scale):
        return predict_tray(tray, [motion.scaled(scale)], limits=limits)[0].standing["loose"]

    (found,) = predict_tray(tray, [motion], limits=limits)
    shared = tray_scales(tray, motion, limits, found)
    assert shared.safe_from > safe_scales(model, motion, limits).safe_from
    assert shared.proven
    assert use(shared.safe_from).stands
    before = use(0.99 * shared.safe_from)
    assert not before.stands
    assert before.words == ("slides" if friction < 0.5 else "tips")
    slower = np.geomspace(shared.safe_from, 2.0 * shared.slowest, 20)
    assert all(use(float(scale)).stands for scale in slower)


def test_safe_time_scales_count_the_wave_that_is_there_at_the_start():
    """Tests that a loose cup's scales hold from the liquid's state, not only from rest."""
    model = Model(Cylinder(0.04, 0.06)).spatial()
    standing = replace(STANDING, base_radius=0.02, friction=0.15)
    tray = Tray((TrayContainer("loose", model, standing=standing),))
    motion, limits = push(1.0), HeightLimits(0.05)
    modal = np.array([[0.012, 0.0, 0.0, 0.0]])
    state = {"loose": LiquidState(modal, modal)}

    def use(scale):
        moved = [motion.scaled(scale)]
        return predict_tray(tray, moved, limits=limits, state=state)[0].standing["loose"]

    (found,) = predict_tray(tray, [motion], limits=limits, state=state)
    rest, moving = (tray_scales(tray, motion, limits, found, state=one) for one in (None, state))
    assert moving.safe_from > rest.safe_from
    assert not use(rest.safe_from).stands
    assert use(moving.safe_from).stands
    assert not moving.proven


def test_a_container_that_stands_loosely_is_not_lost():
    """Tests that the plan of a tray keeps a loose container from sliding."""
    model = Model(Cylinder(0.04, 0.06)).spatial()
    loose = TrayContainer("loose", model, (0.0, 0.1, 0.0), standing=STANDING)
    tray = Tray((TrayContainer("held", model), loose))
    limits = PlanLimits(0.015, 0.0075)
    path = path_through(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]))

    def make(one, kept):
        loose = LooseContainer.of(one)
        return TrayPlan(plan(one.placed, path, kept, time_limit=5.0, loose=loose), one)

    def motion_of(answer):
        return Trajectory(answer.found.motion.t, answer.found.motion.acceleration)

    usual = plan(model, path, limits, time_limit=5.0)
    (slides,) = predict_tray(tray, [motion_of(usual)], limits=limits)
    assert not slides.stands
    assert slides.loose_words[0].startswith("loose slides: ")
    found = plan_tray(tray, limits, make)
    (kept,) = predict_tray(tray, [motion_of(found.plan)], limits=limits)
    assert kept.stands
    assert kept.standing["loose"].friction > 0.9
    assert list(kept.standing) == ["loose"]
    assert found.plan.found.motion.duration > 1.05 * usual.found.motion.duration


def careless_plans(limit=0.01):
    """Returns a tray of one cup, and what plans for twice its limit."""
    tray = Tray((TrayContainer("a", Model(Cylinder(0.04, 0.06)), limit=limit),))
    path = path_through(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]))
    careless = plan(tray.first.model, path, PlanLimits(0.02, 0.01), time_limit=2.0)
    return tray, lambda one, _: TrayPlan(careless, one)


def test_where_no_plan_keeps_all_that_is_said(monkeypatch):
    monkeypatch.setattr("slosh_plan.planning.plan_tray.best_scaled", lambda *_, **__: None)
    tray, make = careless_plans()
    with pytest.raises(NoSafeMotionError, match=r"none of 8 plans .*: a exceeds its own by"):
        plan_tray(tray, PlanLimits(0.02, 0.01), make)


def test_where_no_plan_keeps_all_a_slower_law_does():
    tray, make = careless_plans()
    answer = plan_tray(tray, PlanLimits(0.02, 0.01), make)
    assert answer.found is not None
    assert answer.found.kept
    assert answer.plan.method != "optimal"
    assert 0.0095 < answer.plan.found.peak <= 0.01


@pytest.mark.parametrize("seed", [pytest.param(2, marks=pytest.mark.long), 3])
def test_no_known_law_that_all_containers_keep_is_faster(seed):
    random = np.random.default_rng(seed)
    cups = []
    for index in range(random.integers(2, 4)):
        radius = random.uniform(0.025, 0.05)
        model = Model(Cylinder(radius, random.uniform(1.0, 2.0) * radius)).spatial().nonlinear()
        place = tuple((random.uniform(-0.25, 0.25, 3) * [1.0, 1.0, 0.2]).tolist())
        cups.append(TrayContainer(f"c{index}", model, place, random.uniform(0.008, 0.03)))
    tray, limits = Tray(tuple(cups)), PlanLimits(0.03, 0.015, 7.0, 200.0)
    count = random.integers(2, 6)
    path = path_through(np.cumsum(random.normal(size=(count, 3)) * [0.15, 0.15, 0.04], axis=0))
    answer = plan_container(tray, path, limits, time_limit=3.0)
    assert answer.found is not None
    assert answer.found.kept
    planned = answer.plan.found.motion.duration
    for known in known_laws(path).values():
        for duration in planned * np.arange(0.8, 0.99, 0.02):
            motion = known.motion(round(duration, 3))
            one = checked(tray.first.placed, [motion], None)[0]
            if one.acceleration > limits.acceleration or one.jerk > limits.jerk:
                continue
            trajectory = Trajectory(motion.t, motion.acceleration)
            asked = HeightLimits(limits.height, limits.residual)
            (found,) = predict_tray(tray, [trajectory], limits=asked, horizon=2.5)
            assert not found.kept
