"""Tests that an input which another source contradicts is named within one motion."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import rclpy
from sensor_msgs.msg import Imu, JointState

from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_motion.inputs.robot import available
from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_time
from slosh_testing.hearing_robot import HearingRobot
from slosh_testing.joint_driver import JOINTS, RAIL_URDF, felt_on_cup, swung
from slosh_testing.journaled import assert_same_by_journal, replayed_by_journal

pytestmark = [
    pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)"),
    pytest.mark.timeout(200),
]
TEXT = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n"
QUARTER = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Sensor <- container: gravity does not tell it from upright."""
CONTRADICTED = SloshEstimate.INPUT_CONTRADICTED


class Arm(HearingRobot):
    """Publishes the joints of an arm, and a sensor on its cup."""

    def __init__(self) -> None:
        super().__init__("arm")
        self.played_ns = 0
        self.joints = self.node.create_publisher(JointState, topics.JOINT_STATES, qos.STREAM_OUT)
        self.imu = self.node.create_publisher(Imu, topics.IMU, qos.STREAM_OUT)

    def play(self, rotation: np.ndarray, gain: float = 1.0) -> None:
        """Publishes joints and sensor of a motion from rest to rest."""
        times = np.arange(-0.7, 4.0, 0.005)
        force, rate = (values @ rotation.T for values in felt_on_cup(times))
        begin = (self.played_ns or time.time_ns()) - round(times[0] * 1e9)
        for k, t in enumerate(times.tolist()):
            stamp_ns = begin + round(t * 1e9)
            state = JointState(name=list(JOINTS), position=swung(t).tolist())
            reading = Imu()
            a, w = reading.linear_acceleration, reading.angular_velocity
            a.x, a.y, a.z = (gain * force[k]).tolist()
            w.x, w.y, w.z = rate[k].tolist()
            state.header.stamp = reading.header.stamp = to_time(stamp_ns)
            self.joints.publish(state)
            self.imu.publish(reading)
            self.pace(k, stamp_ns)
        self.played_ns = stamp_ns + 5_000_000

    def says(self, text: str) -> bool:
        return text in self.health.get("estimator", ("",))[0]

    def compares(self, text: str) -> bool:
        return text in self.fact("estimator", "second source")


@contextmanager
def cell(folder: Path, domain: int, *others: NodeProcess, **own: str) -> Iterator[Arm]:
    """Runs an estimator that receives joints and sensor."""
    (folder / "model.yaml").write_text(TEXT)
    (folder / "robot.urdf").write_text(RAIL_URDF)
    given: Mapping[str, str] = {
        "model": str(folder / "model.yaml"), "urdf": str(folder / "robot.urdf"),
        "tool_frame": "cup", "max_age": "600.0", **own,
    }  # fmt: skip
    rclpy.init()
    arm = Arm()
    try:
        with NodeGroup("/slosh", folder / "logs", node_environment(domain)) as group:
            for process in (NodeProcess("estimator", (), given), *others):
                group.start(process)
            arm.until(lambda: arm.compares("no common motion yet"), "both to be heard")
            yield arm
    finally:
        arm.close()
        rclpy.shutdown()


def test_a_sensor_turned_about_the_vertical_is_named_after_one_motion(
    tmp_path: Path, domain: int
) -> None:
    bag = tmp_path / "bag"
    recorder = NodeProcess("recorder", (), {"output": str(bag)})
    with cell(tmp_path, domain, recorder, input="imu") as arm:
        arm.await_ready("estimator", "recorder")
        arm.until(lambda: arm.imu.get_subscription_count() >= 2, "the recorder")
        arm.play(QUARTER)
        arm.until(lambda: arm.says("imu against joints: its x, y, z point along"), "the reason")
        assert "the container's +y, -x, +z" in arm.health["estimator"][0]
        assert "set sensor_rotation to [0.0000, 0.0000, 1.5708]" in arm.health["estimator"][0]
        assert not arm.estimates[-100].flags & CONTRADICTED
        arm.play(QUARTER)
        assert arm.estimates[-1].flags & CONTRADICTED, (
            arm.health,
            [
                (k, e.flags)
                for k, e in enumerate(arm.estimates)
                if k and e.flags != arm.estimates[k - 1].flags
            ],
        )
    assert_same_by_journal(bag)
    result = replayed_by_journal(bag)
    assert result.verification is not None
    assert result.verification.exact


def test_the_remedy_is_right(tmp_path: Path, domain: int) -> None:
    with cell(tmp_path, domain, input="imu", sensor_rotation="[0.0, 0.0, 1.5708]") as arm:
        arm.play(QUARTER)
        arm.until(lambda: arm.compares("imu against joints: right, motions: 1"), "the comparison")
        arm.play(QUARTER)
        assert not any(one.flags & CONTRADICTED for one in arm.estimates)


@pytest.mark.long
def test_a_sensor_beside_the_joints_that_drive_is_told_without_a_flag(
    tmp_path: Path, domain: int
) -> None:
    with cell(tmp_path, domain, input="joints") as arm:
        arm.play(np.eye(3), 1.0 / 9.81)
        arm.until(lambda: arm.says("imu against joints: it is in g: publish m/s²"), "the unit")
        assert not any(one.flags & CONTRADICTED for one in arm.estimates)


@pytest.mark.long
def test_nothing_is_compared_where_nobody_wants_it(tmp_path: Path, domain: int) -> None:
    (tmp_path / "model.yaml").write_text(TEXT)
    rclpy.init()
    arm = Arm()
    own = {"model": str(tmp_path / "model.yaml"), "input": "imu", "second_source": "none"}
    try:
        with NodeGroup("/slosh", tmp_path / "logs", node_environment(domain)) as group:
            group.start(NodeProcess("estimator", (), {**own, "max_age": "600.0"}))
            arm.until(arm.imu.get_subscription_count, "the estimator")
            arm.play(QUARTER)
            assert arm.joints.get_subscription_count() == 0
            assert not any(one.flags & CONTRADICTED for one in arm.estimates)
    finally:
        arm.close()
        rclpy.shutdown()
