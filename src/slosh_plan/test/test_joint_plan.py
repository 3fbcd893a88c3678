"""Tests plans of joint motions: same path, all limits kept, as fast as known laws."""

import dataclasses
import math

import numpy as np
import pytest

from slosh_base.files.errors import SloshFileError
from slosh_model import Inputs, simulate
from slosh_model.model_text import parse_model
from slosh_motion.inputs.robot import available
from slosh_motion.tables.columns import FOUND_OUT
from slosh_plan import SloshPlanError
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import (
    GivenLimits,
    limits_of,
    parse_joint_limits,
    read_joint_limits,
)
from slosh_plan.planning.joint_path import JointLeg, joint_path
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.plan import NoSafeMotionError, plan
from slosh_plan.planning.waypoints import JointWaypoints
from slosh_plan.robot_file import CarryingRobot
from slosh_plan.tables.joint_table import read_joint_table, write_joint_table

pytestmark = pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
UPPER, FORE = 0.5, 0.4
URDF = f"""<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.25 0 0"/><mass value="3"/>
    <inertia ixx="0.01" iyy="0.06" izz="0.06" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="cup"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="8" velocity="2"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="{UPPER} 0 0"/><axis xyz="0 0 1"/><limit effort="5" velocity="2.5"/></joint>
  <joint name="wrist" type="revolute"><parent link="fore"/><child link="cup"/>
    <origin xyz="{FORE} 0 0.1"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="5" velocity="3"/></joint>
</robot>"""
NAMES = ("shoulder", "elbow", "wrist", "finger")
GIVEN = {name: {"acceleration": 9.0, "jerk": 150.0} for name in NAMES[:3]}
CUP = parse_model(
    "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n"
    "effects: [{name: vertical_acceleration}]\n"
)
LIMITS = PlanLimits(0.015, 0.008)
LEVEL = np.array([[0.0, 0.4, 0.0, 0.02], [0.4, 0.8, 0.0, 0.03], [1.1, 1.0, 0.0, 0.02]])
LEANING = LEVEL + np.array([[0, 0, 0, 0], [0, 0, 0.2, 0], [0, 0, 0, 0]])


@pytest.fixture(scope="module")
def arm():
    return Arm(URDF, "cup")


@pytest.fixture(scope="module", params=["level", "leaning"])
def planned(request, arm):
    points = LEVEL if request.param == "level" else LEANING
    path = joint_path(arm, limits_of(arm, NAMES, GIVEN), points)
    return path, plan(CUP, path, LIMITS), points


def by_hand(joints):
    """Returns the cup's position for joint angles, without Pinocchio."""
    shoulder, elbow = joints[:, 0], joints[:, 0] + joints[:, 1]
    plane = UPPER * np.exp(1j * shoulder) + FORE * np.exp(1j * elbow)
    return np.column_stack([plane.real, plane.imag, np.full(len(joints), 0.1)])


def attitude_by_hand(joints):
    """Returns the cup's quaternions x, y, z, w for joint angles, without Pinocchio."""
    yaw, lean = 0.5 * (joints[:, 0] + joints[:, 1]), 0.5 * joints[:, 2]
    return np.column_stack([
        -np.sin(yaw) * np.sin(lean), np.cos(yaw) * np.sin(lean),
        np.sin(yaw) * np.cos(lean), np.cos(yaw) * np.cos(lean),
    ])  # fmt: skip


def test_a_plan_keeps_every_limit_by_other_means(planned):
    """Tests that a plan keeps every limit by kinematics written out by hand."""
    _, answer, _ = planned
    joints, step = answer.found.motion.joints, answer.found.motion.step
    for order, names in enumerate((("velocity",), ("acceleration",), ("jerk",)), start=1):
        rate = np.diff(joints.position, order, axis=0) / step**order
        for name in names:
            # A jerk that is constant between nodes is seen between rows as it is.
            used = np.abs(rate) / getattr(joints.limits, name)
            assert used.max() <= 1.0 + 2e-3, name
    place = by_hand(joints.position)
    acceleration = np.zeros_like(place)
    acceleration[1:-1] = np.diff(place, 2, axis=0) / step**2
    rest = 1000
    t = step * np.arange(len(place) + rest)
    turned = attitude_by_hand(joints.position)
    inputs = Inputs(
        t, np.concatenate([acceleration, np.zeros((rest, 3))]),
        np.concatenate([turned, np.tile(turned[-1], (rest, 1))]),
    )  # fmt: skip
    found = simulate(CUP.nonlinear().with_gravity_tilt(), inputs)[0].msh
    assert found.max() <= LIMITS.height * 1.002
    assert found[len(place) :].max() <= LIMITS.residual * 1.002
    assert found.max() > 0.9 * LIMITS.height  # it is used, not merely kept
    assert found.max() == pytest.approx(answer.found.peak, rel=2e-3)


