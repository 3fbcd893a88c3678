"""Tests the simulated container that moves as a governor tells it."""

import numpy as np
import pytest

from slosh_bringup.cell.motions import CellMotion, make_motion
from slosh_bringup.cell.truth import Push
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.processes import config_folder
from slosh_governor.core import Command, Governor
from slosh_governor.governed_cup import GovernedCup, GovernedStep, commanded_velocity
from slosh_model import Inputs, simulate
from slosh_model.model_text import read_model
from slosh_plan.planning.limits import PlanLimits

RATE, PERIOD, LIMIT = 1000.0, 0.01, 0.02
NANOSECONDS = round(1e9 * PERIOD)


@pytest.fixture(scope="module")
def truth():
    return read_model(config_folder() / "truth.yaml")


def steps_of(rows, ends=None):
    """Returns the governor's steps with given accelerations; ends: when they come [s]."""
    rows = np.array(rows)
    both = np.vstack([np.zeros(3), rows])
    velocity = np.cumsum(0.5 * PERIOD * (both[1:] + both[:-1]), axis=0)
    ends = PERIOD * np.arange(1, len(rows) + 1) if ends is None else ends
    return [
        GovernedStep(n, *one) for n, one in enumerate(zip(ends, velocity, rows, strict=True), 1)
    ]


def moved(cup, steps):
    return [one for step in steps for one in cup.move(step)]


def test_the_acceleration_is_linear_between_steps(truth):
    samples = moved(
        GovernedCup(truth, RATE, PERIOD), steps_of([[0.1, 0.0, -0.2], [0.1, 0.3, -0.2]])
    )
    assert [one.t for one in samples] == pytest.approx(np.arange(1, 21) / RATE)
    middle, first, last = samples[4], samples[9], samples[-1]
    assert middle.acceleration == pytest.approx([0.05, 0.0, -0.1])
    # ½ a t of a ramp, a t²/6 of the same.
    assert first.velocity == pytest.approx([0.0005, 0.0, -0.001])
    assert first.position == pytest.approx(np.array([0.1, 0.0, -0.2]) * PERIOD**2 / 6.0)
    assert last.velocity == pytest.approx([0.0015, 0.0015, -0.003])


def test_the_liquid_is_that_of_the_whole_motion(truth):
    rows = np.random.default_rng(3).normal(size=(60, 3))
    cup, push = GovernedCup(truth, RATE, PERIOD, Push(0.1, 0.1)), Push(0.1, 0.1)
    samples = moved(cup, steps_of(rows))
    t = np.array([0.0, *(one.t for one in samples)])
    driven = np.vstack([np.zeros(3), *(one.acceleration for one in samples)])
    response, _ = simulate(truth, Inputs(t, driven + push.acceleration(t)))
    found = np.array([cup.at(float(moment)) for moment in t])
    assert found == pytest.approx(np.column_stack([response.sh_x, response.sh_y]), abs=1e-12)
    assert np.abs(found).max() > 1e-3
    assert cup.at(99.0) == tuple(found[-1])


def test_the_velocity_is_reached_where_steps_come_late_or_not_at_all(truth):
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(60, 3)).cumsum(axis=0)
    ends = PERIOD * np.arange(1, 61) + rng.uniform(0.0, 0.008, 60)
    steps, cup = steps_of(rows, ends), GovernedCup(truth, RATE, PERIOD)
    come = [one for one in steps if one.number not in (7, 20, 21)]
    samples = moved(cup, come)
    found = cup.outcome(make_motion("c"), LIMIT)
    assert (found.steps, found.lost) == (60, 3)
    assert found.late >= 2
    assert "3 lost" in found.rows()["governed steps"]
    t = np.array([one.t for one in samples])
    assert t == pytest.approx(np.arange(1, len(t) + 1) / RATE)
    velocity = np.array([one.velocity for one in samples])
    for step in come:
        row = round(RATE * step.end) - 1
        assert velocity[min(row, len(t) - 1)] == pytest.approx(step.velocity, abs=0.02)
    assert np.abs(velocity).max() > 0.5


