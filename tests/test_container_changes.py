"""Tests a filling line: containers change while a cell runs, records and is replayed."""

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import AccelStamped
from sensor_msgs.msg import Imu

from slosh_bag.reader import BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.processes import NodeGroup, NodeProcess, config_folder, node_environment
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_estimator.comparison import Condition
from slosh_estimator.validity import EstimateFlag
from slosh_model.model_text import parse_model
from slosh_msgs.msg import TrayEstimate
from slosh_msgs.srv import ChangeContainer, PredictSlosh
from slosh_msgs_py import qos, topics
from slosh_msgs_py.images import image_message
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_plan import HeightLimits, Trajectory, predict
from slosh_testing.hearing_robot import HearingRobot
from slosh_testing.journaled import assert_same_by_journal, replayed_by_journal
from slosh_testing.robot import nodes_and_robot

pytestmark = [pytest.mark.timeout(200), pytest.mark.long]
CUP = "container: {shape: cylinder, radius: 0.04, fill_height: 0.06, rim_height: 0.09}\n"
MUG = "container: {shape: cylinder, radius: 0.05, fill_height: 0.05, rim_height: 0.08}\n"
NODES = ("recorder", "estimator", "monitor", "predictor", "planner")
STEP_NS = SECOND // 250
FILLS = (0.040, 0.045, 0.050)


@pytest.fixture
def line(tmp_path: Path, domain: int) -> Iterator[HearingRobot]:
    """Runs the nodes of a cell without a camera, and the robot of a filling line."""
    (tmp_path / "cup.yaml").write_text(CUP)
    (tmp_path / "mug.yaml").write_text(MUG)
    model = {"model": str(tmp_path / "cup.yaml")}
    own = {
        "recorder": {"output": str(tmp_path / "bag")},
        "estimator": {**model, "containers": str(tmp_path), "max_age": "600.0"},
        "monitor": {"camera": "false"},
        "predictor": model,
        "planner": model,
    }
    rclpy.init()
    robot = HearingRobot()
    try:
        with NodeGroup("/slosh", tmp_path / "logs", node_environment(domain)) as group:
            for name in NODES:
                group.start(NodeProcess(name, (), own[name]))
            robot.await_ready(*NODES)
            yield robot
    finally:
        robot.close()
        rclpy.shutdown()


class Shift:
    """Publishes inputs in real time, and collects the messages about the containers."""

    def __init__(self, robot: HearingRobot) -> None:
        self.robot = robot
        self._publisher = robot.node.create_publisher(AccelStamped, topics.ACCEL, qos.STREAM_OUT)
        robot.until(lambda: self._publisher.get_subscription_count() >= 2, "two readers")
        self.stamp_ns = time.time_ns()

    def move(self, seconds: float, size: float) -> None:
        """Publishes a push and back, from rest to rest."""
        count = round(seconds * SECOND / STEP_NS)
        for k in range(count):
            self.stamp_ns += STEP_NS
            message = AccelStamped()
            message.header.stamp, message.header.frame_id = to_time(self.stamp_ns), "world"
            message.accel.linear.x = size * math.sin(2.0 * math.pi * k / count)
            self._publisher.publish(message)
            self.robot.pace(k, self.stamp_ns)
        self.robot.finish(self.stamp_ns)

    def change(self, **fields: Any) -> None:
        request = ChangeContainer.Request(stamp=to_time(self.stamp_ns), **fields)
        answer = self.robot.call(ChangeContainer, topics.CHANGE_CONTAINER, request)
        assert answer.success, answer.message


