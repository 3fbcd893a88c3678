"""Tests messages with wrong stamps, types, QoS or content: reported, without harm."""

import os
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, Imu

from slosh_base.files.plain_text import LONGEST
from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.processes import (
    NodeGroup,
    NodeProcess,
    config_folder,
    node_environment,
)
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_msgs.srv import LoadModel
from slosh_msgs_py import qos, topics
from slosh_testing.robot import MODEL, RobotNode, nodes_and_robot
from validation.long_runs.long_cell import resident

OK, BLIND = 0, 4
WARN, ERROR, STALE = 1, 2, 3
WELL_AGAIN = 15.0
"""On a busy machine; it takes two or three [s]."""
GROWTH = 30.0
"""What a flood may cost for good [MB]."""
pytestmark = pytest.mark.timeout(200)
LONG = pytest.mark.long


@pytest.fixture(scope="module")
def cell(
    tmp_path_factory: pytest.TempPathFactory, domain: int
) -> Iterator[tuple[NodeGroup, RobotNode]]:
    """Runs estimator, monitor, and a robot whose liquid is at rest."""
    with nodes_and_robot(tmp_path_factory.mktemp("cell"), domain) as made:
        yield made


@pytest.fixture
def robot(cell: tuple[NodeGroup, RobotNode]) -> RobotNode:
    """Returns the robot after its nodes have reported no fault."""
    wait_until_well(cell[1])
    return cell[1]


def wait_until_well(robot: RobotNode) -> None:
    """Waits until estimator and monitor report no fault."""
    robot.until(
        lambda: robot.comparisons[-1].state == OK and robot.health["estimator"][0] == OK,
        "the state OK",
    )


@contextmanager
def stranger(domain: int) -> Iterator[Node]:
    """Yields a node in a DDS context of its own, as one context allows a topic one type."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node("stranger", namespace="/slosh", context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("shift", "reason"),
    [
        (3.4e8, "are stamped in the future by more than max_age"),
        pytest.param(1.0, "are stamped in the future by more than max_age", marks=LONG),
        (-1.0, "are stale: their stamps are older than max_age"),
        pytest.param(-1e9, "are stale: their stamps are older than max_age", marks=LONG),
    ],
)
def test_accelerations_of_another_time_are_dropped_and_told(
    robot: RobotNode, shift: float, reason: str
) -> None:
    robot.shift = shift
    robot.until(lambda: reason in robot.health["estimator"][1], reason)
    assert robot.health["estimator"][0] == STALE
    robot.until(lambda: robot.comparisons[-1].estimate_stale, "the monitor's word")
    assert robot.comparisons[-1].state != OK
    robot.shift, since = 0.0, time.monotonic()
    wait_until_well(robot)
    assert time.monotonic() - since < WELL_AGAIN


@pytest.mark.long
def test_a_topic_in_another_type_is_told(robot: RobotNode, domain: int) -> None:
    with stranger(domain) as other:
        for topic in (topics.ACCEL, topics.FREE_SURFACE):
            other.create_publisher(Imu, topic, qos.STREAM_OUT)
        said = "is also published as sensor_msgs/msg/Imu, which is not received"

        def told() -> bool:
            return all(said in robot.health[name][1] for name in ("estimator", "monitor"))

        robot.until(told, said, speak=False)
        assert robot.health["estimator"][0] == robot.health["monitor"][0] == STALE
        wait_until_well(robot)


@pytest.mark.long
def test_a_flood_of_models_is_outlived(
    cell: tuple[NodeGroup, RobotNode], robot: RobotNode
) -> None:
    pid = cell[0].pid("estimator")
    client = robot.node.create_client(LoadModel, topics.LOAD_MODEL)
    robot.until(client.service_is_ready, "the service")
    before = resident(pid)
    for text, taken in (("no: model", False), (MODEL, True)):
        answers = [client.call_async(LoadModel.Request(text=text)) for _ in range(1000)]
        # Most are lost where a thousand wait at once; the newest is not.
        robot.until(answers[-1].done, "an answer")
        assert answers[-1].result().success is taken
        robot.new_estimate()
    robot.node.destroy_client(client)
    assert resident(pid) - before < GROWTH


def broken_files() -> Iterator[tuple[str, bytes, str]]:
    """Returns formats and contents of invalid compressed images, with the expected reports."""
    view = read_calibration(config_folder() / "camera.yaml").view
    good = cv2.imencode(".jpg", CupRenderer(view).render(0, 0))[1].tobytes()
    huge = bytearray(good)
    size = huge.find(b"\xff\xc0") + 5
    huge[size : size + 4] = struct.pack(">HH", 65000, 65000)
    black = cv2.imencode(".png", np.zeros((16000, 16000), np.uint8))[1].tobytes()
    yield "jpeg", os.urandom(5000), "5000 bytes are not a complete JPEG or PNG file"
    yield "jpeg", good[: len(good) // 2], "data are missing from"
    yield "jpeg", bytes(huge), "claims 65000 x 65000 pixels"
    yield "png", black, "claims 16000 x 16000 pixels"
    yield "jpeg", b"", "is empty, 0 bytes"
    yield "\x1b[31mjp2k" * 10_000, os.urandom(5000), "format '\\x1b[31mjp2k"


@LONG
def test_compressed_images_that_are_none(tmp_path: Path, domain: int) -> None:
    files = list(broken_files())
    picture = CompressedImage(format="jpeg", data=files[-1][1])
    given = {"camera": {"transport": "compressed"}}
    made = nodes_and_robot(tmp_path, domain, given, picture=picture, namespace="/compressed")
    with made as (group, robot):
        pid = group.pid("camera")
        before = resident(pid)
        for picture.format, picture.data, said in files:
            robot.until(lambda said=said: said in robot.health["camera"][1], said)
            level, sentence = robot.health["camera"]
            assert level == ERROR
            assert len(sentence) <= LONGEST
            robot.until(lambda: "BAD_IMAGE" in robot.health["monitor"][1], "blindness")
            assert robot.comparisons[-1].state == BLIND
        assert resident(pid) - before < GROWTH


@LONG
def test_simulated_time_that_is_absent_or_goes_back(tmp_path: Path, domain: int) -> None:
    (tmp_path / "model.yaml").write_text(MODEL)
    own = {
        "recorder": {"output": str(tmp_path / "bag")},
        "estimator": {"model": str(tmp_path / "model.yaml")},
        "monitor": {},
    }
    with ExitStack() as stack:
        group = stack.enter_context(
            NodeGroup("/simulated", tmp_path / "logs", node_environment(domain))
        )
        robot = RobotNode("robot", topics.ACCEL, "/simulated")
        stack.callback(robot.close)
        robot.listen()
        robot.sees()
        for name, values in own.items():
            group.start(NodeProcess(name, (), {**values, "use_sim_time": "true"}))

        def all_say(words: str) -> bool:
            said = [robot.health.get(name, (OK, "")) for name in own]
            return all(level == STALE and words in sentence for level, sentence in said)

        robot.until(lambda: all_say("simulated time does not advance"), "the missing clock")
        assert not robot.estimates
        robot.simulates(time.time_ns)
        robot.until(lambda: robot.comparisons, "comparisons")
        wait_until_well(robot)
        robot.simulates(lambda: time.time_ns() - 5_000_000_000)
        since = time.monotonic()
        robot.until(lambda: "dropped" in robot.health["estimator"][1], "the drops")
        wait_until_well(robot)
        assert time.monotonic() - since < WELL_AGAIN
        robot.simulates(None)
        robot.until(lambda: all_say("simulated time does not advance"), "the clock that stopped")
