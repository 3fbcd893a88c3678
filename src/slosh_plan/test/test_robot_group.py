"""Tests groups of joints of MoveIt's semantic robot description (SRDF)."""

from pathlib import Path

import numpy as np
import pytest

from slosh_motion.inputs.robot import available
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.waypoints import JointWaypoints
from slosh_plan.robot_file import CarryingRobot, read_robot
from slosh_plan.robot_group import read_group

JOINTS = (
    ("rail", "prismatic", "world", "carriage"), ("turn", "revolute", "carriage", "upper"),
    ("bend", "revolute", "upper", "fore"), ("flange", "fixed", "fore", "hand"),
    ("cup_joint", "fixed", "hand", "cup"), ("finger", "prismatic", "hand", "left"),
    ("other_finger", "prismatic", "hand", "right"),
)  # fmt: skip
LOW = {"bend": -2.0}
URDF = (
    '<robot name="cell"><link name="world"/>'
    + "".join(
        f'<link name="{child}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="0.4 0 0.1"/><axis xyz="0 0 1"/>'
        f'<limit lower="{LOW.get(name, -1.0)}" upper="2" effort="1" velocity="2"/>'
        + ('<mimic joint="finger"/>' if name == "other_finger" else "")
        + "</joint>"
        for name, kind, parent, child in JOINTS
    )
    + "</robot>"
)
GROUPS = """<robot name="cell">
  <!-- as MoveIt's assistant writes them -->
  <group name="chain"><chain base_link="carriage" tip_link="cup"/></group>
  <group name="joints"><joint name="turn"/><joint name="bend"/><joint name="flange"/></group>
  <group name="links"><link name="upper"/><link name="fore"/><link name="hand"/></group>
  <group name="hand"><joint name="finger"/><joint name="other_finger"/></group>
  <group name="all"><joint name="rail"/><group name="chain"/><group name="hand"/></group>
  <group name="loop"><group name="loop"/></group>
  <group name="fixed"><joint name="flange"/></group>
  <group name="strange"><joint name="no_joint"/></group>
  <group name="upwards"><chain base_link="cup" tip_link="carriage"/></group>
  <group_state name="home" group="joints"><joint name="turn" value="0"/></group_state>
</robot>"""
ARM = ("turn", "bend")


@pytest.fixture
def srdf(tmp_path: Path) -> Path:
    path = tmp_path / "cell.srdf"
    path.write_text(GROUPS)
    (tmp_path / "cell.urdf").write_text(URDF)
    return path


@pytest.mark.parametrize(
    ("name", "joints"),
    [
        ("chain", ARM), ("joints", ARM), ("links", ARM), ("hand", ("finger",)),
        ("all", ("rail", "turn", "bend", "finger")),
    ],
)  # fmt: skip
def test_a_group_counts_as_moveit_counts_it(srdf: Path, name: str, joints: tuple[str, ...]):
    assert read_group(srdf, name, URDF).joints == joints


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("arm", r"no group 'arm' .known: chain, joints"), ("loop", "contains itself"),
        ("fixed", "has no joint that moves"), ("strange", "has no joint 'no_joint'"),
        ("upwards", "has no chain 'cup to carriage'"),
    ],
)  # fmt: skip
def test_what_is_no_group_is_named(srdf: Path, name: str, why: str) -> None:
    with pytest.raises(SloshPlanError, match=why) as told:
        read_group(srdf, name, URDF)
    assert str(srdf) in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("text", ["", "<robot", "group: arm", "<robot/>"])
def test_what_is_no_srdf_is_named(srdf: Path, text: str) -> None:
    srdf.write_text(text)
    with pytest.raises(SloshPlanError, match=r"is no SRDF|no group"):
        read_group(srdf, "chain", URDF)


needs_pinocchio = pytest.mark.skipif(
    not available(), reason="no Pinocchio (requirements/joints.txt)"
)


def moving(names: tuple[str, ...], *still: str) -> JointWaypoints:
    """Returns waypoints at which all joints but some move."""
    position = np.linspace(0.0, 1.0, 3)[:, None] * [0.3 * (name not in still) for name in names]
    return JointWaypoints(names, np.arange(3.0), position + 0.1)


@pytest.fixture
def robot(srdf: Path) -> CarryingRobot:
    found = read_robot(srdf.with_suffix(".urdf"), "cup", "", srdf, "chain")
    assert found is not None
    return found


@needs_pinocchio
def test_joints_outside_the_group_are_held_where_they_are_given_or_at_zero(
    robot: CarryingRobot,
) -> None:
    assert robot.held(ARM) == ("rail",)
    alone = robot.arm.motion(np.arange(3.0), ARM, moving(ARM).position)
    given = moving(("rail", *ARM), "rail")
    beside = robot.arm.motion(np.arange(3.0), given.names, given.position)
    np.testing.assert_allclose(alone.acceleration, beside.acceleration, atol=1e-9)
    apart = (
        robot.arm.poses(given.names, given.position)[0]
        - robot.arm.poses(ARM, given.position[:, 1:])[0]
    )
    np.testing.assert_allclose(apart, np.tile([0.0, 0.0, 0.1], (3, 1)), atol=1e-12)
    robot.check_group(given, "path")
    robot.check_group(
        moving(("finger", "bend", "turn")), "path"
    )  # any order; the hand moves along


@needs_pinocchio
@pytest.mark.parametrize(
    ("names", "why"),
    [
        (("turn",), "joint 'bend' of the group 'chain' is missing"),
        (("rail", *ARM), "joint 'rail' carries the container and moves, but is not in the group"),
    ],
)
def test_what_moves_must_be_the_group(robot: CarryingRobot, names, why: str) -> None:
    with pytest.raises(SloshPlanError, match=why):
        robot.check_group(moving(names), "path")


@needs_pinocchio
def test_a_joint_that_cannot_stand_at_zero_must_be_given(srdf: Path) -> None:
    urdf = srdf.with_suffix(".urdf")
    urdf.write_text(URDF.replace('lower="-2.0"', 'lower="0.5"'))
    srdf.write_text('<robot><group name="turn"><joint name="turn"/></group></robot>')
    robot = read_robot(urdf, "cup", "", srdf, "turn")
    with pytest.raises(SloshPlanError, match="'bend' carries the container and is missing; it is"):
        robot.arm.motion(np.arange(3.0), ("turn",), moving(("turn",)).position)
