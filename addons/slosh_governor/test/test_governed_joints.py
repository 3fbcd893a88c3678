"""Tests the governor of joints: joint limits and liquid, by Pinocchio's kinematics."""

import copy
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_governor.core import (
    Command,
    GovernedArm,
    Governor,
    GovernorState,
    StopReason,
    chain,
    liquids,
)
from slosh_governor.core.parameters import joint_command
from slosh_governor.core.robot_arm import with_defaults
from slosh_model import Cylinder, Model, simulate
from slosh_model.tray import Tray, TrayContainer
from slosh_motion.inputs.robot import available
from slosh_plan.errors import SloshPlanError
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import GivenLimits, limits_of
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.robot_file import CarryingRobot

pytestmark = pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
URDF = (Path(__file__).resolve().parents[3] / "examples" / "robot.urdf").read_text()
PERIOD = 0.01
LIMITS = PlanLimits(0.012, acceleration=6.0, jerk=74.0)
CUP = Model(Cylinder(0.04, 0.06)).with_effect("vertical_acceleration").nonlinear()
START = (0.1, 0.3, -0.4, 0.0)
GIVEN = {"rail": {"velocity": 0.5}, "shoulder": {"velocity": 0.9, "upper": 1.0}}


@pytest.fixture(scope="module")
def arm():
    link = Arm(URDF, "cup")
    limits = with_defaults(
        CarryingRobot(link, GivenLimits(GIVEN)).limits(link.carrying), 6.0, 100.0
    )
    return GovernedArm(link, limits, np.array(START))


def run(governor, commands, start=1):
    """Returns the governor's steps for commands; None in the list means no command."""
    moved = []
    for step, command in enumerate(commands, start):
        now = round(step * PERIOD * 1e9)
        if command is not None:
            governor.take(command._replace(stamp_ns=now))
        moved.append(governor.step(now))
    return moved


def test_the_motion_of_the_frame_is_that_of_pinocchio(arm):
    motion, found = np.random.default_rng(0).normal(size=(3, 4)), np.empty((3, 3))
    chain.tip(arm.chain, motion, found)
    velocity, acceleration, place = motion
    expected = arm.arm.tip(arm.limits.names, place, velocity, acceleration)
    assert found[[2, 0, 1]] == pytest.approx(expected, abs=1e-12)


def targets(seed, count=200):
    """Returns random joint targets with jumps."""
    rng = np.random.default_rng(seed)
    rows, row = [], np.array(START)
    for _ in range(count):
        if rng.random() < 0.03:
            row = START + rng.normal(size=4) * [0.5, 0.6, 0.6, 0.05]
            row[1] = min(row[1], 1.05)
        rows.append(Command(0, (), tuple(row.tolist())))
    return rows


def motion_of(arm, moved):
    """Returns the container's motion between the steps, computed by Pinocchio."""
    still = (0.0,) * len(START)
    rate, change, place = (
        np.array([first, *(one.joints[k] for one in moved)])
        for k, first in enumerate((still, still, START))
    )
    t = PERIOD * np.arange(len(place))
    return arm.arm.motion(t, arm.limits.names, place, rate, change)


@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10_000), frequency=st.floats(-0.03, 0.03), damping=st.floats(-1.0, 1.0))
def test_joints_and_liquid_keep_their_limits(arm, seed, frequency, damping):
    governor = Governor(CUP, LIMITS, arm=arm, at_rest=True)
    moved = run(governor, targets(seed))
    moved += governor.stopped()
    assert all(one.safe for one in moved)
    rate, change, place = (np.array([one.joints[k] for one in moved]) for k in range(3))
    limits, slack = arm.limits, 1.0 + 1e-6
    assert (np.abs(rate) <= limits.velocity * slack).all()
    assert (np.abs(change) <= limits.acceleration * slack).all()
    assert (np.abs(np.diff(change, axis=0)) <= limits.jerk * PERIOD * slack).all()
    limits.check_positions(place, "governed", 1e-5)
    assert np.ptp(place[:, 0]) > 0.1
    motion = motion_of(arm, moved)
    assert np.linalg.norm(motion.acceleration, axis=1).max() <= 6.0 * 1.02
    first = CUP.mode_constants()[0]
    other = Model(
        CUP.container, damping_ratio=first.damping_ratio * 2.0**damping,
        natural_frequency=first.natural_frequency * (1.0 + frequency), effects=CUP.effects,
    ).with_gravity_tilt()  # fmt: skip
    assert simulate(other, motion.inputs(0.5, 0.002))[0].msh.max() <= LIMITS.height


def test_a_link_feels_what_pinocchio_says(arm):
    rng = np.random.default_rng(3)
    for _ in range(5):
        motion = rng.normal(size=(3, 4))
        felt = np.zeros((1, 3))
        liquids.feel(arm.chain, np.array([[0.0, 0.0, 0.0, 1.0]]), motion, felt)
        names = arm.limits.names
        tip = arm.arm.tip(names, motion[2], motion[0], motion[1])
        _, (quaternion,) = arm.arm.poses(names, motion[2][np.newaxis])
        x, y, z, w = quaternion
        up = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
        # Of equal size, and along the container's axis the same.
        force = tip[2] + [0.0, 0.0, 9.81]
        assert np.linalg.norm(felt[0] + [0.0, 0.0, 9.81]) == pytest.approx(np.linalg.norm(force))
        axis = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), up[2]])
        assert felt[0, 2] + 9.81 == pytest.approx(force @ axis)


