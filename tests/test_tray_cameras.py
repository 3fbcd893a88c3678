"""Tests cameras of several containers on a tray: over DDS, replayed, and in a cell file."""

import math
import time
from pathlib import Path

import numpy as np
import pytest
import rclpy
from sensor_msgs.msg import Imu

from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.live.run_data import read_run
from slosh_bringup.live.run_result import evaluate
from slosh_bringup.processes import NodeGroup, NodeProcess, node_environment
from slosh_bringup.replay.containers import further_containers
from slosh_msgs.msg import FreeSurface, LimitEvent, SloshComparison, TrayEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import replay_bag
from slosh_testing.hearing_robot import HearingRobot
from slosh_testing.journaled import replayed_by_journal

CUP = "container: {shape: cylinder, radius: 0.03, fill_height: 0.05, rim_height: 0.1}\n"
TRAY = "containers:\n" + "".join(
    f"- {{name: {name}, model: cup.yaml, place: [{x}, 0.0, 0.0], limit: 0.02}}\n"
    for name, x in (("middle", 0.0), ("near", 0.1), ("far", 0.25))
)
STEP_NS = 4_000_000
EVERY = 4
"""Inputs from one image to the next."""


@pytest.fixture
def tray(tmp_path: Path) -> Path:
    (tmp_path / "cup.yaml").write_text(CUP)
    (tmp_path / "tray.yaml").write_text(TRAY)
    return tmp_path / "tray.yaml"


