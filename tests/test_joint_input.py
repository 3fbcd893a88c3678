"""Tests a robot that publishes only its joints: estimated live, recorded and replayed."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import rclpy
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_model.model_text import parse_model
from slosh_model.simulate import Inputs, simulate
from slosh_motion.inputs.robot import available
from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import HearingRobot
from slosh_testing.joint_driver import JOINTS, RAIL_URDF, acceleration, swung
from slosh_testing.journaled import assert_same_by_journal, replayed_by_journal

pytestmark = [
    pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)"),
    pytest.mark.timeout(200),
]
TEXT = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity, alpha: 0.58}]
"""


class Driver(HearingRobot):
    """ROS node that publishes the joints of arm, rail and gripper and collects estimates."""

    def __init__(self) -> None:
        super().__init__("driver")
        self._describe = self.node.create_publisher(String, topics.ROBOT_DESCRIPTION, qos.EVENT)
        self.states = [
            self.node.create_publisher(JointState, topics.JOINT_STATES, qos.STREAM_OUT)
            for _ in range(2)
        ]

    def describe(self) -> None:
        self._describe.publish(String(data=RAIL_URDF))

    def play(self, times: np.ndarray) -> int:
        """Publishes the joints at times [s] from now on; returns the start time [ns]."""
        begin = time.time_ns()
        for k, t in enumerate(times.tolist()):
            stamp_ns = begin + round(t * 1e9)
            stamp = to_time(stamp_ns)
            rail, *arm = swung(t).tolist()
            message = JointState(name=["jaw", *JOINTS[:0:-1]], position=[0.01, *arm[::-1]])
            message.header.stamp = stamp
            self.states[0].publish(message)
            if k % 2 == 0:
                message = JointState(name=["rail"], position=[rail])
                message.header.stamp = stamp
                self.states[1].publish(message)
            self.pace(k, stamp_ns)
        self.finish(begin + round(times[-1] * 1e9))
        return begin


@contextmanager
def cell(folder: Path, domain: int, *others: NodeProcess, **own: str) -> Iterator[Driver]:
    """Runs an estimator with the input `joints`, and the simulated robot."""
    (folder / "model.yaml").write_text(TEXT)
    given = {
        "model": str(folder / "model.yaml"), "input": "joints", "tool_frame": "cup",
        "max_age": "600.0", **own,
    }  # fmt: skip
    rclpy.init()
    driver = Driver()
    try:
        with NodeGroup("/slosh", folder / "logs", node_environment(domain)) as group:
            for process in (NodeProcess("estimator", (), given), *others):
                group.start(process)
            yield driver
    finally:
        driver.close()
        rclpy.shutdown()


def truth(t: np.ndarray) -> np.ndarray:
    """Returns the wave height [m] that the true acceleration causes."""
    fine = np.arange(t[0], t[-1], 0.001)
    response, _ = simulate(parse_model(TEXT), Inputs(fine, acceleration(fine)))
    return np.interp(t, fine, response.msh)


def test_joints_of_two_drivers_live_and_replayed(tmp_path: Path, domain: int) -> None:
    bag = tmp_path / "bag"
    recorder = NodeProcess("recorder", (), {"output": str(bag)})
    with cell(tmp_path, domain, recorder) as driver:
        waiting = "not ready, waiting: no robot description on /robot_description yet"
        driver.until(
            lambda: waiting in driver.health.get("estimator", ("",))[0], "the node to wait"
        )
        driver.describe()
        driver.await_ready("estimator", "recorder")
        driver.until(
            lambda: all(one.get_subscription_count() >= 2 for one in driver.states), "two readers"
        )
        times = np.arange(-0.5, 2.8, 0.004)
        begin = driver.play(times)
        facts = driver.health["estimator"][1]
    assert facts["joints"] == "rail, shoulder, elbow, wrist"
    t = np.array([(to_nanoseconds(one.header.stamp) - begin) * 1e-9 for one in driver.estimates])
    msh, true = np.array([one.nonlinear.msh for one in driver.estimates]), truth(t)
    assert true.max() > 0.005
    assert np.sqrt(np.mean((msh - true) ** 2)) < 0.02 * true.max()
    assert not any(one.flags for one in driver.estimates[len(t) // 2 :])
    assert_same_by_journal(bag)
    result = replayed_by_journal(bag)
    assert result.verification is not None
    assert result.verification.exact
    assert result.counters["samples_used"] > 350


def test_a_joint_that_nobody_publishes_is_told(tmp_path: Path, domain: int) -> None:
    (tmp_path / "robot.urdf").write_text(RAIL_URDF)
    with cell(tmp_path, domain, urdf=str(tmp_path / "robot.urdf")) as driver:
        driver.until(lambda: driver.states[0].get_subscription_count(), "a reader")

        def told() -> bool:
            message = JointState(name=["rail", "elbow"], position=[0.0, 0.1])
            message.header.stamp = to_time(time.time_ns())
            driver.states[0].publish(message)
            return (
                "the joint states lack shoulder, wrist" in driver.health.get("estimator", " ")[0]
            )

        driver.until(told, "what is missing")


def test_two_publishers_of_the_same_joints_are_told(tmp_path: Path, domain: int) -> None:
    (tmp_path / "robot.urdf").write_text(RAIL_URDF)
    with cell(tmp_path, domain, urdf=str(tmp_path / "robot.urdf")) as driver:
        driver.until(
            lambda: all(one.get_subscription_count() for one in driver.states), "a reader"
        )

        def told() -> bool:
            now = time.time_ns()
            for late, publisher in enumerate(driver.states):
                message = JointState(name=list(JOINTS), position=[0.0, 0.1, 0.2, 0.3])
                message.header.stamp = to_time(now - 30_000_000 * late)
                publisher.publish(message)
            said = driver.health.get("estimator", " ")[0]
            return "2 publishers on /joint_states for 1 set of joints: stop one" in said

        driver.until(told, "the second publisher")


def test_estimates_of_two_publishers_one_late_are_contested(tmp_path: Path, domain: int) -> None:
    """Tests the flag within the first motion, and that it lasts as long as both publish."""
    (tmp_path / "robot.urdf").write_text(RAIL_URDF)
    with cell(tmp_path, domain, urdf=str(tmp_path / "robot.urdf")) as driver:
        driver.await_ready("estimator")
        driver.until(
            lambda: all(one.get_subscription_count() for one in driver.states), "a reader"
        )
        times, late = np.arange(-0.5, 2.8, 0.01), 0.02
        begin = time.time_ns()
        for k, t in enumerate(times.tolist()):
            for publisher, at, after in ((0, t, 0.0), (1, t - late, 0.003)):
                if publisher and k % 2:
                    continue
                message = JointState(name=list(JOINTS), position=swung(at).tolist())
                message.header.stamp = to_time(begin + round((t + after) * 1e9))
                driver.states[publisher].publish(message)
            driver.pace(k, begin + round(t * 1e9))
        contested = [bool(one.flags & SloshEstimate.INPUT_CONTESTED) for one in driver.estimates]
        stamps = [(to_nanoseconds(one.header.stamp) - begin) * 1e-9 for one in driver.estimates]
        assert any(contested)
        first = stamps[contested.index(True)]
        moves = next(t for t in times.tolist() if np.abs(swung(t) - swung(-0.5)).max() > 1e-3)
        assert first < moves + 1.0
        assert all(contested[contested.index(True) :])
