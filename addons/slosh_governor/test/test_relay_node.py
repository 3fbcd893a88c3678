"""Tests that the relay, between client and controller, keeps the liquid low."""

import math
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.nodes import input_subscription
from slosh_governor.nodes.relay_node import THREADS, RelayNode
from slosh_model.model_text import parse_model
from slosh_motion.inputs.robot import available
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_duration, to_nanoseconds, to_time
from slosh_plan import predict
from slosh_plan.planning import optimise
from slosh_plan.robot_file import read_arm
from slosh_testing.hearing_robot import Graph

Follow = pytest.importorskip("control_msgs.action").FollowJointTrajectory
pytestmark = [
    pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)"),
    pytest.mark.timeout(120),
]
TEXT = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity}]
"""
URDF = """<robot name="two_links">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="cup"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="2"/></joint>
  <joint name="grip" type="fixed"><parent link="fore"/><child link="cup"/>
    <origin xyz="0.4 0 0.1"/></joint>
</robot>"""
CONTROLLER = "/arm/follow_joint_trajectory"
LIMIT = 0.01


class Controller:
    """Simulated robot controller that records the goals that it was sent."""

    def __init__(self) -> None:
        self.node = Node("arm_controller")
        self.goals: list[Any] = []
        self.finish, self.accepts = threading.Event(), True
        self.result = Follow.Result(error_code=0, error_string="there")
        self._server = ActionServer(
            self.node, Follow, CONTROLLER, self._run, callback_group=ReentrantCallbackGroup(),
            goal_callback=self._asked, cancel_callback=lambda _: CancelResponse.ACCEPT,
        )  # fmt: skip

    def _asked(self, request: Any) -> Any:
        from rclpy.action import GoalResponse

        self.goals.append(request)
        return GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT

    def _run(self, goal: Any) -> Any:
        while not self.finish.wait(0.02):
            told = Follow.Feedback(joint_names=["shoulder", "elbow"])
            told.actual.positions = [0.25, 0.5]
            goal.publish_feedback(told)
            if goal.is_cancel_requested:
                goal.canceled()
                return Follow.Result(error_string="stopped")
        if self.result.error_code == 0:
            goal.succeed()
        else:
            goal.abort()
        return self.result

    def close(self) -> None:
        self.finish.set()
        self._server.destroy()


class Cell(Graph):
    """Relay and simulated controller in threads of their own, and a client."""

    def __init__(self, relay: RelayNode) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.relay, self.controller = relay, Controller()
        self.served = MultiThreadedExecutor(THREADS + 4)
        for node in (self.relay, self.controller.node):
            self.served.add_node(node)
        threading.Thread(target=self.served.spin, daemon=True).start()
        self.client = ActionClient(self.node, Follow, topics.FOLLOW_TRAJECTORY)
        self.until(self.client.server_is_ready)
        self.until(self.relay._client.server_is_ready)
        self.heard: list[Any] = []

    def send(self, trajectory: JointTrajectory) -> Any:
        goal = Follow.Goal(trajectory=trajectory, goal_time_tolerance=to_duration(10**9))
        return self.got(
            self.client.send_goal_async(goal, lambda told: self.heard.append(told.feedback))
        )

    def end(self) -> None:
        self.controller.close()
        self.relay.close()
        self.served.shutdown()
        self.relay.destroy_node()
        self.close()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    folder = tmp_path_factory.mktemp("relay")
    (folder / "model.yaml").write_text(TEXT)
    (folder / "robot.urdf").write_text(URDF)
    return {
        "model": folder / "model.yaml", "urdf": folder / "robot.urdf", "tool_frame": "cup",
        "controller": CONTROLLER, "limit": LIMIT, "time_limit": 2.0,
    }  # fmt: skip


def options(**given: Any) -> list[str]:
    words = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
    return ["--ros-args", *words]


@pytest.fixture(scope="module")
def cell(files: dict[str, Any]) -> Iterator[Cell]:
    rclpy.init(args=options(**files))
    made = Cell(RelayNode())
    yield made
    made.end()
    rclpy.try_shutdown()


@pytest.fixture(autouse=True)
def fresh(cell: Cell) -> None:
    controller = cell.controller
    controller.goals.clear()
    controller.finish.set()
    controller.accepts = True
    controller.result = Follow.Result(error_code=0, error_string="there")
    cell.heard.clear()


def swing(seconds: float, *, names: Any = ("shoulder", "elbow"), first: float = 0.0) -> Any:
    """Returns a quintic joint motion from rest to rest with velocities and accelerations."""
    made = JointTrajectory(joint_names=list(names))
    for x in np.linspace(first, 1.0, 21).tolist():
        share = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        rate = 30.0 * x * x * (1.0 - x) ** 2 / seconds
        change = 60.0 * x * (1.0 - 3.0 * x + 2.0 * x * x) / seconds**2
        point = JointTrajectoryPoint(
            positions=[1.0 * share, 0.6 * share], velocities=[1.0 * rate, 0.6 * rate],
            accelerations=[1.0 * change, 0.6 * change],
        )  # fmt: skip
        point.time_from_start = to_duration(round(x * seconds * 1e9))
        made.points.append(point)
    return made


def peak(trajectory: Any, files: dict[str, Any]) -> float:
    """Returns the liquid's peak height in the motion that the controller was sent."""
    columns = [
        np.array([getattr(point, name) for point in trajectory.points])
        for name in ("positions", "velocities", "accelerations")
    ]
    t = np.array([1e-9 * to_nanoseconds(p.time_from_start) for p in trajectory.points])
    arm = read_arm(files["urdf"], "cup")
    columns = [one for one in columns if one.ndim == 2 and one.shape[1]]
    motion = arm.motion(t, tuple(trajectory.joint_names), *[*columns, None, None][:3], "sent")
    (found,) = predict(parse_model(TEXT), motion)
    return found.nonlinear.peak


