"""Tests that killed nodes stop no others, are named by the monitor, and spoil no bag."""

import os
import signal
import time

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor

from slosh_bag.reader import BagReader
from slosh_bringup.live.cell_setup import default_setup
from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_msgs.msg import FreeSurface, SloshComparison, SloshEstimate
from slosh_msgs_py import qos, topics

PATIENCE = 30.0


class Listener:
    """Collects the messages of the nodes."""

    def __init__(self, logs):
        rclpy.init()
        self.logs = logs
        self.node = rclpy.create_node("listener", namespace="/slosh")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.seen = {}
        self.newest = {}
        for topic, kind in (
            (topics.COMPARISON, SloshComparison),
            (topics.ESTIMATE, SloshEstimate),
            (topics.FREE_SURFACE, FreeSurface),
        ):
            self.seen[topic] = 0
            self.node.create_subscription(kind, topic, self._taker(topic), qos.STREAM_IN)

    def _taker(self, topic):
        def take(message):
            self.seen[topic] += 1
            self.newest[topic] = message

        return take

    def wait_for(self, condition, what, patience=PATIENCE):
        """Runs callbacks until a condition holds; returns the time that it took [s]."""
        started = time.monotonic()
        while not condition():
            if time.monotonic() - started > patience:
                said = {log.stem: log.read_text()[-500:] for log in self.logs.glob("*.log")}
                pytest.fail(f"waited in vain for {what}; the nodes said {said}")
            self.executor.spin_once(timeout_sec=0.05)
        return time.monotonic() - started

    def wait_for_more(self, *wanted):
        """Waits until ten more messages of each topic have been received."""
        goal = {topic: self.seen[topic] + 10 for topic in wanted}
        self.wait_for(lambda: all(self.seen[t] >= n for t, n in goal.items()), f"more of {wanted}")

    def close(self):
        self.node.destroy_node()
        rclpy.shutdown()


@pytest.fixture
def listener(domain, tmp_path):
    listener = Listener(tmp_path / "logs")
    yield listener
    listener.close()


def test_the_others_go_on(listener, domain, tmp_path):
    setup = default_setup()
    processes = {process.name: process for process in setup.processes(tmp_path / "bag")}
    cell = NodeProcess(
        "cell",
        [setup.parameters],
        {
            "motion": "l", "repeat": "20", "fps": "20.0",
            "model": str(config_folder() / "truth.yaml"),
            "calibration": str(setup.calibration),
        },
    )  # fmt: skip
    everything = (topics.COMPARISON, topics.ESTIMATE, topics.FREE_SURFACE)
    comparison = listener.newest

    def newest(field):
        return getattr(comparison.get(topics.COMPARISON), field, None)

    with NodeGroup(setup.namespace, tmp_path / "logs", node_environment(domain)) as group:
        for process in (*processes.values(), cell):
            group.start(process)
        listener.wait_for_more(*everything)

        os.kill(group.pid("camera"), signal.SIGKILL)
        listener.wait_for(lambda: newest("measured_stale"), "the camera to be missed", 5.0)
        assert newest("state") in (SloshComparison.STATE_STALE, SloshComparison.STATE_ERROR)
        assert newest("estimated_nonlinear") == newest("estimated_nonlinear")  # no NaN
        listener.wait_for_more(topics.ESTIMATE, topics.COMPARISON)
        group.start(processes["camera"])
        listener.wait_for(lambda: newest("measured_stale") is False, "the camera's return")

        os.kill(group.pid("estimator"), signal.SIGKILL)
        listener.wait_for(lambda: newest("estimate_stale"), "the estimator to be missed", 5.0)
        # The monitor's heartbeat between two images has no height.
        listener.wait_for(lambda: newest("measured") == newest("measured"), "a measured height")
        listener.wait_for_more(topics.FREE_SURFACE, topics.COMPARISON)
        group.start(processes["estimator"])
        listener.wait_for(lambda: newest("estimate_stale") is False, "the estimator's return")

        os.kill(group.pid("monitor"), signal.SIGKILL)
        listener.wait_for_more(topics.ESTIMATE, topics.FREE_SURFACE)
        group.start(processes["monitor"])
        listener.wait_for_more(topics.COMPARISON)

        os.kill(group.pid("recorder"), signal.SIGKILL)
        listener.wait_for_more(*everything)

    reader = BagReader(tmp_path / "bag")
    stamps = [message.log_ns for message in reader.messages(["/slosh/estimate"])]
    assert len(stamps) > 1000
    assert "unfinished" in reader.warnings[0]