def test_a_tray_over_dds_names_the_worst_and_is_replayed(tmp_path: Path, domain: int) -> None:
    """One IMU, three cups: the tray turns, and the cup farthest out is nearest to its limit.

    Then a mug with another rim takes its place, while the cell runs.
    """
    (tmp_path / "cup.yaml").write_text(CUP)
    (tmp_path / "mug.yaml").write_text(MUG)
    entries = (("middle", 0.0, 0.03), ("near", 0.05, 0.03), ("far", 0.25, 0.02))
    text = "".join(
        f"- {{name: {name}, model: cup.yaml, place: [{x}, 0.0, 0.0], limit: {limit}}}\n"
        for name, x, limit in entries
    )
    (tmp_path / "tray.yaml").write_text(f"containers:\n{text}")
    own = {
        "recorder": {"output": str(tmp_path / "bag")},
        "estimator": {
            "model": str(tmp_path / "tray.yaml"), "input": "imu", "max_age": "600.0",
            "check_input": "false", "containers": str(tmp_path),
        },
        "monitor": {"camera": "false"},
    }  # fmt: skip
    rclpy.init()
    robot = HearingRobot()
    trays = robot.listen(TrayEstimate, topics.TRAY_ESTIMATE)
    try:
        with NodeGroup("/slosh", tmp_path / "logs", node_environment(domain)) as group:
            for name, given in own.items():
                group.start(NodeProcess(name, (), given))
            robot.await_ready(*own)
            imu = robot.node.create_publisher(Imu, topics.IMU, qos.STREAM_OUT)
            robot.until(lambda: imu.get_subscription_count() >= 2, "two readers")
            last_ns = turn(robot, imu)
            worst = "worst container"
            robot.until(lambda: robot.health["monitor"][1].get(worst) == "far", "the worst")
            assert list(trays[-1].containers) == ["middle", "near", "far"]
            highest = max(trays, key=lambda told: told.msh[2])
            assert highest.worst == 2
            assert highest.msh[0] < highest.msh[1] < highest.msh[2]
            change = ChangeContainer.Request(tray_place="far", name="mug", limit=0.5)
            answer = robot.call(ChangeContainer, topics.CHANGE_CONTAINER, change)
            assert answer.success, answer.message
            turn(robot, imu, last_ns)
            far = lambda: robot.health["monitor"][1].get("container far", "")  # noqa: E731
            robot.until(lambda: far().endswith("rim 30.0 mm"), "the mug's rim")
        assert_same_by_journal(tmp_path / "bag")
        verified = replayed_by_journal(tmp_path / "bag").verified
        for name in (topics.ESTIMATE, topics.TRAY_ESTIMATE):
            assert verified[name].exact, verified[name].lines()
    finally:
        robot.close()
        rclpy.shutdown()


def turn(robot: HearingRobot, publisher: Any, after_ns: int = 0) -> int:
    """Turns the tray to and fro about its axis for a second; returns the last stamp [ns]."""
    stamp_ns = max(time.time_ns(), after_ns)
    for k in range(250):
        stamp_ns += STEP_NS
        message = Imu()
        message.header.stamp = to_time(stamp_ns)
        message.linear_acceleration.z = 9.81
        message.angular_velocity.z = 1.5 * math.sin(20.0 * k * STEP_NS * 1e-9)
        publisher.publish(message)
        robot.pace(k, stamp_ns)
    robot.finish(stamp_ns)
    return stamp_ns


def predicted_peak(robot: HearingRobot) -> PredictSlosh.Response:
    t = np.linspace(0.0, 0.5, 251)
    push = (3.0 * np.sin(4.0 * np.pi * t)).tolist()
    none = [0.0] * len(t)
    return robot.call(
        PredictSlosh,
        topics.PREDICT,
        PredictSlosh.Request(
            time=t.tolist(), acceleration_x=push, acceleration_y=none, acceleration_z=none,
            limit=math.nan,
        ),
    )  # fmt: skip


def peak_of(text: str, fill: float) -> float:
    t = np.linspace(0.0, 0.5, 251)
    motion = Trajectory(t, np.outer(3.0 * np.sin(4.0 * np.pi * t), (1.0, 0.0, 0.0)))
    model = parse_model(text).filled_to(fill)
    return predict(model, motion, limits=HeightLimits())[0].nonlinear.peak


