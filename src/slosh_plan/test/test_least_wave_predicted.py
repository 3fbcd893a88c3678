"""Tests that predictions and plans start from the smallest wave, and what rows do not tell."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_model import Cylinder, Inputs, Model
from slosh_model.constants import GRAVITY
from slosh_model.motion_profiles import quintic
from slosh_model.standing import Standing
from slosh_model.standing_use import standing_use
from slosh_plan import HeightLimits, Trajectory, predict
from slosh_plan.planning.checked import Checker, heights_after
from slosh_plan.planning.time_law import PlannedMotion

CUP = Model(Cylinder(radius=0.04, fill_height=0.06)).spatial().nonlinear()
MODE = CUP.mode_constants()[0]
T = np.arange(0.0, 60.0, 0.002)
SHAKEN = np.outer(
    10.0 * MODE.damping_ratio * GRAVITY * np.cos(2.0 * MODE.natural_frequency * T), [0.0, 0.0, 1.0]
)


@pytest.mark.parametrize("model", [CUP, CUP.planar()], ids=["3D", "2D"])
def test_a_vertical_motion_at_twice_the_frequency_makes_waves(model):
    (found,) = predict(model, Trajectory(T, SHAKEN))
    assert found.growth > 1e3
    assert 0.005 < found.nonlinear.peak < 0.03
    assert found.linear.peak == pytest.approx(1e-5 * found.growth, rel=1e-3)
    (kept,) = predict(model, Trajectory(T, SHAKEN), limits=HeightLimits(0.005))
    assert not kept.kept


def test_a_planned_motion_is_checked_from_the_smallest_wave():
    t = T[::2]
    still = np.zeros((len(t), 3))
    motion = PlannedMotion(t, still, SHAKEN[::2], np.zeros(len(t)))
    (found,) = Checker(CUP)([motion])
    assert found.peak > 0.005


def stroke(rate):
    t = np.arange(round(rate) + 1) / rate
    inside = np.clip(t / 0.5, 0.0, 1.0)
    return Trajectory(t, np.outer(0.15 / 0.25 * quintic(inside)[2], [1.0, 0.0, 0.0]))


@pytest.mark.parametrize("rate", [10.0, 12.0, 20.0, 33.0, 50.0])
def test_what_lies_between_rows_is_within_the_interval(rate):
    (exact,) = predict(CUP, stroke(1000.0))
    (found,) = predict(CUP, stroke(rate))
    assert found.unresolved > 0.0
    assert found.nonlinear.peak < exact.nonlinear.peak < found.upper
    limit = 0.5 * (found.nonlinear.peak + found.upper)
    (undecided,) = predict(CUP, stroke(rate), limits=HeightLimits(limit))
    assert not undecided.kept


def test_dense_rows_have_no_interval():
    (found,) = predict(CUP, stroke(100.0))
    assert (found.unresolved, found.upper) == (0.0, found.nonlinear.peak)


def test_rows_near_half_a_period_tell_no_height():
    (found,) = predict(CUP, stroke(5.0), limits=HeightLimits(0.5))
    assert found.unresolved == found.upper == math.inf
    assert not found.kept


def test_rows_of_poses_count_as_they_are_given():
    t = np.arange(0.0, 1.01, 0.2)
    place = np.outer(0.15 * np.clip(t / 0.5, 0.0, 1.0), [1.0, 0.0, 0.0])
    turned = np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1))
    motion = Trajectory.from_poses(t, place, turned)
    assert len(motion.t) > 100
    assert motion.spacing == pytest.approx(0.2)
    assert motion.scaled(2.0).spacing == pytest.approx(0.4)


def test_robust_plans_and_their_pages_start_from_the_smallest_wave():
    t = T[::2]
    motion = PlannedMotion(t, np.zeros((len(t), 3)), SHAKEN[::2], np.zeros(len(t)))
    off = replace(CUP, natural_frequency=1.3 * MODE.natural_frequency)
    near, far = heights_after([CUP, off], motion, None)
    assert near.max() > 0.005
    assert far.max() < 1e-4


def test_a_loose_container_slides_by_a_wave_that_grows():
    standing = Standing(mass=0.01, centre_height=0.05, base_radius=0.03, friction=0.1)
    inputs = Inputs(T[::2], SHAKEN[::2])
    flat = standing_use(CUP, standing, Inputs(T[::2], 0.1 * SHAKEN[::2]))
    assert flat.friction == 0.0
    assert standing_use(CUP, standing, inputs).friction > 0.5
