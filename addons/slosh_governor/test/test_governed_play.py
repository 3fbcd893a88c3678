"""Tests the simulated cell with a live governor over DDS, in one process."""

import json
import time

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import AccelStamped, TwistStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from scipy.integrate import cumulative_trapezoid
from std_msgs.msg import String

from slosh_bringup.processes import config_folder
from slosh_governor.nodes.governed_cell_node import GovernedCellNode
from slosh_governor.nodes.governor_node import GovernorNode
from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_msgs.msg import FreeSurface, GovernedMotion, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds

PATIENCE, LIMIT, RATE, STEPS = 40.0, 0.006, 250.0, 50.0
KINDS = {
    topics.ACCEL: AccelStamped, topics.DESIRED_TWIST: TwistStamped,
    topics.GOVERNED_MOTION: GovernedMotion, topics.TRUTH: FreeSurface, topics.SUMMARY: String,
    topics.ESTIMATE: SloshEstimate,
}  # fmt: skip


@pytest.fixture
def played(tmp_path, domain):
    """Plays a stroke of 0.3 s and a rest; returns the messages by topic and the cell's failure."""
    t = np.arange(601) / 1000.0
    push = np.outer(4.0 * np.sin(2.0 * np.pi * t / 0.3) * (t < 0.3), [1.0, 0.0, 0.0])
    write_motion_table(tmp_path / "stroke.csv", MotionTable(t, push))
    given = {
        "cell:motion": tmp_path / "stroke.csv", "cell:camera": "false", "cell:fps": 20.0,
        "cell:readers": 1, "cell:rate": RATE, "cell:govern": STEPS, "cell:acceleration_noise": 0.0,
        "governor:model": config_folder() / "model.yaml", "governor:limit": LIMIT,
        "governor:rate": STEPS, "governor:timeout": 5.0,
    }  # fmt: skip
    words = [word for pair in given.items() for word in ("-p", "{}:={}".format(*pair))]
    rclpy.init(args=["--ros-args", *words], domain_id=domain)
    nodes = []
    try:
        probe, got = Node("probe"), {topic: [] for topic in KINDS}
        nodes.append(probe)
        for topic, kind in KINDS.items():
            profile = qos.EVENT if topic == topics.SUMMARY else qos.STREAM_OUT
            probe.create_subscription(kind, topic, got[topic].append, profile)
        nodes += [GovernorNode(), cell := GovernedCellNode()]
        executor = SingleThreadedExecutor()
        for node in nodes:
            executor.add_node(node)
        deadline = time.monotonic() + PATIENCE
        while not (cell.finished and got[topics.SUMMARY]):
            assert time.monotonic() < deadline, "the cell does not end"
            executor.spin_once(timeout_sec=0.05)
        cell.close()
        return got, cell.failure
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()


def test_the_container_moves_as_the_governor_says(played):
    got, failure = played
    assert not failure
    summary = json.loads(got[topics.SUMMARY][0].data)
    governed = summary["results"]["values"]["governed"]
    assert "governed distance" in summary["results"]["rows"]
    assert governed["ungoverned"] > 1.5 * LIMIT
    assert governed["highest"] > 0.3 * LIMIT
    assert governed["highest"] <= LIMIT or governed["late"]
    assert governed["limit"] == LIMIT
    assert governed["distance"] > 0.2 * governed["commanded"]
    assert governed["lost"] == 0
    assert summary["published"][f"/{topics.DESIRED_TWIST}"] >= 10
    # The samples lie on an even grid, and have the velocity that the governor says.
    stamps = [to_nanoseconds(one.header.stamp) for one in got[topics.ACCEL]]
    assert np.ptp(np.diff(stamps)) <= 1
    told = [one for one in got[topics.GOVERNED_MOTION] if one.steps]
    begun = to_nanoseconds(told[0].header.stamp)
    assert stamps[0] == begun + round(1e9 / RATE)
    sent = np.array([one.accel.linear.x for one in got[topics.ACCEL]])
    velocity = cumulative_trapezoid(sent, dx=1.0 / RATE, initial=0.0)
    ends = [to_nanoseconds(one.header.stamp) + round(1e9 / STEPS) for one in told]
    found = np.interp(np.array(ends) - begun, np.array(stamps) - begun, velocity)
    assert found == pytest.approx([one.velocity[0] for one in told], abs=0.01)
    assert velocity.max() > 0.05
    # The exact heights of the images are those of this motion.
    shown = max(one.msh for one in got[topics.TRUTH])
    assert 0.2 * LIMIT < shown <= governed["highest"]