def test_targets_are_reached_and_velocities_followed(arm):
    governor = Governor(CUP, LIMITS, arm=arm, at_rest=True)
    goal = (0.3, 0.5, -0.2, 0.02)
    moved = run(governor, [Command(0, (), goal)] * 500)
    assert moved[-1].joints[2] == pytest.approx(goal, abs=2e-3)
    (place,), _ = arm.arm.poses(arm.limits.names, np.array([goal]))
    assert moved[-1].position == pytest.approx(place, abs=5e-3)
    moved = run(
        Governor(CUP, LIMITS, arm=arm, at_rest=True), [Command(0, (0.05, 0.0, 0.0, 0.0))] * 100
    )
    assert moved[-1].joints[0] == pytest.approx((0.05, 0.0, 0.0, 0.0), abs=1e-3)


def test_a_tilted_cup_rests_with_a_level_surface(arm):
    tilted = arm.at(np.array([0.1, 0.3, -0.4, 0.12]))
    governor = Governor(
        CUP, PlanLimits(0.015, acceleration=6.0, jerk=74.0), arm=tilted, at_rest=True
    )
    moved = run(governor, [Command(0, (0.0,) * 4)] * 100)
    # The first mode's part of R tan 0.12 stands over the mark on the wall, and does not swing.
    assert {round(one.peak, 4) for one in moved} == {round(moved[0].peak, 4)}
    assert moved[0].peak == pytest.approx(0.87 * 0.04 * math.tan(0.12), rel=0.05)
    # Tilting further than the liquid allows is not done.
    moved = run(governor, [Command(0, (0.0, 0.0, 0.0, 0.5))] * 200, 101)
    assert 0.13 < moved[-1].joints[2][3] < 0.45
    assert all(one.safe for one in moved)


def test_a_stop_in_motion_keeps_the_limits_of_the_joints(arm):
    governor = Governor(CUP, LIMITS, arm=arm, at_rest=True)
    moved = run(governor, [Command(0, (0.5, 0.8, -0.5, 0.0))] * 60)
    told = copy.deepcopy(governor).stopped()
    governor.stop()
    done = run(governor, [Command(0, (0.5, 0.8, -0.5, 0.0))] * len(told), 61)
    assert [one.joints for one in told] == [one.joints for one in done]
    assert done[-1].state is GovernorState.RESTING
    rows = np.array([one.joints[1] for one in [*moved, *done]])
    assert (np.abs(rows) <= arm.limits.acceleration * (1 + 1e-6)).all()


@pytest.mark.parametrize(
    "bad", [(math.nan, 0.0, 0.0, 0.0), (0.0, 90.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
)
def test_unusable_targets_are_a_stop(arm, bad):
    governor = Governor(CUP, LIMITS, arm=arm, at_rest=True)
    run(governor, [Command(0, (0.1, 0.0, 0.0, 0.0))] * 30)
    (moved,) = run(governor, [Command(0, (), bad)], 31)
    assert (moved.state, moved.reason) == (GovernorState.STOPPING, StopReason.INVALID)


def test_a_tray_that_turns_drives_each_cup_by_its_place(arm):
    cups = [TrayContainer(name, CUP, place) for name, place in
            (("near", (0.0, 0.0, 0.0)), ("far", (0.35, 0.0, 0.0)))]  # fmt: skip
    spin = [Command(0, (0.0, 1.2, 0.0, 0.0))] * 80
    both = run(Governor(Tray(tuple(cups)), LIMITS, arm=arm, at_rest=True), spin)
    near = run(Governor(Tray(tuple(cups[:1])), LIMITS, arm=arm, at_rest=True), spin)
    assert {one.worst for one in both} >= {"far"}
    assert both[-1].joints[2][1] < near[-1].joints[2][1]


def test_names_in_any_order_make_a_command():
    joints = ("a", "b")
    found = joint_command(5, joints, ["x", "b", "a"], [9.0, 2.0, 1.0], [])
    assert found == Command(5, (), (1.0, 2.0))
    assert joint_command(0, joints, [], [], [3.0, 4.0]) == Command(0, (3.0, 4.0))
    for names, values in ((["a"], [1.0]), (["a", "b"], [1.0]), ([], [1.0]), (["a", "b"], [])):
        assert math.isnan(joint_command(0, joints, names, values, []).velocity[0])


def test_impossible_robots_are_refused(arm):
    with pytest.raises(SloshPlanError, match="joint 'shoulder' reaches 4"):
        arm.at(np.array([0.0, 4.0, 0.0, 0.0]))
    free = limits_of(arm.arm, arm.limits.names)
    with pytest.raises(SloshPlanError, match="each joint's acceleration"):
        GovernedArm(arm.arm, free, np.array(START))
