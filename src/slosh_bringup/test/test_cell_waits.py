"""Tests which nodes the simulated cell waits for before it starts, and what it reports."""

import os
import re
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped
from rclpy.executors import SingleThreadedExecutor

from slosh_motion.tables.motion_table import MotionTable, write_motion_table
from slosh_msgs_py import qos
from slosh_msgs_py.node.diagnostics import OK, DiagnosticsReporter
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.readiness import COMPILING, Readiness

PATIENCE = 30.0


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Motion table of half a second in which the container is pushed."""
    t = np.arange(501) / 1000.0
    push = np.stack((np.sin(2 * np.pi * t), 0.0 * t, 0.0 * t), axis=1)
    path = tmp_path_factory.mktemp("cell") / "push.csv"
    write_motion_table(path, MotionTable(t, push))
    return path


def start(table, domain, *parameters):
    """Starts the cell node as a process."""
    given = (f"motion:={table}", *parameters)
    words = [word for pair in given for word in ("-p", pair)]
    own = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    return subprocess.Popen(
        [sys.executable, "-m", "slosh_bringup.nodes.cell_node", "--ros-args", *words],
        stderr=subprocess.PIPE, text=True, env={**os.environ, **own},
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        (
            ("wait_for:=camera,monitor", "patience:=1.0"),
            r"^cell: nothing is played: camera has sent no diagnostics for \d+ s$",
        ),
        (
            ("wait_for:=''", "readers:=1", "patience:=1.0"),
            r"^cell: nothing is played: /accel has 0 of 1 readers$",
        ),
    ],
)
def test_without_the_others_it_plays_nothing_and_says_who_is_missing(
    table, domain, parameters, said
):
    with start(table, domain, *parameters) as process:
        told = process.stderr.read()
        assert process.wait(PATIENCE) == 1
    assert re.search(said, told.strip().splitlines()[-1])


def test_it_waits_for_a_node_that_gets_ready_and_tells_for_whom(table, domain):
    """Nothing is published before the other node is ready, and the cell reports its wait."""
    rclpy.init()
    probe = GuardedNode("camera")
    said, accelerations = [], []
    readiness = Readiness(COMPILING)
    executor = SingleThreadedExecutor()
    executor.add_node(probe)
    reporter = DiagnosticsReporter(probe, lambda: (OK, "measuring"), dict, readiness)
    probe.create_subscription(DiagnosticArray, "/diagnostics", said.append, qos.DIAGNOSTICS)
    probe.create_subscription(AccelStamped, "accel", accelerations.append, qos.STREAM_OUT)

    def told():
        words = [s for array in said for s in array.status if s.name == "/cell"]
        return any(
            "waiting to play push.csv" in s.message and "camera" in s.message for s in words
        )

    try:
        with start(table, domain, "wait_for:=camera", "readers:=0", "patience:=20.0") as process:
            deadline = time.monotonic() + PATIENCE
            while not told():
                assert time.monotonic() < deadline, "it does not say for whom it waits"
                executor.spin_once(timeout_sec=0.05)
            assert not accelerations
            readiness.is_ready()
            reporter.report()
            while process.poll() is None:
                assert time.monotonic() < deadline, "it does not play"
                executor.spin_once(timeout_sec=0.05)
            assert process.wait() == 0
        assert len(accelerations) > 400
    finally:
        probe.destroy_node()
        rclpy.shutdown()
