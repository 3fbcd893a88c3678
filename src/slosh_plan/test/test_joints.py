"""Tests joint motions against a two-link arm with kinematics written out here."""

import math
import sys

import numpy as np
import pytest

from slosh_motion.inputs.robot import available
from slosh_plan import SloshPlanError
from slosh_plan.joints import Arm

needs_pinocchio = pytest.mark.skipif(
    not available(), reason="no Pinocchio (requirements/joints.txt)"
)
UPPER, FORE, CUP = 0.5, 0.4, 0.1
URDF = f"""<robot name="two_links">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="cup"/><link name="lamp"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="9"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="{UPPER} 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="grip" type="fixed"><parent link="fore"/><child link="cup"/>
    <origin xyz="{FORE} 0 {CUP}"/></joint>
  <joint name="switch" type="prismatic"><parent link="base"/><child link="lamp"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="9"/></joint>
</robot>"""
NAMES = ("shoulder", "elbow")


def swing(t):
    """Returns joint angles of a 2 s motion with first and second derivative."""
    turn = math.pi * t
    values = [(0.4, 0.3), (-0.9, 0.5)]
    angle = np.column_stack([a + b * (1 - np.cos(turn)) for a, b in values])
    rate = np.column_stack([b * math.pi * np.sin(turn) for _, b in values])
    change = np.column_stack([b * math.pi**2 * np.cos(turn) for _, b in values])
    return angle, rate, change


def by_hand(t):
    """Returns position, acceleration, yaw rate and yaw of the cup in the plane."""
    angle, rate, change = swing(t)
    position, acceleration = np.zeros((2, len(t)), dtype=complex)
    for length, count in ((UPPER, 1), (FORE, 2)):
        turn, speed, more = (column[:, :count].sum(axis=1) for column in (angle, rate, change))
        arrow = length * np.exp(1j * turn)
        position += arrow
        acceleration += (1j * more - speed**2) * arrow
    return position, acceleration, rate.sum(axis=1), angle.sum(axis=1)


@pytest.fixture(scope="module")
def arm():
    return Arm(URDF, "cup")


T = np.linspace(0.0, 2.0, 201)


@needs_pinocchio
@pytest.mark.parametrize("given", [1, 2])
def test_angles_that_wrap_are_joined(arm, given):
    """Tests joint angles that wrap at ±π, for joints with and without stops."""
    states = swing(T)[:given]
    turned = states[0] + np.array([2.4, 4.0])
    wrapped = (turned + np.pi) % (2.0 * np.pi) - np.pi
    assert arm.wrapping(NAMES, turned) == []
    assert arm.wrapping(NAMES, wrapped) == list(NAMES)
    one, two = (arm.motion(T, NAMES, angles, *states[1:]) for angles in (turned, wrapped))
    np.testing.assert_allclose(two.position, one.position, atol=1e-9)
    np.testing.assert_allclose(two.acceleration, one.acceleration, atol=1e-6)


@needs_pinocchio
@pytest.mark.parametrize("given", [1, 2, 3])
def test_the_cup_moves_as_derived_by_hand(arm, given):
    motion = arm.motion(T, NAMES, *swing(T)[:given])
    assert np.diff(motion.t).max() <= 0.001 + 1e-9
    position, acceleration, rate, yaw = by_hand(motion.t)
    found = motion.position
    assert np.abs(found[:, 0] + 1j * found[:, 1] - position).max() < 1e-6
    assert found[:, 2] == pytest.approx(CUP)
    felt = motion.acceleration
    # Positions alone, and a third degree, leave a little of the acceleration between the points.
    within = {1: 2e-2, 2: 2e-2, 3: 1e-6}[given]
    away = np.abs(felt[:, 0] + 1j * felt[:, 1] - acceleration)
    assert away[20:-20].max() < within
    assert felt[:, 2] == pytest.approx(0.0, abs=1e-12)
    assert motion.angular_velocity[:, 2] == pytest.approx(rate, abs=1e-3)
    turned = 2.0 * np.arctan2(motion.attitude[:, 2], motion.attitude[:, 3])
    assert np.abs(np.exp(1j * turned) - np.exp(1j * yaw)).max() < 1e-6


@needs_pinocchio
@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"joints": ("shoulder", "wrist")}, "URDF has no moving joint 'wrist'"),
        ({"joints": ("shoulder", "shoulder")}, "joint 'shoulder' appears twice"),
        ({"joints": ("shoulder", "switch")}, "joint 'elbow' carries the container and is missing"),
        ({"t": T[::-1]}, "comes before"),
        ({"t": np.zeros(201)}, "lasts 0 s"),
        ({"t": T[:1], "position": swing(T)[0][:1]}, "1 point: a motion needs at least 2"),
        ({"t": T[:2], "position": swing(T)[0][:2]}, "give at least 3, or velocities"),
        ({"position": swing(T)[0][:, :1]}, "position has the shape (201, 1), expected (201, 2)"),
        ({"position": swing(T)[0] * np.nan}, "position[0] of joint 'shoulder' = nan"),
        ({"velocity": swing(T)[0] * 1e9}, "velocity[0] of joint"),
    ],
)
def test_what_is_no_motion_of_joints_is_refused(arm, change, match):
    values = {"t": T, "joints": NAMES, "position": swing(T)[0]} | change
    with pytest.raises(SloshPlanError, match="trajectory: ") as caught:
        arm.motion(**values)
    assert match in str(caught.value)


@needs_pinocchio
def test_what_is_no_robot_is_refused():
    with pytest.raises(SloshPlanError, match=r"URDF: no link 'spoon' .it has base, upper"):
        Arm(URDF, "spoon")
    for text in ("", "<robot", "<html/>", "\0"):
        with pytest.raises(SloshPlanError, match="URDF: is not a robot description: "):
            Arm(text, "cup")


def test_without_pinocchio_it_says_what_to_do(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(SloshPlanError, match=r"pip install -r requirements/joints\.txt"):
        Arm(URDF, "cup")
