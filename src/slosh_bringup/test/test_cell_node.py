"""Tests the simulated cell over DDS against what a robot and a camera driver would publish."""

import json
import time

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import AccelStamped, PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, Imu
from std_msgs.msg import String

from slosh_bringup.cell.motion_source import load_motion
from slosh_bringup.nodes.cell_node import CellNode
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_camera.images.decoding import decode_compressed
from slosh_model.constants import GRAVITY
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_msgs.msg import FreeSurface, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds

PATIENCE = 30.0
KINDS = {
    topics.ACCEL: AccelStamped,
    topics.IMU: Imu,
    topics.POSE: PoseStamped,
    topics.IMAGE: Image,
    topics.IMAGE_COMPRESSED: CompressedImage,
    topics.CAMERA_INFO: CameraInfo,
    topics.TRUTH: FreeSurface,
}
TILT = 0.1
FPS, IMAGES = 20.0, 21
"""Of one second: slow enough for a machine that draws, sends and reads in one process."""


def stamps(messages):
    return np.array([to_nanoseconds(message.header.stamp) for message in messages])


def all_came(got, summary):
    """Returns whether all published messages have been received."""
    published = json.loads(summary.data)["published"]
    return all(len(got[topic]) >= published.get(f"/{topic}", 0) for topic in KINDS)


def play(**parameters):
    """Runs the cell node to its end; returns the messages by topic, and the node's summary."""
    words = ["--ros-args"]
    for name, value in parameters.items():
        words += ["-p", f"{name}:={value}"]
    rclpy.init(args=words)
    nodes = []
    try:
        probe = Node("probe")
        nodes.append(probe)
        got = {topic: [] for topic in KINDS}
        summaries = []
        for topic, kind in KINDS.items():
            probe.create_subscription(kind, topic, got[topic].append, qos.STREAM_OUT)
        # The cell waits until the nodes that answer have readers, too.
        probe.create_subscription(SloshEstimate, topics.ESTIMATE, print, qos.STREAM_IN)
        probe.create_subscription(FreeSurface, topics.FREE_SURFACE, print, qos.STREAM_IN)
        probe.create_subscription(String, topics.SUMMARY, summaries.append, qos.EVENT)
        cell = CellNode()
        nodes.append(cell)
        executor = SingleThreadedExecutor()
        executor.add_node(probe)
        executor.add_node(cell)
        deadline = time.monotonic() + PATIENCE
        while not (cell.finished and summaries and all_came(got, summaries[0])):
            # What is lost is the tests' to tell; a cell that does not end is told here.
            if time.monotonic() > deadline:
                assert cell.finished, "the cell does not end"
                assert summaries, "no summary came"
                break
            executor.spin_once(timeout_sec=0.05)
        cell.close()
        return got, json.loads(summaries[0].data)
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Motion table of half a second in which a tilted container is pushed."""
    t = np.arange(501) / 1000.0
    push = np.stack((np.sin(2 * np.pi * t), 0.0 * t, 0.0 * t), axis=1)
    turn = np.tile(Rotation.from_euler("x", TILT).as_quat(), (len(t), 1))
    path = tmp_path_factory.mktemp("cell") / "push.csv"
    write_motion_table(path, MotionTable(t, push, turn, np.tile((0.0, 0.0, 0.5), (501, 1))))
    return path


@pytest.fixture(scope="module")
def played(table):
    given = {"acceleration_noise": 0.0, "image_noise": 0.0, "repeat": 2, "fps": FPS}
    return play(motion=table, readers=1, **given)


def test_nothing_is_lost_and_the_summary_counts_it(played):
    got, summary = played
    expected = {
        topics.ACCEL: 1002,
        topics.IMU: 201,
        topics.POSE: 201,
        topics.IMAGE: IMAGES,
        topics.IMAGE_COMPRESSED: IMAGES,
        topics.CAMERA_INFO: IMAGES,
        topics.TRUTH: IMAGES,
    }
    assert {topic: len(messages) for topic, messages in got.items()} == expected
    published = {f"/{topic}": count for topic, count in expected.items()}
    assert summary == {"motion": "push.csv", "published": {**published, "/cell/summary": 1}}


def test_stamps_lie_on_the_grid_of_one_clock(played):
    got, _ = played
    accel, imu, pose = (stamps(got[topic]) for topic in (topics.ACCEL, topics.IMU, topics.POSE))
    assert (np.diff(accel) == 1_000_000).all()
    assert np.array_equal(imu, accel[::5])
    assert np.array_equal(imu, pose)
    images = stamps(got[topics.IMAGE])
    assert images[0] == accel[0]
    assert np.abs(images - images[0] - np.arange(IMAGES) * 1e9 / FPS).max() <= 1
    for topic in (topics.IMAGE_COMPRESSED, topics.CAMERA_INFO, topics.TRUTH):
        assert np.array_equal(stamps(got[topic]), images)


def test_readings_are_the_motions(played, table):
    got, _ = played
    motion = load_motion(str(table)).repeated(2)
    accel = [message.accel.linear for message in got[topics.ACCEL]]
    assert {message.header.frame_id for message in got[topics.ACCEL]} == {"world"}
    assert np.array([(a.x, a.y, a.z) for a in accel]) == pytest.approx(motion.acceleration)
    first = got[topics.IMU][0]
    force, turning = first.linear_acceleration, first.angular_velocity
    felt = (0.0, GRAVITY * np.sin(TILT), GRAVITY * np.cos(TILT))
    assert (force.x, force.y, force.z) == pytest.approx(felt)
    assert (turning.x, turning.y, turning.z) == pytest.approx((0.0, 0.0, 0.5))
    assert first.orientation_covariance[0] == -1.0
    pose = got[topics.POSE][-1].pose
    last = motion.position[1000]
    assert (pose.position.x, pose.position.y) == pytest.approx((last[0], last[1]))
    assert pose.orientation.x == pytest.approx(np.sin(TILT / 2.0))


def test_images_come_raw_and_compressed_with_their_calibration(played):
    got, _ = played
    raw, jpeg = got[topics.IMAGE][IMAGES // 2], got[topics.IMAGE_COMPRESSED][IMAGES // 2]
    assert (raw.encoding, raw.height, raw.width, raw.step) == ("mono8", 480, 640, 640)
    pixels = np.frombuffer(raw.data, np.uint8).reshape(480, 640)
    decoded = decode_compressed(jpeg.format, bytes(jpeg.data))
    assert np.abs(decoded.astype(int) - pixels).mean() < 1.0
    info = got[topics.CAMERA_INFO][IMAGES // 2]
    camera = read_calibration(config_folder() / "camera.yaml").view.camera
    assert np.array_equal(np.reshape(info.k, (3, 3)), camera.matrix)
    frames = {message.header.frame_id for message in (raw, jpeg, info)}
    assert frames == {"camera_optical"}
