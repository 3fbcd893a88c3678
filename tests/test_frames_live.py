"""Tests inputs in a robot's frames, live and replayed: transforms, mountings, odometry."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import AccelStamped, PoseStamped, TransformStamped
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu

from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import HearingRobot
from slosh_testing.joint_driver import acceleration, cup_position, quaternion, swung
from slosh_testing.journaled import assert_same_by_journal, replayed_by_journal

pytestmark = pytest.mark.timeout(200)
TEXT = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n"
TIMES = np.arange(-0.5, 2.6, 0.005)


class Robot(HearingRobot):
    """ROS node that publishes a robot's topics and collects the estimates."""

    def play(self, kind: type, topic: str, made: Callable[[float, Any], Any]) -> np.ndarray:
        """Publishes messages of a motion; returns times [s] and accelerations of the estimates."""
        publisher = self.node.create_publisher(kind, topic, qos.STREAM_OUT)
        self.until(lambda: publisher.get_subscription_count() >= 2, "two readers")
        begin = time.time_ns()
        for k, t in enumerate(TIMES.tolist()):
            stamp_ns = begin + round(t * 1e9)
            publisher.publish(made(t, to_time(stamp_ns)))
            self.pace(k, stamp_ns)
        self.finish(begin + round(TIMES[-1] * 1e9))
        return np.array(
            [
                ((to_nanoseconds(one.header.stamp) - begin) * 1e-9, *one.acceleration)
                for one in self.estimates
            ]
        )


@contextmanager
def cell(folder: Path, domain: int, **own: str) -> Iterator[Robot]:
    """Runs an estimator, a recorder and the simulated robot."""
    (folder / "model.yaml").write_text(TEXT)
    given = {"model": str(folder / "model.yaml"), "max_age": "600.0", **own}
    recorder = NodeProcess("recorder", (), {"output": str(folder / "bag")})
    rclpy.init()
    robot = Robot()
    try:
        with NodeGroup("/slosh", folder / "logs", node_environment(domain)) as group:
            for process in (NodeProcess("estimator", (), given), recorder):
                group.start(process)
            robot.await_ready("estimator", "recorder")
            yield robot
    finally:
        robot.close()
        rclpy.shutdown()


def check(found: np.ndarray, folder: Path, share: float = 0.02) -> None:
    """Checks that the acceleration is right, and that the recording replays identically."""
    true = acceleration(found[:, 0])
    # Who subscribes to transforms late hears the motion from there on.
    assert len(found) > 0.6 * len(TIMES)
    assert np.abs(found[:, 1:] - true).max() < share * np.abs(true).max()
    assert_same_by_journal(folder / "bag")
    verification = replayed_by_journal(folder / "bag").verification
    assert verification is not None
    assert verification.exact, verification.lines()


def link(parent: str, child: str, place: Any, turn: Any, stamp: Any = None) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    message.header.stamp = stamp or message.header.stamp
    p, q = message.transform.translation, message.transform.rotation
    p.x, p.y, p.z = map(float, place)
    q.x, q.y, q.z, q.w = map(float, turn)
    return message


def fixed(robot: Robot, *links: TransformStamped) -> None:
    """Publishes fixed transforms."""
    kind = pytest.importorskip("tf2_msgs.msg").TFMessage
    publisher = robot.node.create_publisher(kind, topics.TF_STATIC, qos.EVENT)
    publisher.publish(kind(transforms=list(links)))


STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def test_a_chain_of_transforms(tmp_path: Path, domain: int) -> None:
    kind = pytest.importorskip("tf2_msgs.msg").TFMessage
    with cell(tmp_path, domain, input="tf") as robot:
        fixed(robot, link("tool", "container", (0.0, 0.0, 0.1), STRAIGHT))

        def made(t: float, stamp: Any) -> Any:
            rail, *angles = swung(t).tolist()
            x, y, z = cup_position(0.0, *angles).tolist()
            tool = link("carriage", "tool", (x, y, z - 0.1), quaternion(*angles), stamp)
            return kind(
                transforms=[link("world", "carriage", (0.0, rail, 0.0), STRAIGHT, stamp), tool]
            )

        found = robot.play(kind, topics.TF, made)
    check(found, tmp_path)


def test_an_imu_is_mounted_as_the_fixed_transforms_say(tmp_path: Path, domain: int) -> None:
    pytest.importorskip("tf2_msgs")
    with cell(tmp_path, domain, input="imu") as robot:
        fixed(robot, link("container", "imu_link", (0.0, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0)))

        def made(t: float, stamp: Any) -> Any:
            message = Imu()
            message.header.stamp, message.header.frame_id = stamp, "imu_link"
            x, y, z = acceleration(t).tolist()
            force = message.linear_acceleration
            force.x, force.y, force.z = x, -y, -z - 9.81  # upside down
            return message

        found = robot.play(Imu, topics.IMU, made)
    check(found, tmp_path)