def test_torques_are_those_of_two_links_in_the_plane(planned):
    """Tests torques against the textbook equations of two links in a plane."""
    _, answer, _ = planned
    joints = answer.found.motion.joints
    q, v, a = joints.position, joints.velocity, joints.acceleration
    own, other = 0.06 + 3 * 0.25**2, 0.03 + 2 * 0.2**2
    coupling = 2 * UPPER * 0.2
    c, s = coupling * np.cos(q[:, 1]), coupling * np.sin(q[:, 1])
    first = (own + other + 2 * UPPER**2 + 2 * c) * a[:, 0] + (other + c) * a[:, 1]
    first -= s * (2 * v[:, 0] * v[:, 1] + v[:, 1] ** 2)
    second = (other + c) * a[:, 0] + other * a[:, 1] + s * v[:, 0] ** 2
    np.testing.assert_allclose(joints.torque[1:-1, 0], first[1:-1], atol=2e-3)
    np.testing.assert_allclose(joints.torque[1:-1, 1], second[1:-1], atol=2e-3)
    assert np.abs(joints.torque[:, 0]).max() <= 8.0 * (1 + 1e-6)


def test_the_joints_keep_their_path_and_a_gripper_is_carried_along(planned):
    _, answer, points = planned
    position = answer.found.motion.joints.position
    np.testing.assert_allclose(position[[0, -1]], points[[0, -1]], atol=1e-4)
    away = np.linalg.norm(position - points[1], axis=1)
    assert away.min() < 2e-3  # between two rows at 1 kHz
    assert np.ptp(position[:, 3]) == pytest.approx(0.01, abs=1e-3)


def test_an_optimal_plan_is_faster_than_a_slowed_one(planned):
    _, answer, _ = planned
    assert answer.method == "optimal"
    assert answer.found.motion.duration < 0.95 * answer.scaled.found.motion.duration


def test_a_path_that_leans_feels_gravity(planned):
    path, answer, points = planned
    assert path.tilts == (points is LEANING)
    assert answer.found.tilt == 0.0


def test_shares_of_the_limits_slow_a_plan(arm):
    path = joint_path(arm, limits_of(arm, NAMES, GIVEN), LEVEL)
    slow = PlanLimits(0.05, 0.05, joint_velocity=0.3)
    answer = plan(CUP, path, slow)
    assert answer.found.joints["joint_velocity"] <= 0.3 * (1 + 1e-6)
    assert answer.found.joints["joint_velocity"] > 0.29


def test_a_curve_with_velocities_is_the_controllers_own(arm):
    """Tests that the path follows the cubic curve of a controller between points."""
    t = np.array([0.0, 1.0])
    ends = np.array([[0.0, 0.4, 0.0], [1.0, 0.4, 0.0]])
    rate = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    given = JointWaypoints(NAMES[:3], t, ends, rate)
    path = joint_path(arm, limits_of(arm, NAMES[:3]), given.points("it")[1])
    elbow = np.concatenate(
        [
            leg.joint_derivative(np.linspace(0, leg.length, 400), 0)[:, 1]
            for leg in path.legs
            if isinstance(leg, JointLeg)
        ]
    )
    u = np.linspace(0.0, 1.0, 10_001)
    hermite = 0.4 + (u - 2 * u**2 + u**3) + (u**3 - u**2)
    assert elbow.max() == pytest.approx(hermite.max(), abs=1e-4)
    assert elbow.min() == pytest.approx(hermite.min(), abs=1e-4)


def test_a_table_is_read_as_it_was_written(planned, arm, tmp_path):
    _, answer, _ = planned
    file = tmp_path / "plan.csv"
    write_joint_table(file, answer.found.motion)
    back = read_joint_table(file, arm, FOUND_OUT)
    joints = answer.found.motion.joints
    assert back.names == NAMES
    for name in ("position", "velocity", "acceleration"):
        np.testing.assert_allclose(getattr(back, name), getattr(joints, name), atol=1e-12)


