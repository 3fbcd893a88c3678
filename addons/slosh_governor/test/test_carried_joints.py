"""Tests the governor of a container that a robot carries: the robot's joints, by Pinocchio."""

import copy
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_governor.core import Command, GovernedArm, Governor, GovernorState, StopReason
from slosh_governor.core.robot_arm import with_defaults
from slosh_model import Cylinder, Inputs, Model, simulate
from slosh_motion.inputs.robot import available
from slosh_plan.errors import SloshPlanError
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import GivenLimits
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.robot_file import CarryingRobot

pytestmark = pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
URDF = (Path(__file__).resolve().parents[3] / "examples" / "robot.urdf").read_text()
REDUNDANT = URDF.replace(
    '<link name="world"/>', '<link name="floor"/><link name="world"/>'
).replace(
    '<joint name="rail"',
    '<joint name="track" type="prismatic"><parent link="floor"/><child link="world"/>'
    '<axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="1" velocity="3"/></joint>'
    '<joint name="rail"',
)  # fmt: skip
PERIOD = 0.01
LIMITS = PlanLimits(0.012, acceleration=6.0, jerk=74.0)
CUP = Model(Cylinder(0.04, 0.06)).with_effect("vertical_acceleration").nonlinear()
START = {"track": 0.0, "rail": 0.1, "shoulder": 0.5, "elbow": -1.1, "wrist": 0.0}
GIVEN = {"rail": {"velocity": 0.3}, "shoulder": {"velocity": 0.9, "upper": 1.0}}


def robot(urdf=URDF, **places):
    link = Arm(urdf, "cup")
    limits = with_defaults(
        CarryingRobot(link, GivenLimits(GIVEN)).limits(link.carrying), 6.0, 150.0
    )
    start = [{**START, **places}[name] for name in link.carrying]
    return GovernedArm(link, limits, np.array(start))


def robot_at(arm, **places):
    return [places.get(name, one) for name, one in zip(arm.limits.names, arm.start, strict=True)]


@pytest.fixture(scope="module")
def arm():
    return robot()


def run(governor, commands, start=1):
    """Returns the governor's steps for commands; None in the list means no command."""
    moved = []
    for step, command in enumerate(commands, start):
        now = round(step * PERIOD * 1e9)
        if command is not None:
            governor.take(command._replace(stamp_ns=now))
        moved.append(governor.step(now))
    return moved


def velocities(seed, count=200):
    """Returns random commanded velocities with jumps, in the plane of the arm."""
    rng = np.random.default_rng(seed)
    rows, row = [], np.zeros(2)
    for _ in range(count):
        if rng.random() < 0.04:
            row = rng.normal(size=2) * 0.5
        rows.append(Command(0, (*row.tolist(), 0.0)))
    return rows


def joints_of(moved):
    return (np.array([one.joints[k] for one in moved]) for k in range(3))


@pytest.mark.parametrize("urdf", [URDF, REDUNDANT], ids=["square", "redundant"])
def test_the_joints_carry_the_container_along(urdf):
    arm = robot(urdf)
    moved = run(Governor(CUP, LIMITS, carrier=arm, at_rest=True), velocities(3))
    rate, change, place = joints_of(moved)
    names = arm.limits.names
    positions, turns = arm.arm.poses(names, np.array([arm.start, *place]))
    told = np.array([one.position for one in moved])
    assert np.ptp(told, axis=0)[:2].min() > 0.05
    assert positions[1:] - positions[0] == pytest.approx(told, abs=1e-7)
    assert np.abs(turns - turns[0]).max() < 1e-7
    for one, q, v, a in zip(moved, place, rate, change, strict=True):
        _, velocity, acceleration = arm.arm.tip(names, q, v, a)
        assert velocity == pytest.approx(one.velocity, abs=1e-4)
        assert acceleration == pytest.approx(one.acceleration, abs=2e-2)
    # Each is the derivative of the one before.
    middle = slice(1, -1)
    assert np.gradient(place, PERIOD, axis=0)[middle] == pytest.approx(rate[middle], abs=0.02)
    assert np.gradient(rate, PERIOD, axis=0)[middle] == pytest.approx(change[middle], abs=1.0)


