"""Tests joint states as poses and samples against kinematics written out by hand."""

import itertools
import math
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.joint_poses import JointPoses, JointVelocities
from slosh_motion.inputs.robot import Robot, available, read_urdf
from slosh_testing.joint_driver import (
    JOINTS,
    RAIL_URDF,
    acceleration,
    cup_position,
    quaternion,
    swung,
)

pytestmark = pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
ANGLE = st.floats(-1.9, 1.9)


def stamp(t):
    return BEGIN + round(t * 1e9)


@settings(max_examples=40, deadline=None)
@given(st.tuples(ANGLE, ANGLE, ANGLE, ANGLE), st.permutations([*JOINTS, "jaw", "lamp"]))
def test_a_pose_does_not_depend_on_the_order_of_names_nor_on_other_joints(values, names):
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    known = {**dict(zip(JOINTS, values, strict=True)), "jaw": 0.05, "lamp": math.nan}
    (found,) = poses.take(BEGIN, names, [known[name] for name in names])
    assert found.position == pytest.approx(cup_position(*values), abs=1e-12)
    expected = np.array(quaternion(*values[1:]))
    assert abs(np.dot(found.quaternion, expected)) == pytest.approx(1.0, abs=1e-12)
    assert poses.trouble() == ""


def samples(poses, states, reader=None):
    """Returns the samples that the input makes of joint states in order."""
    reader = reader or InputSettings("joints", GateSettings(), checks=True).reader("joints")
    found = []
    for t, names, positions in states:
        for pose in poses.take(stamp(t), names, positions):
            found += reader.update(pose.stamp_ns, pose.position, pose.quaternion, None, "world")
    return found


def error(found):
    """Returns the error of the accelerations, relative to the largest one."""
    t = np.array([(one.stamp_ns - BEGIN) * 1e-9 for one in found])
    true = acceleration(t)
    measured = np.array([one[1:4] for one in found])
    return np.abs(measured - true).max() / np.abs(true).max()


@pytest.mark.parametrize("rate", [125, 500, 1000])
def test_the_acceleration_is_that_of_the_kinematics(rate):
    times = np.arange(-0.3, 2.4, 1.0 / rate)
    states = [(t, JOINTS, swung(t).tolist()) for t in times]
    found = samples(JointPoses(Robot(RAIL_URDF, "cup", "world")), states)
    assert len(found) > 0.9 * len(times) - 40
    assert error(found) < 0.02


