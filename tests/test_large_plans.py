"""Tests planned motions with very many points, sent to a predictor process."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest
import rclpy
from rclpy.node import Node
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import (
    MultiDOFJointTrajectory,
)

from slosh_model.motion_profiles import quintic
from slosh_msgs.msg import MotionPrediction
from slosh_msgs_py import qos, topics
from slosh_testing.live_processes import until

MODEL = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\ndamping_ratio: auto\n"
MOST = 200_000
POINT = np.dtype([
    ("count", "<u4"), ("_", "<u4"), ("place", "<f8", 3), ("turn", "<f8", 4), ("speeds", "<u4"),
    ("__", "<u4"), ("speed", "<f8", 6), ("changes", "<u4"), ("___", "<u4"), ("change", "<f8", 6),
    ("sec", "<i4"), ("nanosec", "<u4"),
])  # fmt: skip
SECONDS, PEAK = 6.0, 500e6
"""Of the processor, on a machine that is busy with other things; they were 14 to 17 [s]."""


def large_trajectory(count: int) -> bytes:
    """Returns the serialised trajectory of a 0.4 m motion with a point every millisecond."""
    rows = np.zeros(count, POINT)
    t = np.arange(count) * 1_000_000
    rows["sec"], rows["nanosec"] = t // 10**9, t % 10**9
    share = np.linspace(0.0, 1.0, count)
    place, rate, change = quintic(share)
    lasts = 1e-3 * (count - 1)
    rows["count"] = rows["speeds"] = rows["changes"] = 1
    rows["turn"][:, 3] = 1.0
    for name, values in (("place", place), ("speed", rate / lasts), ("change", change / lasts**2)):
        rows[name][:, 0] = 0.4 * values
    head = serialize_message(MultiDOFJointTrajectory(joint_names=["cup"]))
    assert (len(head) - 4) % 8 == 0, "a point begins where a double may lie"
    return head[:-4] + np.uint32(count).tobytes() + rows.tobytes()


@pytest.fixture
def predictor(tmp_path: Path) -> Iterator[psutil.Process]:
    (tmp_path / "model.yaml").write_text(MODEL)
    process = subprocess.Popen([
        sys.executable, "-m", "slosh_plan.nodes.predictor_node", "--ros-args", "-r",
        "__ns:=/large", "-p", f"model:={tmp_path / 'model.yaml'}",
    ])  # fmt: skip
    yield psutil.Process(process.pid)
    process.terminate()
    process.wait(30)


@pytest.fixture
def probe() -> Iterator[Node]:
    rclpy.init()
    node = Node("probe", namespace="/large")
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


@pytest.mark.long
def test_200000_points_are_predicted_within_bounds(predictor: psutil.Process, probe: Node) -> None:
    heard: list[MotionPrediction] = []
    probe.create_subscription(MotionPrediction, topics.PREDICTION, heard.append, qos.EVENT)
    publisher = probe.create_publisher(
        MultiDOFJointTrajectory, topics.PLANNED_TRAJECTORY, qos.DIAGNOSTICS
    )
    until(lambda: publisher.get_subscription_count(), "the predictor")

    def told(data: bytes) -> MotionPrediction:
        known = len(heard)
        publisher.publish(data)
        until(lambda: rclpy.spin_once(probe, timeout_sec=0.1) or len(heard) > known, "an answer")
        return heard[-1]

    assert told(large_trajectory(1_000)).state == MotionPrediction.KEPT
    before = predictor.memory_info().rss
    took = sum(predictor.cpu_times()[:2])
    answer = told(large_trajectory(MOST))
    assert answer.state == MotionPrediction.KEPT, answer.description
    assert sum(predictor.cpu_times()[:2]) - took < SECONDS
    assert peak_of(predictor) < PEAK
    until(lambda: predictor.memory_info().rss < before + 80e6, "memory that is given back")
    refused = told(large_trajectory(MOST + 1))
    assert refused.state == MotionPrediction.REFUSED
    assert "200001 points are more than 200000" in refused.description


def peak_of(process: psutil.Process) -> int:
    """Returns the peak memory of a process [bytes]."""
    (line,) = [
        line for line in Path(f"/proc/{process.pid}/status").read_text().splitlines()
        if line.startswith("VmHWM")
    ]  # fmt: skip
    return int(line.split()[1]) * 1024