def test_where_a_step_is_left_out_joints_and_container_go_on_at_their_velocity(arm):
    governor = Governor(CUP, LIMITS, carrier=arm, at_rest=True)
    before = run(governor, [Command(0, (0.2, 0.1, 0.0))] * 20)[-1]
    now = round(22 * PERIOD * 1e9)
    governor.take(Command(now, (0.2, 0.1, 0.0)))
    after = governor.step(now)
    gone = np.subtract(after.position, before.position)
    mean = 0.5 * np.add(after.velocity, before.velocity)
    assert gone == pytest.approx(PERIOD * (np.array(before.velocity) + mean), abs=1e-4)
    places = np.array([before.joints[2], after.joints[2]])
    positions, turns = arm.arm.poses(arm.limits.names, places)
    assert positions[1] - positions[0] == pytest.approx(gone, abs=1e-6)
    assert turns[1] == pytest.approx(turns[0], abs=1e-6)


@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 10_000), to_targets=st.booleans())
def test_joints_and_liquid_keep_their_limits(arm, seed, to_targets):
    commands = velocities(seed)
    if to_targets:
        places = np.cumsum([one.velocity for one in commands], axis=0) * PERIOD
        commands = [Command(0, (), tuple(row)) for row in places.tolist()]
    governor = Governor(CUP, LIMITS, carrier=arm, at_rest=True)
    moved = run(governor, commands)
    moved += governor.stopped()
    assert all(one.safe for one in moved)
    rate, change, place = joints_of(moved)
    limits = arm.limits
    assert (np.abs(rate) <= limits.velocity).all()
    assert (np.abs(change) <= limits.acceleration).all()
    assert (np.abs(np.diff(change, axis=0)) <= limits.jerk * PERIOD).all()
    limits.check_positions(place, "governed", 0.0)
    rows = np.array([[0.0] * 3, *(one.acceleration for one in moved), *[[0.0] * 3] * 50])
    inputs = Inputs(PERIOD * np.arange(len(rows)), rows)
    assert simulate(CUP, inputs)[0].msh.max() <= LIMITS.height
    # Without the robot's joints the same commands move them too fast.
    assert {one.refused_by.partition(":")[0] for one in moved} - {""}


def test_out_of_reach_the_joint_is_named_and_the_way_back_is_free(arm):
    governor = Governor(CUP, LIMITS, carrier=arm, at_rest=True)
    # The arm is 0.9 m long, and its rail is along y.
    moved = run(governor, [Command(0, (0.5, 0.0, 0.0))] * 300)
    (place,), _ = arm.arm.poses(arm.limits.names, np.array(moved[-1].joints[2:]))
    assert 0.8 < place[0] < 0.9
    assert moved[-1].velocity[0] < 0.05
    assert moved[-1].refused_by.split(": ")[0] in arm.limits.names
    assert all(one.safe for one in moved)
    back = run(governor, [Command(0, (-0.2, 0.0, 0.0))] * 100, 301)
    assert back[-1].velocity[0] < -0.15


def test_a_way_that_no_joint_can_go_is_refused(arm):
    moved = run(
        Governor(CUP, LIMITS, carrier=arm, at_rest=True), [Command(0, (0.0, 0.0, 0.1))] * 50
    )
    assert np.abs([one.velocity for one in moved]).max() == 0.0
    assert moved[-1].refused_by.endswith(": reach or singularity")
    assert (moved[-1].share, moved[-1].state) == (0.0, GovernorState.LIMITED)


