"""Tests the joint governor over DDS: start position, limits, stops and reported reasons."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from slosh_governor.nodes.governor_node import GovernorNode
from slosh_motion.inputs.robot import available
from slosh_msgs.msg import GovernedMotion
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import WARN
from slosh_plan.errors import SloshPlanError
from slosh_testing.hearing_robot import Graph, SteppedGraph

pytestmark = pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)")
URDF = Path(__file__).resolve().parents[3] / "examples" / "robot.urdf"
NAMES = ["wrist", "rail", "shoulder", "elbow", "jaw"]
START = [0.0, 0.1, 0.3, -0.4, 0.0]
TEXT = """
container: {shape: cylinder, radius: 0.04, fill_height: 0.06}
damping_ratio: auto
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity}]
"""


def as_state(places: list[float]) -> JointState:
    return JointState(name=NAMES, position=places)


def as_trajectory(places: list[float]) -> JointTrajectory:
    return JointTrajectory(joint_names=NAMES, points=[JointTrajectoryPoint(positions=places)])


def as_values(places: list[float]) -> Float64MultiArray:
    return Float64MultiArray(data=[places[1], places[2], places[3], places[0]])


KINDS = {
    "joints": (as_state, topics.DESIRED_JOINTS, topics.SAFE_JOINTS),
    "joint_trajectory": (
        as_trajectory, topics.DESIRED_JOINT_TRAJECTORY, topics.SAFE_JOINT_TRAJECTORY
    ),
    "joint_values": (as_values, topics.DESIRED_JOINT_VALUES, topics.SAFE_JOINT_VALUES),
}  # fmt: skip


class Cell(SteppedGraph):
    """The governor node, with simulated joint states and a client that sends commands."""

    def __init__(self, model: Path, command: str) -> None:
        super().__init__(
            GovernorNode, 0.05, GovernedMotion, topics.GOVERNED_MOTION,
            model=str(model), limit=0.012, rate=20.0, timeout=1.0, command=command,
            starts_at_rest=True, urdf=str(URDF), tool_frame="cup",
        )  # fmt: skip
        self.governor = self.tested
        self.make, desired, safe = KINDS[command]
        kind = type(self.make(START))
        self.safe = self.listen(kind, safe)
        self.commands = self.publisher(kind, desired)
        self.states = self.publisher(JointState, topics.JOINT_STATES)

    def stand(self, places: list[float]) -> None:
        """Publishes the robot's joint states until the governor is ready."""
        goal = [places[1], places[2], places[3], places[0]]
        joints = self.governor._joints
        self.states.publish(as_state(places))
        self.until(lambda: not joints.missing and joints.places == goal, "the robot's place")
        self.step_until(lambda: self.moved and np.allclose(self.moved[-1].joint_position, goal))

    def follow(self, places: list[float], steps: int) -> GovernedMotion:
        for _ in range(steps):
            self.send(self.commands, self.make(places), "command")
            self.step()
        return self.moved[-1]


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    path = tmp_path_factory.mktemp("model") / "model.yaml"
    path.write_text(TEXT)
    rclpy.init()
    yield path
    rclpy.try_shutdown()


@pytest.mark.parametrize("command", list(KINDS))
def test_it_moves_the_joints_of_a_robot_from_where_they_are(model: Path, command: str) -> None:
    cell = Cell(model, command)
    try:
        assert cell.governor._health() == (
            WARN, "no joint states of rail, shoulder, elbow, wrist yet"
        )  # fmt: skip
        cell.stand(START)
        moved = cell.follow([0.0, 0.5, 0.5, -0.4, 0.0], 40)
        assert moved.joint_names == ["rail", "shoulder", "elbow", "wrist"]
        assert list(moved.target) == [0.5, 0.5, -0.4, 0.0]
        assert moved.joint_position[0] > 0.2
        assert moved.joint_position[1] > 0.35
        assert all(one.safe and one.peak <= 0.012 for one in cell.moved)
        cell.until(lambda: len(cell.safe) >= len(cell.moved))
        assert _places(cell.safe[-1])[0] == pytest.approx(moved.joint_position[0], abs=0.1)
        stops = cell.listen(JointTrajectory, topics.STOP_JOINT_TRAJECTORY, qos.EVENT)
        assert cell.call(Trigger, topics.EMERGENCY_STOP, Trigger.Request()).success
        cell.until(lambda: stops)
        assert list(stops[0].points[-1].velocities) == [0.0] * 4
        cell.step_until(lambda: cell.moved[-1].state == GovernedMotion.RESTING)
        # Others move the robot: it goes on from there, and nothing jumps back.
        cell.stand([0.0, -0.3, 0.0, 0.0, 0.0])
        assert cell.moved[-1].steps == 0
    finally:
        cell.close()