def test_each_cycle_of_a_filling_line_reaches_all_nodes_and_is_replayed(
    line: HearingRobot, tmp_path: Path
) -> None:
    shift = Shift(line)
    for fill in FILLS:
        shift.change(name="mug", fill_height=fill, limit=0.015)
        line.until(
            lambda fill=fill: (
                f"filled to {1e3 * fill:g} mm" in line.health["predictor"][1].get("container", "")
            )
        )
        assert predicted_peak(line).peak_nonlinear == peak_of(MUG, fill)
        shift.move(0.4, 3.0)
        shift.change(empty=True)
        shift.move(0.2, 2.0)
        shift.move(0.1, 0.0)
    line.until(lambda: not predicted_peak(line).success)
    line.until(lambda: "gripper is empty" in line.health["planner"][0], "the planner")
    for _ in range(100):  # a robot that is silent makes the monitor stale
        shift.move(0.2, 0.0)
        if "gripper is empty" in line.health["monitor"][0]:
            break
    else:
        pytest.fail(line.health["monitor"][0])
    flags = np.array([one.flags for one in line.estimates])
    assert not (flags & EstimateFlag.SETTLING).any()  # each was picked up at rest
    assert (flags & EstimateFlag.NO_CONTAINER).any()
    check(tmp_path / "bag", len(FILLS))


def check(bag: Path, cycles: int) -> None:
    """Checks that the recording has every change and replays bit for bit."""
    wait = time.monotonic() + 20.0
    while True:
        reader = BagReader(bag)
        told = [reader.decode(one) for one in reader.messages(["/slosh/container"])]
        if len(told) > 2 * cycles or time.monotonic() > wait:
            break
    assert [one.present for one in told] == [True, *[True, False] * cycles]
    assert [one.fill_height for one in told[1::2]] == list(FILLS)
    assert_same_by_journal(bag, ("estimator", "monitor"))
    found = replayed_by_journal(bag).verification
    assert found is not None
    assert found.exact, found.lines()
    stamps = [to_nanoseconds(one.header.stamp) for one in told]
    assert stamps == sorted(stamps)


def test_a_camera_that_contradicts_the_fill_says_so_within_two_seconds_of_rest(
    tmp_path: Path, domain: int
) -> None:
    view = read_calibration(config_folder() / "camera.yaml").view
    still, random = CupRenderer(view).render(0, 0), np.random.default_rng(3)
    picture = image_message(still, "mono8", 0, "camera")

    def noisy(said: bool) -> bool:
        """No two images are the same."""
        noise = random.integers(-2, 3, size=still.shape, dtype=np.int16)
        pixels = np.clip(still + noise, 0, 255).astype(np.uint8)
        robot.picture = image_message(pixels, "mono8", 0, "camera")
        return said

    with nodes_and_robot(tmp_path, domain, picture=picture) as (_, robot):
        end = time.monotonic() + 3.0
        robot.until(lambda: noisy(time.monotonic() > end), "the time")
        assert "fill height" not in robot.health["monitor"][1]
        fill = view.cup.fill_height + 0.006
        told = robot.call(ChangeContainer, topics.CHANGE_CONTAINER, fill_height=fill)
        assert told.success, told.message
        first = len(robot.comparisons)
        # The monitor's state is in each comparison; its sentence comes once a second.
        robot.until(lambda: noisy(robot.comparisons[-1].state == Condition.WARN), "a warning")
        seen = [one for one in robot.comparisons[first:] if one.measured < -3e-3]
        stamps = [to_nanoseconds(one.header.stamp) for one in seen]
        robot.until(lambda: noisy("-6.0 ±" in robot.health["monitor"][1]), "the level in words")
        assert "check the fill height" in robot.health["monitor"][1]
        robot.until(lambda: noisy("that was set" in robot.health["camera"][1]), "the camera")
        robot.call(ChangeContainer, topics.CHANGE_CONTAINER, fill_height=fill - 0.006)
        robot.until(lambda: noisy(robot.comparisons[-1].state == Condition.OK), "agreement")
    assert stamps[-1] - stamps[0] < 2 * SECOND