@pytest.mark.parametrize("rail_rate", [40, 125, 500])
def test_publishers_of_disjoint_joints_are_brought_together(rail_rate):
    """Tests that joint states of publishers with different rates are combined."""
    arm = [(t, JOINTS[1:], swung(t)[1:].tolist()) for t in np.arange(-0.5, 2.4, 0.002)]
    rail = [
        (t, ("rail", "belt"), [float(swung(t)[0]), 0.0])
        for t in np.arange(-0.4993, 2.4, 1.0 / rail_rate)
    ]
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    found = samples(poses, sorted([*arm, *rail], key=lambda state: state[0]))
    assert poses.trouble() == ""
    assert error(found) < 0.03
    steps = np.diff([one.stamp_ns for one in found[len(found) // 2 :]])
    parts = 1 if rail_rate > 100 else 3  # between slow poses accelerations are read off, too
    assert np.median(steps) == pytest.approx(1e9 / min(rail_rate, 500) / parts, rel=0.4)


def test_a_rail_that_stands_does_not_slow_the_arm_down():
    arm = [(t, JOINTS[1:], swung(t)[1:].tolist()) for t in np.arange(-0.5, 2.4, 0.002)]
    rail = [(t, ("rail",), [0.0]) for t in np.arange(-0.49, 2.4, 0.1)]
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    found = samples(poses, sorted([*arm, *rail], key=lambda state: state[0]))
    assert np.median(np.diff([one.stamp_ns for one in found])) == 2 * MS


def test_an_angle_that_wraps_between_two_publishers_goes_on():
    turning = np.linspace(2.5, 4.0, 100)
    wrapped = np.remainder(turning + math.pi, math.tau) - math.pi
    poses, found = JointPoses(Robot(RAIL_URDF, "cup", "world")), []
    for k, angle in enumerate(wrapped.tolist()):
        found += poses.take(BEGIN + 10 * k * MS, ("elbow",), [angle])
        rest = [0.001 * k, 0.0, 0.0]
        found += poses.take(BEGIN + (10 * k + 3) * MS, ("rail", "shoulder", "wrist"), rest)
    x = np.array([pose.position[0] for pose in found[2:]])
    assert np.abs(np.diff(x, 2)).max() < 1e-3


def test_what_is_missing_is_told_in_one_line():
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    for k in range(60):
        assert poses.take(BEGIN + k * MS, ("shoulder", "elbow", "jaw"), [0.1, 0.2, 0.0]) == []
    assert poses.trouble() == (
        "the joint states lack rail, wrist, on which the container depends; they hold shoulder, "
        "elbow, jaw"
    )


@pytest.mark.parametrize(
    ("names", "positions", "told"),
    [
        (JOINTS, [0.0, 90.0, 0.0, 0.0], "joint shoulder = 90 is far beyond its limits in URDF"),
        (
            JOINTS,
            [0.0, 0.1],
            f"2 positions for 4 names: 1 are not used, from {BEGIN / 1e9:.3f} s on",
        ),
    ],
)
def test_positions_that_cannot_be_are_told(names, positions, told):
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    poses.take(BEGIN, names, positions)
    assert told in poses.trouble()


def test_states_without_positions_or_with_nan_give_no_sample():
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    assert poses.take(BEGIN, JOINTS, []) == []
    reader = InputSettings("joints").reader("joints")
    assert samples(poses, [(0.0, JOINTS, [0.0, math.nan, 0.0, 0.0])], reader) == []
    assert reader.gate.dropped == 1


def test_a_joint_of_two_publishers_is_told_and_read_once():
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    poses.take(BEGIN, JOINTS, [0.0] * 4)
    assert poses.take(BEGIN + MS, ("elbow", "jaw"), [1.0, 0.0]) == []
    assert "joint elbow is in joint states with different sets of joints" in poses.trouble()


def test_a_joint_that_mimics_another_moves_with_it():
    text = RAIL_URDF.replace("</robot>", "<link name='tip'/></robot>").replace(
        "<link name='tip'/>",
        "<link name='tip'/><joint name='tilt' type='fixed'><parent link='other_jaw'/>"
        "<child link='tip'/></joint>",
    )
    robot = Robot(text, "tip", "world")
    assert robot.carrying == (*JOINTS, "jaw")
    still = robot.pose(dict.fromkeys(robot.carrying, 0.0))[0]
    open_ = robot.pose({**dict.fromkeys(robot.carrying, 0.0), "jaw": 0.03})[0]
    assert np.subtract(open_, still) == pytest.approx([0.0, -0.03, 0.0])


def test_the_world_may_be_any_fixed_link():
    turned = RAIL_URDF.replace(
        '<link name="world"/>',
        "<link name='base'/><link name='world'/><joint name='up' type='fixed'>"
        "<parent link='base'/><child link='world'/><origin xyz='1 2 3' rpy='1 0 0'/></joint>",
    )
    rest = dict.fromkeys(JOINTS, 0.1)
    plain, moved = (Robot(text, "cup", "world").pose(rest) for text in (RAIL_URDF, turned))
    assert plain[0] == pytest.approx(moved[0])
    with pytest.raises(SloshMotionError, match="link 'fore' moves, so it cannot be the world"):
        Robot(RAIL_URDF, "cup", "fore")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "URDF: is not a robot description: it has no element <robot>, and no <link>"),
        ("<robot", "URDF: is not a robot description: "),
        (RAIL_URDF.replace('xyz="0 0 0.1"', 'xyz="0 inf 0.1"'), "URDF: is not a robot desc"),
        ("<robot name='r'><link name='a'/></robot>", "URDF: no link 'cup'"),
        (
            "<robot name='r'><link name='a'/><link name='cup'/><joint name='j' type='floating'>"
            "<parent link='a'/><child link='cup'/></joint></robot>",
            "joint 'j' carries the container and has 6 degrees of freedom",
        ),
    ],
)
def test_descriptions_that_do_not_fit(text, told, capfd):
    with pytest.raises(SloshMotionError) as caught:
        Robot(text, "cup")
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_description_may_lack_its_root_element():
    inner = RAIL_URDF.partition('name="rail_robot">')[2].rpartition("</robot>")[0]
    assert Robot(f"<?xml version='1.0'?>\n{inner}", "cup").carrying == JOINTS


def test_xacro_without_its_package(tmp_path, monkeypatch):
    path = tmp_path / "robot.urdf.xacro"
    path.write_text('<robot xmlns:xacro="http://www.ros.org/wiki/xacro"/>')
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(SloshMotionError, match=r"run `xacro .*robot.urdf.xacro > robot.urdf`"):
        read_urdf(path)


