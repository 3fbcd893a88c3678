"""Tests the planner node over DDS: plans, feedback, cancelling and refusals."""

import math
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Transform
from rclpy.action import ActionClient
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from slosh_model import Inputs, simulate
from slosh_model.model_text import parse_model
from slosh_motion.inputs.robot import available
from slosh_msgs.action import PlanMotion
from slosh_msgs.msg import MotionPlan, PlanRequest, SloshEstimate
from slosh_msgs.srv import PlanMotion as PlanMotionService
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_duration, to_nanoseconds, to_time
from slosh_plan.nodes import planner_node
from slosh_plan.nodes.planner_node import THREADS, PlannerNode
from slosh_plan.planning import optimise
from slosh_testing.hearing_robot import Graph

TEXT = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
damping_ratio: auto
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity}]
"""
MODEL = parse_model(TEXT, "text")
LINE = ((0.0, 0.0, 0.0), (0.15, 0.0, 0.05), (0.3, 0.0, 0.1))
LOOP = tuple(
    (0.2 * math.cos(angle), 0.2 * math.sin(angle), 0.05 * math.sin(2 * angle))
    for angle in np.linspace(0.0, 4.0 * math.pi, 200)
)
SPIN, PITCH = (0.0, 0.0, 0.3826834, 0.9238795), (0.0, 0.3826834, 0.0, 0.9238795)
URDF = """<robot name="two_links">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="cup"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/></joint>
  <joint name="grip" type="fixed"><parent link="fore"/><child link="cup"/>
    <origin xyz="0.4 0 0.1"/></joint>