def test_a_slow_motion_passes_as_it_is(cell: Cell, files: dict[str, Any]) -> None:
    cell.controller.finish.clear()
    given = swing(4.0)
    goal = cell.send(given)
    assert goal.accepted
    result = goal.get_result_async()
    cell.until(lambda: bool(cell.heard), "the feedback")
    cell.controller.finish.set()
    done = cell.got(result)
    assert done.status == GoalStatus.STATUS_SUCCEEDED
    assert done.result.error_string == "there"
    assert list(cell.heard[0].actual.positions) == [0.25, 0.5]
    (sent,) = cell.controller.goals
    assert sent.trajectory == given
    assert to_nanoseconds(sent.goal_time_tolerance) == 10**9
    assert peak(given, files) < LIMIT


@pytest.mark.skipif(not optimise.available(), reason="no CasADi (requirements/plan.txt)")
def test_a_fast_motion_gets_new_times_on_its_own_path(cell: Cell, files: dict[str, Any]) -> None:
    given = swing(0.9)
    assert peak(given, files) > 2.0 * LIMIT
    goal = cell.send(given)
    done = cell.got(goal.get_result_async())
    assert done.status == GoalStatus.STATUS_SUCCEEDED, done.result.error_string
    (sent,) = cell.controller.goals
    found = sent.trajectory
    assert found.joint_names == ["shoulder", "elbow"]
    assert list(found.points[0].positions) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert list(found.points[-1].positions) == pytest.approx([1.0, 0.6], abs=1e-4)
    q = np.array([point.positions for point in found.points])
    assert np.abs(q[:, 1] - 0.6 * q[:, 0]).max() < 1e-3  # the same path
    assert peak(found, files) <= LIMIT * 1.001
    assert 0.9 < 1e-9 * to_nanoseconds(found.points[-1].time_from_start) < 4.0


def test_a_cancelled_goal_is_cancelled_at_the_controller(cell: Cell) -> None:
    cell.controller.finish.clear()
    goal = cell.send(swing(4.0))
    result = goal.get_result_async()
    cell.until(lambda: bool(cell.heard), "the controller")
    cell.got(goal.cancel_goal_async())
    done = cell.got(result)
    assert done.status == GoalStatus.STATUS_CANCELED
    assert done.result.error_string == "stopped"


def test_what_the_controller_says_comes_back(cell: Cell) -> None:
    code = Follow.Result.PATH_TOLERANCE_VIOLATED
    cell.controller.result = Follow.Result(error_code=code, error_string="off the path")
    done = cell.got(cell.send(swing(4.0)).get_result_async())
    assert done.status == GoalStatus.STATUS_ABORTED
    assert (done.result.error_code, done.result.error_string) == (code, "off the path")
    cell.controller.accepts = False
    done = cell.got(cell.send(swing(4.0)).get_result_async())
    assert done.status == GoalStatus.STATUS_ABORTED
    assert "rejects the goal" in done.result.error_string


