"""Tests three cells on one host: each has its own robot, container and limits."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
from geometry_msgs.msg import AccelStamped

from slosh_bag.nodes.recorder_node import RecorderNode
from slosh_estimator.estimator import Estimator
from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_estimator.nodes.monitor_node import MonitorNode
from slosh_estimator.validity import EstimateFlag
from slosh_model.model_text import parse_model
from slosh_motion.inputs.sampling import Sample
from slosh_msgs.msg import LimitEvent, SloshEstimate
from slosh_msgs.srv import ChangeContainer
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import Graph
from slosh_testing.journaled import replayed_by_journal

MS = 1_000_000
CELLS = {"/left": (0.03, 1.0), "/middle": (0.04, 2.0), "/right": (0.05, 3.0)}
"""Radius of each cell's cup [m], and by how much its robot accelerates [m/s²]."""


def model(radius: float) -> str:
    return (
        f"container: {{shape: cylinder, radius: {radius}, fill_height: 0.06}}\n"
        "effects: [{name: vertical_acceleration}]\n"
    )


class Hall(Graph):
    """Three cells with their robots, in one executor."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.folder = folder
        self.estimates: dict[str, list[Any]] = {}
        self.events: dict[str, list[Any]] = {}
        self.robots: dict[str, Any] = {}
        for name, (radius, _) in CELLS.items():
            path = folder / f"{name[1:]}.yaml"
            path.write_text(model(radius))
            self.with_parameters(EstimatorNode, name, model=str(path), max_age=600.0)
            limits = {"estimated_limit": 0.002}
            self.with_parameters(MonitorNode, name, camera=False, **limits)
            self.estimates[name] = self.listen(SloshEstimate, f"{name}/{topics.ESTIMATE}")
            self.events[name] = self.listen(LimitEvent, f"{name}/{topics.LIMIT_EVENT}", qos.EVENT)
            self.robots[name] = self.publisher(AccelStamped, f"{name}/{topics.ACCEL}")
            self.until(lambda name=name: self.node.count_publishers(f"{name}/{topics.ESTIMATE}"))
        self.begin = int(self.node.get_clock().now().nanoseconds)

    def move(self, first: int, last: int) -> None:
        """Moves all robots at once, each with its own motion."""
        for k in range(first, last):
            for name, (_, size) in CELLS.items():
                message = AccelStamped()
                message.header.stamp = to_time(self.begin + k * MS)
                message.header.frame_id = "world"
                message.accel.linear.x = size * math.sin(0.02 * k)
                self.robots[name].publish(message)
            self.until(lambda k=k: all(len(found) >= k for found in self.estimates.values()))


@pytest.fixture
def hall(tmp_path: Path) -> Iterator[Hall]:
    rclpy.init()
    made = Hall(tmp_path)
    yield made
    made.close()
    rclpy.try_shutdown()


def expected(radius: float, size: float, count: int, begin: int) -> list[float]:
    """Returns the heights that a cell without neighbours would give."""
    estimator = Estimator(parse_model(model(radius)))
    samples = (
        Sample(begin + k * MS, size * math.sin(0.02 * k), 0.0, 0.0, 0.0) for k in range(1, count)
    )
    return [estimator.update(sample).nonlinear.msh for sample in samples]


def test_each_cell_has_its_own_robot_container_and_limit(hall: Hall) -> None:
    hall.move(1, 150)
    for name, (radius, size) in CELLS.items():
        heights = [one.nonlinear.msh for one in hall.estimates[name]]
        assert heights == expected(radius, size, 150, hall.begin)
    hall.until(lambda: all(hall.events.values()), "an event of each")
    for name, events in hall.events.items():
        stamps = {to_nanoseconds(one.header.stamp) for one in hall.estimates[name]}
        assert to_nanoseconds(events[0].header.stamp) in stamps


def test_a_change_in_one_cell_leaves_the_others_alone(hall: Hall) -> None:
    hall.move(1, 5)
    request = ChangeContainer.Request(empty=True)
    assert hall.call(ChangeContainer, f"/middle/{topics.CHANGE_CONTAINER}", request).success
    hall.move(5, 20)
    empty = {
        name: found[-1].flags & EstimateFlag.NO_CONTAINER for name, found in hall.estimates.items()
    }
    assert [bool(empty[name]) for name in CELLS] == [False, True, False]


def test_one_recording_of_all_three_is_replayed_cell_by_cell(hall: Hall) -> None:
    bag = hall.folder / "bag"
    recorder = hall.with_parameters(
        RecorderNode, "/left", output=str(bag), topics="^/(left|middle|right)/"
    )
    written = lambda: recorder._core.status().written  # noqa: E731
    hall.until(lambda: len([t for t in written() if t.endswith("/settings")]) == 3, "the settings")
    hall.move(1, 200)
    hall.until(lambda: all(written().get(f"{name}/estimate", 0) >= 199 for name in CELLS))
    recorder.close()
    for name in CELLS:
        found = replayed_by_journal(bag, name).verification
        assert found is not None
        assert found.topic == f"{name}/estimate"
        assert found.exact, found.lines()