class CarriedCell(SteppedGraph):
    """The governor node of a container that a robot carries, with joint states and commands."""

    def __init__(self, model: Path) -> None:
        super().__init__(
            GovernorNode, 0.05, GovernedMotion, topics.GOVERNED_MOTION,
            model=str(model), limit=0.012, rate=20.0, timeout=1.0, urdf=str(URDF),
            starts_at_rest=True, tool_frame="cup",
        )  # fmt: skip
        self.governor = self.tested
        self.commands = self.publisher(TwistStamped, topics.DESIRED_TWIST)
        self.states = self.publisher(JointState, topics.JOINT_STATES)

    def follow(self, x: float, until: Callable[[], bool], places: list[float] | None) -> None:
        """Makes steps with a command, and with joint states as it has them, until it is so."""
        message = TwistStamped()
        message.twist.linear.x = x
        for _ in range(1000):
            if until():
                return
            self.send(self.commands, message, "command")
            if places:
                self.stand(list(self.moved[-1].joint_position) if self.moved else places)
            self.step()
        pytest.fail("what was awaited did not come")

    def stand(self, places: list[float]) -> None:
        """Publishes positions of rail, shoulder, elbow and wrist."""
        self.states.publish(as_state([places[3], *places[:3], 0.0]))
        joints = self.governor._joints
        self.until(lambda: not joints.missing and joints.places == places, "the robot's place")


@pytest.mark.long
def test_a_robot_that_carries_the_container_keeps_its_joint_limits(model: Path) -> None:
    cell, start = CarriedCell(model), [0.1, 0.5, -1.1, 0.0]
    try:
        cell.states.publish(as_state([math.nan, *start[:3], 0.0]))
        wait = "no joint states of rail, shoulder, elbow, wrist yet"
        assert cell.governor._health() == (WARN, wait)
        cell.until(lambda: cell.governor._health()[1].endswith("'wrist' is nan"))
        cell.stand([*start[:3], 0.5])
        cell.go_on()
        cell.until(lambda: "tilted by 28.6°" in cell.governor._health()[1])
        # As far as the arm reaches, and no further.
        cell.follow(0.3, lambda: len(cell.moved) > 150, start)
        moved = cell.moved[-1]
        assert moved.joint_names == ["rail", "shoulder", "elbow", "wrist"]
        assert abs(moved.velocity[0]) < 0.05
        assert moved.refused_by.split(": ")[0] in moved.joint_names
        assert moved.refused_by in cell.governor._health()[1]
        assert max(one.velocity[0] for one in cell.moved) > 0.1
        assert all(one.safe for one in cell.moved)
        stops = cell.listen(JointTrajectory, topics.STOP_JOINT_TRAJECTORY, qos.EVENT)
        cell.follow(-0.3, lambda: cell.moved[-1].velocity[0] < -0.15, start)
        assert cell.call(Trigger, topics.EMERGENCY_STOP, Trigger.Request()).success
        cell.follow(-0.3, lambda: cell.moved[-1].state == GovernedMotion.RESTING, start)
        cell.until(lambda: stops)
        assert list(stops[0].points[-1].velocities) == [0.0] * 4
        assert cell.call(Trigger, topics.RELEASE_STOP, Trigger.Request()).success
        count = len(cell.moved) + 20
        cell.follow(-0.02, lambda: len(cell.moved) > count, start)
        # Without joint states it stops, and says so.
        cell.follow(-0.02, lambda: cell.moved[-1].reason == GovernedMotion.JOINTS, None)
        assert "no joint states of 'rail' for" in cell.governor._health()[1]
        cell.follow(-0.1, lambda: cell.moved[-1].velocity[0] < -0.05, start)
    finally:
        cell.close()


def _places(message: Any) -> list[float]:
    if isinstance(message, JointTrajectory):
        return list(message.points[0].positions)
    return list(message.data if isinstance(message, Float64MultiArray) else message.position)


def test_a_robot_without_a_description_is_named(model: Path) -> None:
    graph = Graph()
    with pytest.raises(SloshPlanError, match="command = joints needs the robot's description"):
        graph.with_parameters(GovernorNode, model=str(model), command="joints")
    graph.close()