def test_bare_positions_are_sent_with_the_velocities_that_were_judged(cell: Cell) -> None:
    given = swing(4.0)
    for point in given.points:
        point.velocities, point.accelerations = [], []
    done = cell.got(cell.send(given).get_result_async())
    assert done.status == GoalStatus.STATUS_SUCCEEDED
    sent = cell.controller.goals[0].trajectory
    assert [list(one.positions) for one in sent.points] == [
        list(one.positions) for one in given.points
    ]
    wanted = [list(one.velocities) for one in swing(4.0).points]
    assert np.array([one.velocities for one in sent.points]) == pytest.approx(
        np.array(wanted), abs=0.02
    )


def test_one_point_is_reached_from_where_the_joints_stand(cell: Cell) -> None:
    given = JointTrajectory(joint_names=["shoulder", "elbow"])
    point = JointTrajectoryPoint(positions=[0.3, 0.1], time_from_start=to_duration(4 * 10**9))
    given.points = [point]
    done = cell.got(cell.send(given).get_result_async())
    assert "the position of joint 'shoulder' is unknown" in done.result.error_string
    states = cell.publisher(JointState, topics.JOINT_STATES, qos.STREAM_OUT)
    states.publish(JointState(name=["elbow", "shoulder"], position=[0.05, 0.1]))
    cell.until(lambda: "shoulder" in cell.relay._standing, "the joints")
    done = cell.got(cell.send(given).get_result_async())
    assert done.status == GoalStatus.STATUS_SUCCEEDED, done.result.error_string
    (sent,) = cell.controller.goals
    assert list(sent.trajectory.points[0].velocities) == [0.0, 0.0]
    cell.relay._standing.clear()


def changed(**fields: Any) -> JointTrajectory:
    made = swing(4.0)
    for name, value in fields.items():
        setattr(made.points[7], name, value)
    return made


def ahead() -> JointTrajectory:
    made = swing(4.0)
    made.header.stamp = to_time(time.time_ns() - 10**10)
    return made


BAD = {
    "empty": (JointTrajectory(joint_names=["shoulder", "elbow"]), "the goal has no points"),
    "NaN": (changed(positions=[math.nan, 0.0]), "nan"),
    "infinite": (changed(velocities=[math.inf, 0.0]), "inf"),
    "backwards": (changed(time_from_start=to_duration(0)), "comes before"),
    "too few": (changed(positions=[0.1]), "point 7 has 1 positions for 2 joints"),
    "old": (ahead(), "by its stamp it began"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_goal_that_is_none_never_reaches_the_controller(cell: Cell, name: str) -> None:
    given, words = BAD[name]
    done = cell.got(cell.send(given).get_result_async())
    assert done.status == GoalStatus.STATUS_ABORTED
    assert done.result.error_code == Follow.Result.INVALID_GOAL
    assert words in done.result.error_string
    assert "\n" not in done.result.error_string
    assert not cell.controller.goals
    assert cell.relay.faults.total == 0


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("shoulder", "wrist"), "joint 'wrist' is not in the robot's description"),
        (("shoulder", "shoulder"), "appears twice"),
    ],
)
def test_joints_that_are_not_the_robots_are_told(cell: Cell, names: Any, words: str) -> None:
    done = cell.got(cell.send(swing(4.0, names=names)).get_result_async())
    assert done.result.error_code == Follow.Result.INVALID_JOINTS
    assert words in done.result.error_string
    assert not cell.controller.goals


def test_without_new_times_a_fast_motion_is_refused(cell: Cell) -> None:
    rules = cell.relay._rules
    object.__setattr__(rules, "replans", False)
    try:
        done = cell.got(cell.send(swing(0.9)).get_result_async())
    finally:
        object.__setattr__(rules, "replans", True)
    assert done.result.error_code == Follow.Result.INVALID_GOAL
    assert "the goal is refused: the liquid will rise to" in done.result.error_string
    assert not cell.controller.goals


def test_where_control_msgs_is_missing_the_command_that_installs_it_is_told(
    cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> Any:
        raise ImportError(name)

    monkeypatch.setattr(input_subscription, "find_type", missing)
    with pytest.raises(SloshEstimatorError, match="apt install ros-jazzy-control-msgs"):
        RelayNode()
