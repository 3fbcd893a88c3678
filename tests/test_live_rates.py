"""Estimator and monitor as processes, driven by poses and accelerations at the rates of robots."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_estimator.validity import EstimateFlag
from slosh_model.model_text import format_model
from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.random_moves import MODEL, Move, Poses, moves, truth

PATIENCE = 60.0
SECOND = 1_000_000_000
WARN, ERROR = 1, 2
pytestmark = pytest.mark.timeout(200)


class Listener:
    """Plays a robot to an estimator, and hears it.

    Attributes:
        estimates: what has come.
        health: level and sentence of the estimator's last report, and its values.
    """

    def __init__(self, kind: type, topic: str) -> None:
        self.node = Node("robot", namespace="/slosh")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self.estimates: list[SloshEstimate] = []
        self.health: tuple[int, str, dict[str, str]] = (ERROR, "", {})
        self.publisher = self.node.create_publisher(kind, topic, qos.STREAM_OUT)
        hear = self.node.create_subscription
        hear(SloshEstimate, topics.ESTIMATE, self.estimates.append, qos.STREAM_IN)
        hear(DiagnosticArray, topics.DIAGNOSTICS, self._take, qos.DIAGNOSTICS)

    def until(self, condition: Callable[[], object], what: str) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain for {what}: {self.health}"
            self._executor.spin_once(timeout_sec=0.01)

    def play(self, stamps: list[int], made: Callable[[int], Any]) -> int:
        """Sends messages with stamps [ns] from now on, no faster than they are heard."""
        begin = time.time_ns()
        for k, stamp in enumerate(stamps):
            message = made(k)
            message.header.stamp = to_time(begin + stamp)
            self.publisher.publish(message)
            if self.estimates and k % 10 == 0:
                reached = begin + stamp - SECOND // 2
                self.until(lambda at=reached: self.newest_ns >= at, "the estimates to follow")
            else:
                self._executor.spin_once(timeout_sec=0.002)
        self.until(lambda: self.newest_ns > begin + stamps[-1] - SECOND // 4, "the last estimates")
        return begin

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest estimate [ns]."""
        return to_nanoseconds(self.estimates[-1].header.stamp) if self.estimates else 0

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "/slosh/estimator":
                values = {pair.key: pair.value for pair in status.values}
                self.health = (ord(status.level), status.message, values)


@contextmanager
def estimator(
    folder: Path, domain: int, kind: type, topic: str, **parameters: str
) -> Iterator[Listener]:
    """An estimator in a process of its own, ready, and who speaks with it."""
    (folder / "model.yaml").write_text(format_model(MODEL))
    # The stamps run ahead of the clock, or behind it, as fast as this machine sends.
    given = {"model": str(folder / "model.yaml"), "input": topic, "max_age": "600.0", **parameters}
    rclpy.init()
    listener = Listener(kind, topic)
    try:
        with NodeGroup("/slosh", folder / "logs", node_environment(domain)) as group:
            group.start(NodeProcess("estimator", (), given))
            listener.until(lambda: listener.health[2].get("state") == "ready", "the estimator")
            listener.until(lambda: listener.publisher.get_subscription_count() > 0, "its ear")
            yield listener
    finally:
        listener.close()
        rclpy.shutdown()


def pose(place: tuple[float, float, float]) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = "world"
    message.pose.orientation.w = 1.0
    p = message.pose.position
    p.x, p.y, p.z = place
    return message


def heard(listener: Listener, begin: int, move: Move) -> tuple[float, float]:
    """The highest wave, and the highest one behind the motion [m]."""
    stamps = np.array([to_nanoseconds(one.header.stamp) for one in listener.estimates]) - begin
    msh = np.array([one.nonlinear.msh for one in listener.estimates])
    return float(msh.max()), float(msh[stamps > (move.end + 0.1) * SECOND].max())


@pytest.mark.long
@pytest.mark.parametrize("rate", [125, 30])
def test_poses_of_a_robot_give_the_true_heights_over_dds(
    rate: int, tmp_path: Path, domain: int
) -> None:
    """0.1 mm, 1 ms: 11.4 mm of 12.2 came at 125 Hz and 6.2 at 30 Hz, and all was said to be OK."""
    move = moves(4)
    true = truth(move)
    with estimator(tmp_path, domain, PoseStamped, topics.POSE) as listener:
        stamps, places = Poses(rate, 1e-4, 1e-3, seed=4).of(move)
        begin = listener.play(stamps, lambda k: pose(places[k]))
        peak, residual = heard(listener, begin, move)
        listener.until(lambda: "gain at mode 1" in listener.health[2], "the gain")
        values = listener.health[2]
    assert peak == pytest.approx(true.peak, rel=0.04)
    assert residual == pytest.approx(true.residual, rel=0.04)
    assert not any(one.flags & EstimateFlag.INPUT_TOO_SLOW for one in listener.estimates)
    assert float(values["gain at mode 1"]) == pytest.approx(0.99, abs=0.01)
    assert float(values["input rate [Hz]"]) == pytest.approx(rate, rel=0.05)
    assert 50 < float(values["delay of the pose window [ms]"]) < 75


@pytest.mark.long
def test_a_slow_input_is_named_with_a_remedy(tmp_path: Path, domain: int) -> None:
    """Accelerations at 25 Hz carry 0.94 of the first mode."""
    with estimator(tmp_path, domain, AccelStamped, topics.ACCEL) as listener:

        def made(k: int) -> AccelStamped:
            message = AccelStamped()
            message.header.frame_id = "world"
            message.accel.linear.x = 0.1
            return message

        listener.play([40_000_000 * k for k in range(100)], made)
        listener.until(lambda: listener.health[0] == WARN, "a warning")
        said = listener.health[1]
    assert listener.estimates[-1].flags == EstimateFlag.INPUT_TOO_SLOW
    assert said == (
        "accelerations arrive at 25 Hz: the gain at mode 1 (3.4 Hz) is 0.94, and the estimate is "
        "too low; publish at 40 Hz or more, or use a faster sensor"
    )