MISTAKES = {
    "degrees": (np.degrees(LEVEL), "'shoulder' reaches 63.0254, .* are the angles in degrees"),
    "beyond a stop": (
        LEVEL + np.array([2.5, 0, 0, 0]),
        "'shoulder' reaches 3.6, outside",
    ),
    "beyond it between the points": (
        np.array([[2.6, 0, 0, 0], [2.99, 0.5, 0, 0], [2.99, 1, 0, 0], [2.6, 1.5, 0, 0]]),
        "smooth path between the points: joint 'shoulder' reaches 3.0",
    ),
    "nothing moves": (np.tile(LEVEL[:1], (3, 1)), "has no length"),
    "not finite": (np.where(LEVEL == 0.8, np.nan, LEVEL), "waypoint 1 has elbow = nan"),
    "lying": (
        LEVEL + np.array([0, 0, 0.9, 0]),
        "tilted by 52° at the start: the tool frame's z axis",
    ),
}


@pytest.mark.parametrize(("points", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_named(arm, points, words):
    with pytest.raises(SloshPlanError, match=words):
        joint_path(arm, limits_of(arm, NAMES), points)


def test_a_joint_that_carries_the_container_must_be_given(arm):
    with pytest.raises(SloshPlanError, match="joint 'wrist' carries the container and is missing"):
        joint_path(arm, limits_of(arm, NAMES[:2]), LEVEL[:, :2])


LIMITS_FILE = """default_velocity_scaling_factor: 0.1
default_acceleration_scaling_factor: 0.5
cartesian_limits: {max_trans_vel: 1}
joint_limits:
  shoulder: {has_velocity_limits: true, max_velocity: 1.5, has_acceleration_limits: false,
             max_acceleration: 0}
  elbow: {has_acceleration_limits: true, max_acceleration: 4, has_jerk_limits: true, max_jerk: 60}
"""


def test_limits_of_moveit_take_the_place_of_the_descriptions(arm, tmp_path):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(LIMITS_FILE)
    limits = limits_of(arm, NAMES[:3], read_joint_limits(file).joints)
    assert limits.velocity.tolist() == [1.5, 2.5, 3.0]
    assert limits.acceleration.tolist() == [math.inf, 4.0, math.inf]
    assert limits.jerk.tolist() == [math.inf, 60.0, math.inf]
    assert limits.lower[1] == -math.inf  # a joint without stops


def waypoints(tmp_path, step, swept):
    file = tmp_path / "way.csv"
    rows = [f"{step * n},{swept * n / 19},0,0" for n in range(20)]
    file.write_text("t,shoulder,elbow,wrist\n" + "\n".join(rows) + "\n")
    return file


@pytest.mark.parametrize(("step", "swept"), [(1.0, 0.6), (5.0, 1.2)])
def test_waypoints_seconds_apart_are_in_seconds_where_no_joint_is_so_fast(
    arm, tmp_path, step, swept
):
    found = read_joint_table(waypoints(tmp_path, step, swept), arm, FOUND_OUT)
    assert found.t[-1] == 19 * step


def test_waypoints_in_milliseconds_are_named(arm, tmp_path):
    with pytest.raises(SloshFileError, match=r"probably ms \(100 Hz\)"):
        read_joint_table(waypoints(tmp_path, 10.0, 0.02), arm, FOUND_OUT)


def test_waypoints_that_coincide_say_nothing_about_the_unit(arm, tmp_path):
    found = read_joint_table(waypoints(tmp_path, 1.0, 2e-6), arm, FOUND_OUT)
    with pytest.raises(SloshPlanError, match="20 waypoints coincide"):
        joint_path(arm, limits_of(arm, NAMES[:3]), found.position)


def test_the_limit_that_asks_for_too_long_a_motion_is_named(arm):
    slow = {**GIVEN, "elbow": {"velocity": 0.005}}  # 0.6 rad
    path = joint_path(arm, limits_of(arm, NAMES, slow), LEVEL)
    with pytest.raises(
        NoSafeMotionError, match=r"velocity of the joints asks for 1[2-4]\d\.?\d* s"
    ):
        plan(CUP, path, LIMITS)


def test_a_joint_without_a_known_limit_is_named():
    robot = CarryingRobot(Arm(URDF.replace('<limit effort="5" velocity="2.5"/>', ""), "cup"))
    one, none = robot.remarks
    assert none.startswith("elbow: no limit of the velocity and of the acceleration is known")
    assert one.startswith("shoulder, wrist: no limit of the acceleration is known")
    assert robot.unlimited(["wrist"])[0].startswith("wrist: no limit of the acceleration")
    assert CarryingRobot(Arm(URDF, "cup"), GivenLimits(GIVEN)).remarks == ()


@pytest.mark.parametrize(
    "text",
    [
        "joint_limits: {{{}}}",
        "/**:\n  ros__parameters:\n    robot_description_planning:\n      joint_limits: {{{}}}",
        "robot_description_planning: {{joint_limits: {{{}}}}}",
        "move_group: {{ros__parameters: {{other: 1, "
        "robot_description_planning: {{joint_limits: {{{}}}}}}}}}",
    ],
)
def test_limits_are_read_from_parameter_files_and_with_units_of_angles(text):
    entry = "elbow: {max_velocity: !degrees 90, max_position: !radians 1.5}"
    found = parse_joint_limits(text.format(entry)).joints
    assert found == {"elbow": {"velocity": math.pi / 2, "upper": 1.5}}
    with pytest.raises(SloshFileError, match="'fast' is no !degrees"):
        parse_joint_limits(text.format("elbow: {max_velocity: !degrees fast}"))


def test_shares_of_moveit_count_unless_others_are_asked_for(tmp_path):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(LIMITS_FILE)
    shares = read_joint_limits(file).shares
    assert shares == {"velocity": 0.1, "acceleration": 0.5}
    kept = LIMITS.with_shares(shares, None, 0.8)
    assert (kept.joint_velocity, kept.joint_acceleration) == (0.1, 0.8)


@pytest.mark.parametrize(
    ("entry", "acceleration"),
    [
        ("max_acceleration: 3, max_deceleration: -1, has_deceleration_limits: true", 1.0),
        ("max_acceleration: 3, max_deceleration: 1", 1.0),
        ("max_acceleration: 3, max_deceleration: -5", 3.0),
        ("max_acceleration: 3, max_deceleration: -1, has_deceleration_limits: false", 3.0),
        ("max_deceleration: -2", 2.0),
    ],
)
def test_a_deceleration_is_a_limit_of_the_acceleration(tmp_path, entry, acceleration):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(f"joint_limits: {{elbow: {{{entry}}}}}\n")
    assert read_joint_limits(file).joints["elbow"] == {"acceleration": acceleration}


def test_what_a_file_of_limits_holds_beside_them_is_named(tmp_path):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(
        "cartesian_limits: {max_trans_vel: 1}\n"
        "joint_limits: {elbow: {max_snap: 3, has_velocity_limits: true, angle_wraparound: true}}\n"
    )
    words = "cartesian_limits", "elbow.max_snap", "elbow.has_velocity_limits (without a value)"
    assert read_joint_limits(file).unused == words
    robot = CarryingRobot(Arm(URDF, "cup"), read_joint_limits(file))
    assert robot.file_remarks == (f"not used: {', '.join(words)}",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: {joint_limits: {}}\nb: {joint_limits: {}}", "2 sections joint_limits"),
        ("limits: {}\n", "section joint_limits is missing"),
        ("joint_limits: {elbow: 3}\n", "joint_limits.elbow must hold limits"),
        ("joint_limits: {elbow: {max_velocity: -1}}\n", "max_velocity = -1 must be a positive"),
        ("joint_limits: {elbow: {max_velocity: fast}}\n", "max_velocity = 'fast' must be"),
        ("joint_limits: {elbow: {max_deceleration: 0}}\n", "max_deceleration = 0 must be"),
        ("default_velocity_scaling_factor: 2\njoint_limits: {}\n", "factor = 2 must be a pos"),
    ],
)
def test_a_wrong_file_of_limits_is_named(tmp_path, text, words):
    file = tmp_path / "joint_limits.yaml"
    file.write_text(text)
    with pytest.raises(SloshPlanError, match=words):
        read_joint_limits(file)


def test_columns_that_no_option_names_are_not_read(tmp_path, arm):
    path = tmp_path / "echo.csv"
    path.write_text("stamp,frame_id,q0,q1\n0.0,,0.1,0.2\n0.5,base,0.2,0.3\n1.0,,0.3,0.4\n")
    told = []
    options = dataclasses.replace(
        FOUND_OUT, columns={"t": "stamp", "shoulder": "q0", "elbow": "q1"}, tell=told.append
    )
    table = read_joint_table(path, arm, options)
    assert table.names == ("shoulder", "elbow")
    np.testing.assert_allclose(table.position, [[0.1, 0.2], [0.2, 0.3], [0.3, 0.4]])
    assert "not read: frame_id" in told[0]