def test_a_stop_in_motion_keeps_the_limits_of_the_joints(arm):
    governor = Governor(CUP, LIMITS, carrier=arm, at_rest=True)
    moved = run(governor, [Command(0, (-0.4, 0.5, 0.0))] * 60)
    told = copy.deepcopy(governor).stopped()
    governor.stop()
    done = run(governor, [Command(0, (-0.4, 0.5, 0.0))] * len(told), 61)
    assert [one.joints for one in told] == [one.joints for one in done]
    assert done[-1].state is GovernorState.RESTING
    assert np.abs(done[-1].joints[0]).max() == 0.0
    _, change, _ = joints_of([*moved, *done])
    assert (np.abs(change) <= arm.limits.acceleration).all()


def test_at_rest_the_joints_go_on_from_where_they_were_measured(arm):
    governor = Governor(CUP, LIMITS, carrier=arm, at_rest=True)
    assert governor.locate(arm.start) == ""
    run(governor, [Command(0, (0.0, 0.0, 0.0))] * 3)
    there = arm.start + np.array([0.2, 0.1, -0.1, 0.0])
    assert governor.locate(there) == ""
    (moved,) = run(governor, [Command(0, (0.1, 0.0, 0.0))], 4)
    assert moved.joint_start == tuple(there)
    assert moved.joints[2] == pytest.approx(there, abs=1e-3)
    (moved,) = run(governor, [Command(0, (0.1, 0.0, 0.0))], 5)
    assert moved.joint_start == ()
    # The same steps follow from the recorded start alone.
    again = Governor(CUP, LIMITS, carrier=arm, at_rest=True)
    run(again, [Command(0, (0.0, 0.0, 0.0))] * 3)
    again.locate(there)
    assert run(again, [Command(0, (0.1, 0.0, 0.0))] * 2, 4)[-1].joints == moved.joints


def test_a_robot_that_strays_is_a_stop_until_it_rests(arm):
    governor = Governor(CUP, LIMITS, carrier=arm, at_rest=True)
    on = [Command(0, (-0.2, 0.0, 0.0))]
    run(governor, on * 30)
    assert governor.locate(governor.joints[2] + 0.05) == ""  # it lags
    doubt = governor.locate(governor.joints[2] + [0.0, 0.5, 0.0, 0.0])
    assert doubt.startswith("joint 'shoulder' is at ")
    moved = run(governor, on, 31)
    assert (moved[-1].state, moved[-1].reason) == (GovernorState.STOPPING, StopReason.JOINTS)
    governor.lose(lost=False)
    moved += run(governor, on, 32)
    assert moved[-1].state is GovernorState.STOPPING
    moved += run(governor, on * 100, 33)
    assert moved[-1].reason is StopReason.NONE
    assert moved[-1].velocity[0] < -0.02
    # At rest it may be anywhere that is possible.
    governor.stopped()
    assert governor.locate(robot_at(arm, wrist=0.5)).startswith("the robot holds the container")
    assert "outside its limits" in governor.locate(robot_at(arm, shoulder=2.0))
    assert governor.locate(arm.start) == ""


@pytest.mark.parametrize(
    ("places", "words"),
    [({"wrist": 0.1}, "tilted by 5.7°"), ({"shoulder": 2.0}, "joint 'shoulder' reaches 2,")],
)
def test_impossible_starts_are_refused(places, words):
    with pytest.raises(SloshPlanError, match=words):
        Governor(CUP, LIMITS, carrier=robot(**places), at_rest=True)


def test_joints_far_from_their_limits_change_nothing(arm):
    commands = [Command(0, (0.05, 0.02, 0.0))] * 60
    slow = PlanLimits(0.012, acceleration=1.0, jerk=10.0)
    free = run(Governor(CUP, slow, at_rest=True), commands)
    held = run(Governor(CUP, slow, carrier=arm, at_rest=True), commands)
    assert free[-1].joints == ()
    assert [one.velocity for one in free] == [one.velocity for one in held]
    assert {one.refused_by for one in held} == {""}
    assert not math.isnan(held[-1].joints[2][0])