@pytest.mark.parametrize(
    "text",
    [
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="cup"/></robot>',
        '<robot name="r"><!-- <xacro:hand/>\n<xacro:arm/> --><link name="cup"/></robot>',
        '<robot name="r"><link name="cup"/><note><![CDATA[<xacro:hand/>]]></note></robot>',
    ],
)
def test_a_finished_description_that_names_xacro_is_read_as_it_is(tmp_path, text):
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    assert read_urdf(path) == text


def test_an_element_of_xacro_beside_a_comment_is_xacro(tmp_path, monkeypatch):
    path = tmp_path / "robot.urdf"
    path.write_text('<robot name="r"><!-- <xacro:a/> --><xacro:hand side="left"/></robot>')
    monkeypatch.setitem(sys.modules, "xacro", None)
    with pytest.raises(SloshMotionError, match="is xacro"):
        read_urdf(path)


def test_without_pinocchio_one_line_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr("slosh_motion.inputs.robot.available", lambda: False)
    with pytest.raises(SloshMotionError, match=r"pip install -r requirements/joints\.txt"):
        Robot(RAIL_URDF, "cup")


def test_a_pinocchio_that_cannot_be_loaded_names_the_systems_package(monkeypatch, tmp_path):
    (tmp_path / "pinocchio.py").write_text(
        "import ctypes\nraise ImportError('libgomp.so.1: gone')"
    )
    monkeypatch.syspath_prepend(tmp_path)
    for name in [name for name in sys.modules if name.split(".")[0] == "pinocchio"]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(SloshMotionError, match=r"loaded: libgomp.*apt install libgomp1"):
        Robot(RAIL_URDF, "cup")


@pytest.mark.parametrize(("factor", "told"), [(1.0, "agree"), (57.3, "do not agree"), (0.0, "do")])
def test_whether_velocities_agree_is_told(factor, told):
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    for t in np.arange(0.0, 2.0, 0.008):
        speed = factor * (swung(t + 1e-5) - swung(t - 1e-5)) / 2e-5
        poses.take(stamp(t), JOINTS, swung(t).tolist(), speed.tolist())
    assert poses.facts()["joint velocities"].startswith(f"not used; they {told}")


def test_a_driver_that_falls_silent_is_named():
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    for k in range(400):
        poses.take(BEGIN + 10 * k * MS, JOINTS[1:], [0.001 * k, 0.0, 0.0])
        if k < 200:
            assert poses.trouble() == ""
            poses.take(BEGIN + 10 * k * MS, ("rail",), [0.001 * k])
    assert poses.trouble() == "no joint states of rail for 2.0 s"


def test_a_clock_that_is_set_back_begins_anew():
    poses = JointPoses(Robot(RAIL_URDF, "cup", "world"))
    halves = (("rail",), JOINTS[1:])

    def play(begin):
        found = []
        for k, half in itertools.product(range(20), halves):
            found += poses.take(begin + k * 10 * MS, half, [0.01 * k] * len(half))
        return found

    assert len(play(BEGIN)) == 20
    assert len(play(BEGIN - 3600 * 1000 * MS)) == 20


def test_a_link_that_shares_its_name_with_a_joint_is_the_container():
    shared = RAIL_URDF.replace('joint name="grip"', 'joint name="cup"')
    values = dict(zip(JOINTS, (0.1, 0.2, -0.3, 0.4), strict=True))
    assert shared != RAIL_URDF
    assert Robot(shared, "cup", "world").pose(values) == Robot(RAIL_URDF, "cup", "world").pose(
        values
    )


@pytest.mark.parametrize(
    ("velocity", "told"),
    [
        (lambda now, t: 57.29578 * now, "57.3 times"),
        (lambda now, t: -now, "-1 times"),
        (lambda now, t: now, ""),
        (lambda now, t: 0.0, ""),  # never filled
        (lambda now, t: 2.0 * math.sin(17.0 * t), ""),  # of something else
    ],
)
def test_velocities_in_another_unit_are_told(velocity, told):
    check = JointVelocities()
    for k in range(600):
        t = 0.01 * k
        check.take(
            BEGIN + k * 10 * MS, [math.sin(3.0 * t)], [velocity(3.0 * math.cos(3.0 * t), t)]
        )
    assert told in check.remark()
    assert bool(check.remark()) == bool(told)