@pytest.mark.parametrize(
    ("step", "end", "push"),
    [(1, 0.02, 0.1), (0, 0.02, 0.1), (2, 0.01, 0.1), (2, 0.02, np.nan), (2, np.nan, 0.1)],
)
def test_a_governor_that_began_anew_is_named(truth, step, end, push):
    cup = GovernedCup(truth, RATE, PERIOD)
    cup.move(GovernedStep(1, 0.01, np.zeros(3), np.zeros(3)))
    with pytest.raises(SloshBringupError, match=f"step {step} of the governor.* follows step 1"):
        cup.move(GovernedStep(step, end, np.zeros(3), np.array([push, 0.0, 0.0])))


def test_a_motion_that_turns_cannot_be_commanded():
    turned = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
    motion = CellMotion("turn", np.array([0.0, 1.0]), np.zeros((2, 3)), np.zeros((2, 3)), turned)
    with pytest.raises(SloshBringupError, match="turn: turns the container"):
        commanded_velocity(motion)


def test_a_governed_cup_stays_below_the_limit_that_its_commands_exceed(truth):
    model, motion = read_model(config_folder() / "model.yaml"), make_motion("c", 1.0 / PERIOD)
    governor = Governor(model, PlanLimits(LIMIT, LIMIT), period=PERIOD, at_rest=True)
    cup = GovernedCup(truth, RATE, PERIOD)
    for step, velocity in enumerate(commanded_velocity(motion).tolist(), start=1):
        governor.take(Command(step * NANOSECONDS, tuple(velocity)))
        told = governor.step(step * NANOSECONDS)
        both = np.array(told.velocity), np.array(told.acceleration)
        cup.move(GovernedStep(step, step * PERIOD, *both))
    found = cup.outcome(motion, LIMIT)
    assert (found.lost, found.late) == (0, 0)
    assert found.ungoverned > 1.1 * LIMIT
    assert 0.6 * LIMIT < found.highest <= LIMIT
    assert 0.0 < found.slower < 0.6
    assert found.commanded == pytest.approx(2 * 2 * np.pi * 0.25, rel=1e-3)
    assert "the commands alone" in found.rows()["governed height"]
    assert "% slower than commanded" in found.rows()["governed distance"]


@pytest.mark.parametrize(
    ("clock", "share"), [(1.0, 0.05), (1.0, 0.2), (1.1, 0.0), (1.5, 0.0), (0.9, 0.0), (0.8, 0.0)]
)
def test_steps_that_come_late_early_or_not_at_all_keep_the_limit(truth, clock, share):
    """A clock that is slow or fast, and steps that are left out: the liquid lives in real time."""
    motion = make_motion("c")
    velocity = commanded_velocity(motion)
    many = np.where(np.random.default_rng(1).random(900) < share, 2, 1)
    governor = Governor(
        truth, PlanLimits(LIMIT, acceleration=6.0, jerk=200.0), period=PERIOD, at_rest=True
    )
    cup = GovernedCup(truth, 500.0, PERIOD)
    for t in (clock * PERIOD * np.cumsum(many)).tolist():
        now = round(1e9 * (1.0 + t))
        row = [float(np.interp(t, motion.t, velocity[:, axis])) for axis in range(3)]
        governor.take(Command(now, tuple(row)))
        told = governor.step(now)
        both = np.array(told.velocity), np.array(told.acceleration)
        cup.move(GovernedStep(told.steps, t, *both))
    found = cup.outcome(motion, LIMIT)
    # By a clock that is a fifth off the robot may do other things between the steps.
    assert 0.4 * LIMIT < found.highest <= LIMIT
    # Each step that is left out may be a step of the clock.
    assert found.slower < 0.6 + 0.5 * share
