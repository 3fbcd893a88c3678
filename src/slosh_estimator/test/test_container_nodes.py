"""Tests a change of the container over DDS with estimator, monitor and a controller."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from builtin_interfaces.msg import Time
from geometry_msgs.msg import AccelStamped
from rclpy.executors import SingleThreadedExecutor

from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_estimator.nodes.monitor_node import MonitorNode
from slosh_estimator.validity import EstimateFlag
from slosh_model.model_text import parse_model
from slosh_msgs.msg import ContainerChange, NodeSettings, SloshEstimate
from slosh_msgs.srv import ChangeContainer, LoadModel
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.graph import Graph

MS = 1_000_000
CUP = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.1}\n"
MUG = "container: {shape: cylinder, radius: 0.04, fill_height: 0.05, rim_height: 0.08}\n"


class Line(Graph):
    """Estimator and monitor nodes with a production line's controller."""

    def __init__(self) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.add(EstimatorNode())
        self.monitor = self.add(MonitorNode())
        self.estimates = self.listen(SloshEstimate, topics.ESTIMATE)
        self.changes = self.listen(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
        self.settings = self.listen(NodeSettings, topics.SETTINGS, qos.EVENT)
        self._robot = self.publisher(AccelStamped, topics.ACCEL)
        self.until(lambda: self.node.count_publishers(topics.ESTIMATE) and self.changes)
        self.begin = self.now()

    def now(self) -> int:
        return int(self.node.get_clock().now().nanoseconds)

    def move(self, first: int, last: int, ax: float = 0.0) -> None:
        """Sends inputs with stamps in a range of milliseconds after the start."""
        for k in range(first, last):
            message = AccelStamped()
            message.header.stamp = to_time(self.begin + k * MS)
            message.header.frame_id = "world"
            message.accel.linear.x = ax
            count = len(self.estimates)
            self._robot.publish(message)
            self.until(lambda count=count: len(self.estimates) > count)

    def change(self, after_ms: int | None = None, **fields: Any) -> ChangeContainer.Response:
        stamp = to_time(self.begin + after_ms * MS) if after_ms is not None else Time()
        request = ChangeContainer.Request(stamp=stamp, **fields)
        return self.call(ChangeContainer, topics.CHANGE_CONTAINER, request)

    def watched(self) -> dict[str, Any]:
        """Returns the monitor's parameters as it last published them."""
        own = [one for one in self.settings if one.node == "monitor"]
        return yaml.safe_load(own[-1].document)["parameters"]

    def since(self, flag: EstimateFlag) -> list[int]:
        """Returns the stamps of estimates with a flag [ms after the start]."""
        return [
            (to_nanoseconds(one.header.stamp) - self.begin) // MS
            for one in self.estimates
            if one.flags & flag
        ]


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Line]:
    (tmp_path / "model.yaml").write_text(CUP)
    (tmp_path / "mug.yaml").write_text(MUG)
    (tmp_path / "broken.yaml").write_text("container: 7")
    words = ["-p", f"model:={tmp_path}/model.yaml", "-p", f"containers:={tmp_path}"]
    rclpy.init(args=["--ros-args", *words, "-p", "camera:=false", "-p", "max_age:=600.0"])
    made = Line()
    yield made
    made.close()
    rclpy.try_shutdown()


def test_a_change_takes_effect_at_its_stamp(line: Line) -> None:
    line.move(1, 10)
    answer = line.change(15, empty=True)
    assert answer.success
    assert "no container" in answer.message
    assert line.change(25, name="mug", fill_height=0.04, limit=0.008).success
    line.move(10, 40)
    assert line.since(EstimateFlag.NO_CONTAINER) == list(range(16, 26))
    assert not line.since(EstimateFlag.SETTLING)
    line.until(lambda: line.changes[-1].name == "mug")
    told = line.changes[-1]
    assert to_nanoseconds(told.header.stamp) == line.begin + 25 * MS
    assert (told.present, told.fill_height, told.limit) == (True, 0.04, 0.008)
    assert parse_model(told.model).container.fill_height == 0.04
    line.until(lambda: line.watched().get("measured_limit") == 0.008)
    assert line.watched()["rim"] == pytest.approx(0.04)
    assert [e.samples_used for e in line.estimates] == list(range(1, 40))


def test_a_change_in_motion_is_flagged_and_a_late_one_says_by_how_much(line: Line) -> None:
    line.move(1, 60, ax=2.0)
    answer = line.change(50, fill_height=0.06)
    assert answer.success
    assert "0.009 s after the stamp given" in answer.message
    line.move(60, 65, ax=2.0)
    assert line.since(EstimateFlag.SETTLING) == list(range(60, 65))


def test_an_empty_gripper_ends_nothing_and_a_model_alone_leaves_the_level(line: Line) -> None:
    line.move(1, 5)
    assert line.change(empty=True).success
    line.move(5, 10)
    assert math.isnan(line.estimates[-1].nonlinear.msh)
    assert line.change(fill_height=0.065).success  # the same container again
    line.move(10, 15)
    assert line.estimates[-1].flags == EstimateFlag.NONE
    assert line.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request(text=CUP)).success
    line.until(lambda: parse_model(line.changes[-1].model).container.fill_height == 0.07)
    assert math.isnan(line.changes[-1].fill_height)


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({}, "nothing to change"),
        ({"name": "jar"}, "jar.yaml"),
        ({"name": "../model"}, "must be letters"),
        ({"name": "broken"}, "not a valid model"),
        ({"model": "container: 7"}, "must be a mapping"),
        ({"fill_height": 0.2}, "must lie above"),
        ({"fill_height": float("inf")}, "fill_height"),
        ({"empty": True, "name": "mug"}, "empty with a container"),
        ({"after_ms": 10**8, "empty": True}, "by their clock"),
    ],
)
@pytest.mark.first(3)
def test_what_cannot_be_changes_nothing(line: Line, fields: dict[str, Any], why: str) -> None:
    line.move(1, 3)
    answer = line.change(**fields)
    assert not answer.success
    assert why in answer.message
    assert "\n" not in answer.message
    line.move(3, 5)
    assert line.estimates[-1].flags == EstimateFlag.NONE
    assert len(line.changes) == 1


def test_changes_come_in_the_order_of_their_stamps(line: Line) -> None:
    line.move(1, 3)
    assert line.change(10, empty=True).success
    answer = line.change(8, fill_height=0.05)
    assert not answer.success
    assert "in the order of their stamps" in answer.message
