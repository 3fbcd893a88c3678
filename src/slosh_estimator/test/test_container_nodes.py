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
from slosh_model.standing import Standing
from slosh_model.tray import parse_tray
from slosh_msgs.msg import ContainerChange, NodeSettings, SloshEstimate, TrayEstimate
from slosh_msgs.srv import ChangeContainer, LoadModel
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import Graph

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


TRAY = f"""containers:
- {{name: left, place: [0.0, 0.1, 0.0], limit: 0.02, model: {{{CUP[:-1]}}}}}
- {{name: right, place: [0.0, -0.1, 0.0], model: {{{CUP[:-1]}}}}}
- {{name: loose, model: {{{CUP[:-1]}}},
  standing: {{mass: 0.2, centre_height: 0.06, base_radius: 0.035, friction: 0.3}}}}
"""


@pytest.fixture
def tray(tmp_path: Path) -> Iterator[Line]:
    (tmp_path / "tray.yaml").write_text(TRAY)
    (tmp_path / "mug.yaml").write_text(MUG)
    words = ["-p", f"model:={tmp_path}/tray.yaml", "-p", f"containers:={tmp_path}"]
    rclpy.init(args=["--ros-args", *words, "-p", "camera:=false", "-p", "max_age:=600.0"])
    made = Line()
    yield made
    made.close()
    rclpy.try_shutdown()


def test_one_container_of_a_tray_changes_and_the_other_goes_on(tray: Line) -> None:
    told = tray.listen(TrayEstimate, topics.TRAY_ESTIMATE)
    tray.move(1, 60, ax=1.0)
    assert tray.change(80, tray_place="right", name="mug", fill_height=0.04, limit=0.01).success
    tray.move(60, 120, ax=1.0)
    tray.until(lambda: len(told) >= 20)
    flags = {to_nanoseconds(one.header.stamp): one.flags.tolist() for one in told}
    settling = {k: [bool(f & EstimateFlag.SETTLING) for f in both] for k, both in flags.items()}
    changed_ns = tray.begin + 80 * MS
    assert all(both == [False, k > changed_ns, False] for k, both in settling.items())
    assert max(settling) > changed_ns
    tray.until(lambda: bool(tray.changes[-1].tray))
    change = tray.changes[-1]
    assert to_nanoseconds(change.header.stamp) == changed_ns
    assert (change.present, math.isnan(change.limit)) == (True, True)
    assert change.tray_place == "right"
    left, right, _ = parse_tray(change.tray).containers
    assert parse_model(change.model) == left.model
    assert (left.limit, right.limit) == (0.02, 0.01)
    assert right.model.container.fill_height == 0.04
    watched = tray.monitor._core.tray
    tray.until(lambda: watched.tray.containers[1].limit == 0.01, "the monitor")


def test_an_emptied_place_has_no_height_and_the_others_are_estimated(tray: Line) -> None:
    told = tray.listen(TrayEstimate, topics.TRAY_ESTIMATE)
    tray.move(1, 10, ax=1.0)
    assert tray.change(tray_place="left", empty=True).success
    tray.move(10, 40, ax=1.0)
    tray.until(lambda: bool(told) and told[-1].flags[0] & EstimateFlag.NO_CONTAINER)
    assert math.isnan(told[-1].msh[0])
    assert told[-1].msh[1] > 0.0
    assert told[-1].worst == 1
    assert tray.estimates[-1].flags & EstimateFlag.NO_CONTAINER
    assert not tray.changes[-1].present
    assert tray.change(tray_place="left", fill_height=0.05).success
    tray.move(40, 60, ax=1.0)
    assert not math.isnan(tray.estimates[-1].nonlinear.msh)


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"fill_height": 0.05}, "tray_place = '' is no place of the tray (left, right, loose)"),
        ({"tray_place": "top", "fill_height": 0.05}, "tray_place = 'top' is no place"),
        ({"tray_place": "left"}, "nothing to change"),
    ],
)
def test_a_place_must_be_named(tray: Line, fields: dict[str, Any], why: str) -> None:
    answer = tray.change(**fields)
    assert not answer.success
    assert why in answer.message


def test_a_loose_place_gets_another_container_with_its_standing_alone(tray: Line) -> None:
    """Until it is told, the tray does not foretell the fall of the new one by the last one."""
    tray.move(1, 5)
    answer = tray.change(tray_place="loose", name="mug")
    assert not answer.success
    assert "standing is missing" in answer.message
    own = [0.1, 0.05, 0.03, 0.25]
    assert tray.change(tray_place="loose", name="mug", standing=own).success
    tray.until(lambda: tray.changes[-1].tray_place == "loose")
    assert parse_tray(tray.changes[-1].tray).containers[2].standing == Standing(*own)
    assert tray.change(tray_place="loose", name="mug", fill_height=0.04).success
    tray.until(
        lambda: parse_tray(tray.changes[-1].tray).containers[2].model.container.fill_height < 0.05
    )
    assert parse_tray(tray.changes[-1].tray).containers[2].standing == Standing(*own)


def test_what_has_no_tray_has_no_places(line: Line) -> None:
    answer = line.change(tray_place="left", fill_height=0.05)
    assert not answer.success
    assert "the cell carries no tray" in answer.message


def test_load_model_leaves_a_tray(tray: Line) -> None:
    answer = tray.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request(text=CUP))
    assert not answer.success
    assert "call change_container, with tray_place" in answer.message