def test_poses_in_a_frame_that_moves(tmp_path: Path, domain: int) -> None:
    """The tracker rides on the carriage, whose own motion counts."""
    kind = pytest.importorskip("tf2_msgs.msg").TFMessage
    with cell(tmp_path, domain, input="pose") as robot:
        transforms = robot.node.create_publisher(kind, topics.TF, qos.STREAM_OUT)

        def made(t: float, stamp: Any) -> Any:
            rail, *angles = swung(t).tolist()
            carriage = link("world", "carriage", (0.0, rail, 0.0), STRAIGHT, stamp)
            transforms.publish(kind(transforms=[carriage]))
            message = PoseStamped()
            message.header.stamp, message.header.frame_id = stamp, "carriage"
            p, q = message.pose.position, message.pose.orientation
            p.x, p.y, p.z = cup_position(0.0, *angles).tolist()
            q.x, q.y, q.z, q.w = quaternion(*angles)
            return message

        found = robot.play(PoseStamped, topics.POSE, made)
    check(found, tmp_path)


ARM = np.array([0.1, -0.05, 0.08])
"""From the container to an accelerometer beside it, in the container's axes [m]."""
TURNED = Rotation.from_euler("xyz", [np.pi, 0.0, 0.5])


def sensor_acceleration(t: float) -> Any:
    """Returns the accelerometer's acceleration in its own axes [m/s²]."""
    step = 1e-4

    def attitude(moment: float) -> Rotation:
        return Rotation.from_quat(quaternion(*swung(moment)[1:]))

    def place(moment: float) -> Any:
        return cup_position(*swung(moment)) + attitude(moment).apply(ARM)

    change = (place(t - step) - 2.0 * place(t) + place(t + step)) / step**2
    return (attitude(t) * TURNED).inv().apply(change)


def test_an_accelerometer_beside_the_container(tmp_path: Path, domain: int) -> None:
    """Its rotation and lever arm come out of transforms, at another rate than its own."""
    kind = pytest.importorskip("tf2_msgs.msg").TFMessage
    with cell(tmp_path, domain, input="accel") as robot:
        fixed(
            robot,
            link("tool", "container", (0.0, 0.0, 0.1), STRAIGHT),
            link("container", "sensor", ARM, TURNED.as_quat()),
        )
        transforms = robot.node.create_publisher(kind, topics.TF, qos.STREAM_OUT)
        sent = [0]

        def made(t: float, stamp: Any) -> Any:
            rail, *angles = swung(t).tolist()
            turn = quaternion(*angles)
            x, y, z = cup_position(rail, *angles) - Rotation.from_quat(turn).apply([0, 0, 0.1])
            if sent[0] % 2 == 0:
                tool = link("world", "tool", (x, y, z), turn, stamp)
                transforms.publish(kind(transforms=[tool]))
            sent[0] += 1
            message = AccelStamped()
            message.header.stamp, message.header.frame_id = stamp, "sensor"
            a = message.accel.linear
            a.x, a.y, a.z = sensor_acceleration(t).tolist()
            return message

        found = robot.play(AccelStamped, topics.ACCEL, made)
    check(found, tmp_path, share=0.05)


@pytest.mark.parametrize("part", [pytest.param("twist", marks=pytest.mark.long), "pose"])
def test_odometry(tmp_path: Path, domain: int, part: str) -> None:
    with cell(tmp_path, domain, input="odometry", odometry=part) as robot:

        def made(t: float, stamp: Any) -> Any:
            message = Odometry()
            message.header.stamp, message.child_frame_id = stamp, "base_link"
            yaw = [float(swung(t + k * 1e-5)[1:3].sum()) for k in (-1, 0, 1)]
            before, after = (cup_position(*swung(t + k * 1e-5)) for k in (-1, 1))
            vx, vy, _ = ((after - before) / 2e-5).tolist()
            c, s = float(np.cos(yaw[1])), float(np.sin(yaw[1]))
            if part == "twist":
                twist = message.twist.twist
                twist.linear.x, twist.linear.y = c * vx + s * vy, c * vy - s * vx
                twist.angular.z = (yaw[2] - yaw[0]) / 2e-5
            else:  # which is never filled
                place = message.pose.pose.position
                place.x, place.y, place.z = cup_position(*swung(t)).tolist()
            turn = message.pose.pose.orientation
            turn.z, turn.w = float(np.sin(yaw[1] / 2)), float(np.cos(yaw[1] / 2))
            return message

        found = robot.play(Odometry, topics.ODOMETRY, made)
    check(found, tmp_path)