class Cameras:
    """Simulates two cameras on a turning tray, each of which reads a wave of its own."""

    def __init__(self, robot: HearingRobot) -> None:
        self.robot = robot
        self.imu = robot.node.create_publisher(Imu, topics.IMU, qos.STREAM_OUT)
        self.surfaces = {
            name: robot.node.create_publisher(
                FreeSurface, topics.of_container(topics.FREE_SURFACE, name), qos.STREAM_OUT
            )
            for name in ("near", "far")
        }
        self.compared = {
            name: robot.listen(SloshComparison, topics.of_container(topics.COMPARISON, name))
            for name in self.surfaces
        }
        self.told = robot.listen(TrayEstimate, topics.TRAY_ESTIMATE)
        self.events = robot.listen(LimitEvent, topics.LIMIT_EVENT, qos.EVENT)
        for publisher in (self.imu, *self.surfaces.values()):
            robot.until(lambda p=publisher: p.get_subscription_count() >= 2, publisher.topic)
        for name in self.surfaces:
            topic = topics.of_container(topics.COMPARISON, name)
            robot.until(lambda topic=topic: robot.node.count_subscribers(topic) >= 2, topic)

    def turn(self) -> None:
        """Turns the tray to and fro for a second and a half."""
        stamp_ns = time.time_ns()
        for k in range(375):
            stamp_ns += STEP_NS
            message = Imu()
            message.header.stamp = to_time(stamp_ns)
            message.linear_acceleration.z = 9.81
            message.angular_velocity.z = 1.5 * math.sin(20.0 * k * STEP_NS * 1e-9)
            self.imu.publish(message)
            if k % EVERY == 0:
                self.see(stamp_ns - STEP_NS // 2, k)
            self.robot.pace(k, stamp_ns)
        self.robot.finish(stamp_ns)

    def see(self, stamp_ns: int, k: int) -> None:
        for name, size in (("near", 0.004), ("far", 0.03)):
            height = size * (1.0 - math.cos(0.05 * k)) / 2.0
            surface = filled(FreeSurface, stamp_ns=stamp_ns, frame_id=name, msh=height)
            self.surfaces[name].publish(surface)


@pytest.mark.long
@pytest.mark.timeout(200)
def test_two_cameras_of_a_tray_over_dds_are_compared_and_replayed(
    tray: Path, tmp_path: Path, domain: int
) -> None:
    """Each camera is compared with its own container, and a replay gives the same numbers."""
    own = {
        "recorder": {"output": str(tmp_path / "bag")},
        "estimator": {
            "model": str(tray), "input": "imu", "max_age": "600.0", "check_input": "false",
        },
        "monitor": {"camera": "false", "cameras": "near,far"},
    }  # fmt: skip
    rclpy.init()
    robot = HearingRobot()
    try:
        with NodeGroup("/slosh", tmp_path / "logs", node_environment(domain)) as group:
            for name, given in own.items():
                group.start(NodeProcess(name, (), given))
            robot.await_ready(*own)
            cameras = Cameras(robot)
            cameras.turn()
            for name, compared in cameras.compared.items():
                robot.until(
                    lambda compared=compared: sum(not c.measured_stale for c in compared) > 60,
                    name,
                )
                assert {one.header.frame_id for one in compared} == {name}
            key = "camera of far: MAE NL [mm]"
            robot.until(lambda: float(robot.health["monitor"][1].get(key, "nan")) > 1.0, key)
            robot.until(lambda: bool(cameras.events), "an event")
        check(cameras, tmp_path / "bag")
    finally:
        robot.close()
        rclpy.shutdown()


def check(cameras: Cameras, bag: Path) -> None:
    """Compares the comparisons with the estimates of their containers, live and replayed."""
    stamps = np.array([to_nanoseconds(one.header.stamp) for one in cameras.told])
    for index, name in ((1, "near"), (2, "far")):
        heights = np.array([one.msh[index] for one in cameras.told])
        seen = [one for one in cameras.compared[name] if not one.measured_stale]
        at = np.array([to_nanoseconds(one.header.stamp) for one in seen])
        expected = np.interp((at - stamps[0]) * 1e-9, (stamps - stamps[0]) * 1e-9, heights)
        estimated = np.array([one.estimated_nonlinear for one in seen])
        known = np.isfinite(estimated)
        assert known.sum() > 60
        np.testing.assert_allclose(estimated[known], expected[known], atol=1e-9)
    high = [event for event in cameras.events if event.source == LimitEvent.SOURCE_MEASURED]
    assert {event.header.frame_id for event in high} == {"far"}
    assert all(event.description.startswith("container far: measured") for event in high)
    numbers = [event.id for event in cameras.events if event.kind == LimitEvent.KIND_START]
    assert len(set(numbers)) == len(numbers)
    verified = replayed_by_journal(bag).verified
    for name in (topics.TRAY_ESTIMATE, "comparison_near", "comparison_far"):
        assert verified[name].exact, verified[name].lines()
    assert verified["comparison_far"].recorded > 60
    assert_curves(bag, cameras)
    rows = {row.name: row for row in evaluate(read_run(RecordedRun(bag))).agreements}
    assert min(rows[f"camera of {name}"].count for name in ("near", "far")) > 60


def assert_curves(bag: Path, cameras: Cameras) -> None:
    """The report shows what each camera measured, and what was estimated for its container."""
    run = RecordedRun(bag)
    curves = {one.title: one for one in further_containers(run, replay_bag(run))}
    assert list(curves) == list(cameras.surfaces)
    for name, one in curves.items():
        seen = [each for each in cameras.compared[name] if not each.measured_stale]
        count = min(len(seen), len(one.t))
        assert count > 60
        known = [[each.measured, each.estimated_nonlinear] for each in seen[:count]]
        shown = np.column_stack((one.measured, one.nonlinear))[:count]
        np.testing.assert_array_equal(shown, known)
        assert one.limit == 0.02


def test_a_cell_file_gives_each_container_its_camera(tray: Path, tmp_path: Path) -> None:
    for name in ("middle", "far"):
        (tmp_path / f"{name}.yaml").write_text("")
    file = tmp_path / "cell.yaml"
    file.write_text(
        "model: tray.yaml\ncalibration: {middle: middle.yaml, far: far.yaml}\n"
        "remap: {camera_far/image_raw: /arm/second/image_raw}\n"
    )
    setup = read_setup(file)
    own = {process.name: process for process in setup.processes(tmp_path / "bag")}
    assert list(own) == ["recorder", "estimator", "camera", "camera_far", "monitor"]
    assert own["camera"].parameters == {"calibration": str(tmp_path / "middle.yaml")}
    assert own["camera_far"].parameters["container"] == "far"
    assert own["monitor"].parameters == {"cameras": "far"}
    assert "__node:=camera_far" in own["camera_far"].command("/slosh")
    assert own["camera_far"].remappings == {"camera_far/image_raw": "/arm/second/image_raw"}


@pytest.mark.parametrize(
    ("calibration", "why"),
    [
        ("{top: far.yaml}", "no container 'top' (known: middle, near, far)"),
        ("{far: no.yaml}", "no such file"),
        ("{far: 7}", "not a path"),
    ],
)
def test_a_wrong_camera_in_a_cell_file_is_named(
    tray: Path, tmp_path: Path, calibration: str, why: str
) -> None:
    (tmp_path / "far.yaml").write_text("")
    (tmp_path / "cell.yaml").write_text(f"model: tray.yaml\ncalibration: {calibration}\n")
    with pytest.raises(SloshBringupError) as told:
        read_setup(tmp_path / "cell.yaml")
    assert why in str(told.value)
    assert "\n" not in str(told.value)