</robot>"""
needs_pinocchio = pytest.mark.skipif(
    not available(), reason="no Pinocchio (requirements/joints.txt)"
)
needs_casadi = pytest.mark.skipif(
    not optimise.available(), reason="no CasADi (requirements/plan.txt)"
)


class Cell(Graph):
    """The planner node in its own threads, with a client."""

    def __init__(self) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.probe, self.planner = self.node, PlannerNode()
        self.served = MultiThreadedExecutor(THREADS)
        self.served.add_node(self.planner)
        threading.Thread(target=self.served.spin, daemon=True).start()
        self.client = self.probe.create_client(PlanMotionService, topics.PLAN)
        self.action = ActionClient(self.probe, PlanMotion, topics.PLAN_MOTION)
        self.until(self.client.service_is_ready)
        self.until(self.action.server_is_ready)

    def ask(self, one: PlanRequest) -> PlanMotionService.Response:
        return self.got(self.client.call_async(PlanMotionService.Request(request=one)))

    def send(self, one: PlanRequest, heard: list[Any]) -> Any:
        goal = PlanMotion.Goal(request=one)
        return self.got(
            self.action.send_goal_async(goal, lambda told: heard.append(told.feedback))
        )


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cell]:
    model = tmp_path_factory.mktemp("model") / "model.yaml"
    model.write_text(TEXT)
    given = {"model": model, "service_time_limit": 20.0}
    if available():
        urdf = model.with_name("robot.urdf")
        urdf.write_text(URDF)
        given |= {"urdf": urdf, "tool_frame": "cup"}
    options = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
    rclpy.init(args=["--ros-args", *options])
    made = Cell()
    yield made
    made.planner.close()
    made.served.shutdown()
    made.planner.destroy_node()
    made.close()
    rclpy.try_shutdown()


def trajectory(places: Any, times: Any = None, turns: Any = ()) -> MultiDOFJointTrajectory:
    made = MultiDOFJointTrajectory(joint_names=["cup"])
    made.header.frame_id = "world"
    times = np.arange(len(places)) * 0.05 if times is None else times
    for number, (t, place) in enumerate(zip(times, places, strict=True)):
        point, pose = MultiDOFJointTrajectoryPoint(), Transform()
        point.time_from_start = to_duration(round(t * 1e9))
        pose.translation.x, pose.translation.y, pose.translation.z = map(float, place)
        if turns:
            turn = turns[number % len(turns)]
            pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w = turn
        point.transforms = [pose]
        made.points.append(point)
    return made


def request(places: Any = LINE, limit: float = 0.015, **fields: Any) -> PlanRequest:
    made = PlanRequest(limit=limit, residual_limit=0.002)
    made.trajectory = trajectory(places)
    for name, value in fields.items():
        setattr(made, name, value)
    return made


def check_motion(plan: MotionPlan, places: Any, limit: float = 0.015) -> None:
    """Checks a returned motion, interpolated at 1 kHz as by a controller."""
    points = plan.trajectory.points
    t = np.array([1e-9 * to_nanoseconds(point.time_from_start) for point in points])
    position, velocity, acceleration = (
        np.array([[vector.x, vector.y, vector.z] for vector in vectors])
        for vectors in (
            [point.transforms[0].translation for point in points],
            [point.velocities[0].linear for point in points],
            [point.accelerations[0].linear for point in points],
        )
    )
    assert (np.diff(t) > 0.0).all()
    assert t[-1] == pytest.approx(plan.duration)
    step = np.diff(t)[:, None]
    # Each point follows from the one before it.
    moved = velocity[:-1] * step + (acceleration[:-1] / 3 + acceleration[1:] / 6) * step**2
    assert np.abs(np.diff(position, axis=0) - moved).max() < 2e-7
    gained = 0.5 * (acceleration[:-1] + acceleration[1:]) * step
    assert np.abs(np.diff(velocity, axis=0) - gained).max() < 1e-3
    assert np.linalg.norm(acceleration, axis=1).max() <= 9.5
    assert (np.linalg.norm(np.diff(acceleration, axis=0) / step, axis=1)).max() <= 74.0 * 1.001
    assert not np.any(velocity[[0, -1]])
    assert not np.any(acceleration[[0, -1]])
    assert np.abs(position[plan.waypoints] - np.array(places)).max() < 1e-4
    even = np.arange(0.0, t[-1] + 2.0, 1e-3)
    felt = np.column_stack([np.interp(even, t, a, right=0.0) for a in acceleration.T])
    heights = simulate(MODEL, Inputs(even, felt))[0].msh
    assert heights.max() <= limit * 1.0001
    assert heights[even > t[-1]].max() <= 0.002 * 1.001


@needs_casadi
def test_the_service_gives_back_the_trajectory_with_new_times(cell: Cell) -> None:
    answer = cell.ask(request())
    assert answer.success, answer.message
    assert answer.plan.method == "optimal"
    assert answer.plan.duration < 0.85 * answer.plan.scaled_duration
    assert answer.plan.trajectory.joint_names == ["cup"]
    assert answer.plan.trajectory.header.frame_id == "world"
    assert len(answer.plan.waypoints) == len(LINE)
    check_motion(answer.plan, LINE)


def test_what_the_service_cannot_give_in_its_time_is_refused(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = np.zeros((5_001, 3))
    places[:, 0] = np.linspace(0.0, 0.3, len(places))
    answer = cell.ask(request(places))
    assert "5001 points are more than 5000: take fewer waypoints" in answer.message
    monkeypatch.setattr(planner_node, "MOST_ROWS", 100)
    answer = cell.ask(request(time_limit=0.5))
    assert not answer.success
    assert "returns 100 points, one per millisecond" in answer.message
    assert "the action plan_motion" in answer.message


@needs_casadi
def test_an_action_tells_how_far_it_is_and_gives_the_motion(cell: Cell) -> None:
    heard: list[Any] = []
    goal = cell.send(request(LOOP, time_limit=20.0), heard)
    assert goal.accepted
    # Meanwhile the service refuses.
    cell.until(lambda: len(heard) > 0)
    assert cell.ask(request()).message.startswith("another plan is under way")
    done = cell.got(goal.get_result_async())
    assert done.status == GoalStatus.STATUS_SUCCEEDED, done.result.message
    check_motion(done.result.plan, LOOP)
    assert heard[0].phase == "path"
    assert "known laws" in {told.phase for told in heard}
    assert math.isnan(heard[0].duration)
    assert heard[-1].phase.startswith("search")
    assert done.result.plan.duration <= heard[-1].duration
    elapsed = [told.elapsed for told in heard]
    assert elapsed == sorted(elapsed)
    assert len(elapsed) >= 3


@pytest.mark.long
@needs_casadi
def test_a_cancelled_goal_ends_with_what_it_has(cell: Cell) -> None:
    heard: list[Any] = []
    goal = cell.send(request(LOOP, time_limit=60.0), heard)
    result = goal.get_result_async()
    cell.until(lambda: bool(heard) and heard[-1].phase.startswith("search"))
    cell.got(goal.cancel_goal_async())
    done = cell.got(result)
    assert done.status == GoalStatus.STATUS_CANCELED
    assert done.result.success, done.result.message
    assert "was stopped" in done.result.message or done.result.plan.method == "optimal"
    check_motion(done.result.plan, LOOP)


def test_cancelled_before_there_is_a_motion_it_says_so(cell: Cell) -> None:
    goal = cell.send(request(LOOP, limit=0.0015, residual_limit=0.0001), [])
    cell.got(goal.cancel_goal_async())
    done = cell.got(goal.get_result_async())
    assert done.status == GoalStatus.STATUS_CANCELED
    assert not done.result.success
    assert "before a safe motion was found" in done.result.message
    assert len(done.result.plan.trajectory.points) == 0


BAD = {
    "none": (trajectory([]), "give a path"),
    "one point": (trajectory(LINE[:1]), "1 point: a motion needs at least 2"),
    "unsorted times": (trajectory(LINE, [0.0, 2.0, 1.0]), "t[2] = 1 s comes before t[1] = 2 s"),
    "repeated times": (trajectory(LINE, [0.0, 1.0, 1.0]), "t[2] = 1 s repeats t[1] = 1 s"),
    "zero duration": (trajectory(LINE, [0.0, 0.0, 0.0]), "the motion lasts 0 s"),
    "NaN": (trajectory([*LINE, (math.nan, 0.0, 0.0)]), "position[3].x = nan is not finite"),
    "a gap": (trajectory(np.tile(LINE, (8, 1)), [*np.arange(23) * 0.01, 9.0]), "a gap: 8.78 s"),
    "no way": (trajectory(LINE[:1] * 2), "the path has no length"),
    "a tilt": (trajectory(LINE, turns=[PITCH]), "the container is tilted by 45°"),
    "a turn": (trajectory(LINE, turns=[SPIN, PITCH]), "the attitude changes at point 1"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_path_that_is_none_is_refused_and_the_node_goes_on(cell: Cell, name: str) -> None:
    came, match = BAD[name]
    one = request(trajectory=came)
    answer = cell.ask(one)
    assert not answer.success
    assert match in answer.message
    assert "\n" not in answer.message
    assert len(answer.plan.trajectory.points) == 0
    goal = cell.send(one, [])
    done = cell.got(goal.get_result_async())
    assert done.status == GoalStatus.STATUS_ABORTED
    assert done.result.message == answer.message
    assert cell.planner.faults.total == 0


def test_liquid_above_the_limit_is_waited_for(cell: Cell) -> None:
    publisher = cell.probe.create_publisher(SloshEstimate, topics.ESTIMATE, qos.STREAM_OUT)
    message = SloshEstimate()

    def tell() -> None:
        message.header.stamp = to_time(cell.probe.get_clock().now().nanoseconds)
        publisher.publish(message)

    timer = cell.probe.create_timer(0.02, tell)
    cell.until(lambda: publisher.get_subscription_count() > 0)

    def told(displacement: float) -> PlanMotionService.Response:
        for answer in (message.linear, message.nonlinear):
            answer.modal_position, answer.modal_velocity = [displacement, 0.0], [0.0, 0.0]
        told_now = time.monotonic()
        cell.until(lambda: time.monotonic() - told_now > 0.2)
        return cell.ask(request(from_estimate=True, time_limit=0.2))

    assert "mm before the motion begins" in told(0.05).message
    assert "the liquid moves: from its state now" in told(0.004).message
    assert told(0.0).success
    cell.probe.destroy_timer(timer)
    cell.probe.destroy_publisher(publisher)


def of_joints(names: Any = ("finger", "elbow", "shoulder")) -> JointTrajectory:
    """Returns a trajectory of joints in any order, including those of a gripper."""
    made = JointTrajectory(joint_names=list(names))
    for t, places in ((0.0, (0.0, 0.3, 0.0)), (1.0, (0.0, 0.7, 0.5)), (2.0, (0.0, 0.9, 1.2))):
        point = JointTrajectoryPoint(positions=list(places[: len(names)]))
        point.time_from_start = to_duration(round(t * 1e9))
        made.points.append(point)
    return made


@needs_pinocchio
@needs_casadi
def test_joints_are_planned_along_their_own_path(cell: Cell) -> None:
    asked = PlanRequest(limit=0.015, residual_limit=0.005, max_velocity_scaling_factor=0.8)
    asked.joint_trajectory = of_joints()
    answer = cell.ask(asked)
    assert answer.success, answer.message
    found = answer.plan.joint_trajectory
    assert found.joint_names == ["finger", "elbow", "shoulder"]
    q, v = (np.array([getattr(point, name) for point in found.points])
            for name in ("positions", "velocities"))  # fmt: skip
    np.testing.assert_allclose(q[[0, -1]], [(0.0, 0.3, 0.0), (0.0, 0.9, 1.2)], atol=1e-4)
    assert np.abs(v[:, 2]).max() <= 0.8 * (1 + 1e-6)  # of the shoulder's 1 rad/s
    assert len(answer.plan.trajectory.points) == len(found.points)
    pose = answer.plan.trajectory.points[-1].transforms[0]
    assert pose.translation.x == pytest.approx(0.5 * math.cos(1.2) + 0.4 * math.cos(2.1), abs=1e-4)
    assert pose.rotation.z == pytest.approx(math.sin(1.05), abs=1e-4)
    assert answer.plan.peak <= 0.015
    assert not list(answer.plan.waypoints)


@needs_pinocchio
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"joint_trajectory": of_joints(("finger", "elbow"))}, "'shoulder' carries the container"),
        ({"trajectory": trajectory(LINE)}, "either a trajectory or a joint_trajectory"),
        ({"max_velocity_scaling_factor": 2.0}, "limit of joint_velocity = 2"),
    ],
)
def test_a_wrong_request_of_joints_is_refused(
    cell: Cell, change: dict[str, Any], words: str
) -> None:
    asked = PlanRequest(limit=0.015)
    asked.joint_trajectory = of_joints()
    for name, value in change.items():
        setattr(asked, name, value)
    answer = cell.ask(asked)
    assert not answer.success
    assert words in answer.message
