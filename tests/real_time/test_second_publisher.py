"""Tests that a second publisher of an estimator's input, in its own process, is flagged."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rclpy

from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_msgs.msg import SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_testing.hearing_robot import Graph

OWN, FOREIGN = 0.05, 0.4
CONTESTED = SloshEstimate.INPUT_CONTESTED


@contextmanager
def source(domain: int, *words: object) -> Iterator[subprocess.Popen[bytes]]:
    given = {**os.environ, **node_environment(domain)}
    command = [sys.executable, "-m", "slosh_testing.live_source", *map(str, words)]
    with subprocess.Popen(command, env=given) as process:
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture
def hear(tmp_path: Path, domain: int) -> Iterator[Callable[[str], Listener]]:
    """Yields a function that starts an estimator with an input and collects its messages."""
    rclpy.init(domain_id=domain)
    made = []

    def start(kind: str) -> Listener:
        group = NodeGroup("/slosh", tmp_path / "logs", node_environment(domain)).__enter__()
        model = str(config_folder() / "truth.yaml")
        given = {"model": model, "input": kind, "check_input": "false", "max_gap": "1.0"}
        group.start(NodeProcess("estimator", parameters=given))
        made.append((group, Listener()))
        return made[-1][1]

    yield start
    for group, listener in made:
        group.__exit__(None, None, None)
        listener.close()
    rclpy.try_shutdown()


class Listener(Graph):
    """Collects estimates: the input that drove each, and its flags."""

    def __init__(self) -> None:
        super().__init__("listener", "/slosh")
        self.heard: list[tuple[float, int]] = []
        self.node.create_subscription(SloshEstimate, topics.ESTIMATE, self._take, qos.STREAM_IN)

    def _take(self, message: SloshEstimate) -> None:
        self.heard.append((float(message.acceleration[0]), int(message.flags)))

    def go_on(self, count: int) -> None:
        wanted = len(self.heard) + count
        self.until(lambda: len(self.heard) >= wanted)


def unflagged_after_the_first_foreign_one(heard: list[tuple[float, int]]) -> int:
    first = next(k for k, (value, _) in enumerate(heard) if abs(value - FOREIGN) < 0.01)
    return sum(not flags & CONTESTED for _, flags in heard[first:])


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("kind", "rate", "other"),
    [
        ("accel", 250.0, 40.0),
        ("imu", 250.0, 250.0),
        pytest.param("accel", 250.0, 250.0, marks=pytest.mark.long),
        pytest.param("accel", 100.0, 400.0, marks=pytest.mark.long),
    ],
)
def test_estimates_are_flagged_from_the_first_foreign_sample_on(hear, domain, kind, rate, other):
    listener = hear(kind)
    with source(domain, kind, rate, OWN):
        listener.go_on(400)
        # One publisher alone is not contested, whatever starts late or is lost.
        assert not any(flags & CONTESTED for _, flags in listener.heard[50:])
        with source(domain, kind, other, FOREIGN, 3):
            listener.until(lambda: any(abs(a - FOREIGN) < 0.01 for a, _ in listener.heard))
            listener.go_on(400)
            assert unflagged_after_the_first_foreign_one(listener.heard) == 0


@pytest.mark.long
def test_a_publisher_that_takes_the_place_of_another_is_not_flagged(hear, domain):
    listener = hear("accel")
    with source(domain, "accel", 250.0, OWN):
        listener.go_on(300)
    time.sleep(0.3)
    begun = len(listener.heard)
    with source(domain, "accel", 250.0, FOREIGN):
        listener.go_on(300)
    assert not any(flags & CONTESTED for _, flags in listener.heard[begun:])
