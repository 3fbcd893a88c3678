"""Tests the estimator and monitor nodes with real messages over DDS."""

import json
import math
import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import AccelStamped, PoseStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from slosh_estimator.nodes.estimator_node import EstimatorNode
from slosh_estimator.nodes.monitor_node import MonitorNode
from slosh_model.errors import ModelFileError
from slosh_model.model_text import parse_model
from slosh_msgs.msg import (
    ExpectedReading,
    FreeSurface,
    LimitEvent,
    NodeSettings,
    SloshComparison,
    SloshEstimate,
)
from slosh_msgs.srv import LoadModel
from slosh_msgs_py import qos, topics
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.stamps import to_nanoseconds, to_time
from slosh_testing.hearing_robot import Graph

MS = 1_000_000
TEXT = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.1}
damping_ratio: auto
effects: [{name: vertical_acceleration}]
"""


class Cell(Graph):
    """A node under test, and a node that exchanges messages with it."""

    def __init__(self) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.probe = self.node

    def now(self) -> int:
        return int(self.probe.get_clock().now().nanoseconds)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Cell]]:
    cells: list[Cell] = []

    def begin(**parameters: str) -> Cell:
        model = tmp_path / "model.yaml"
        model.write_text(TEXT)
        arguments = ["--ros-args"]
        for name, value in {"model": str(model), **parameters}.items():
            arguments += ["-p", f"{name}:={value}"]
        rclpy.init(args=arguments)
        cells.append(Cell())
        return cells[-1]

    yield begin
    for cell in cells:
        cell.close()
    rclpy.try_shutdown()


def accel(stamp_ns: int, ax: float, frame: str = "world") -> AccelStamped:
    message = AccelStamped()
    message.header.stamp = to_time(stamp_ns)
    message.header.frame_id = frame
    message.accel.linear.x = ax
    return message


def test_accelerations_in_estimates_out_and_faults_counted(start: Callable[..., Cell]) -> None:
    cell = start()
    cell.add(EstimatorNode())
    estimates = cell.listen(SloshEstimate, topics.ESTIMATE)
    publisher = cell.publisher(AccelStamped, topics.ACCEL)
    cell.until(lambda: cell.probe.count_publishers(topics.ESTIMATE) > 0)
    begin = cell.now()
    for k in range(1, 21):
        publisher.publish(accel(begin + k * MS, 2.0))
        cell.until(lambda k=k: len(estimates) >= k)
    publisher.publish(accel(begin + 20 * MS, 2.0))
    publisher.publish(accel(begin + 21 * MS, float("nan")))
    publisher.publish(accel(begin + 22 * MS, 2.0, "tool0"))
    publisher.publish(accel(begin + 23 * MS, 2.0))
    cell.until(lambda: len(estimates) == 21)
    last = estimates[-1]
    assert [to_nanoseconds(e.header.stamp) for e in estimates[:20]] == [
        begin + k * MS for k in range(1, 21)
    ]
    assert last.header.frame_id == "container"
    assert (last.linear.model, last.nonlinear.model) == ("3D-L", "3D-NL")
    assert (last.samples_used, last.samples_dropped) == (21, 3)
    assert last.linear.sh_x < 0.0
    assert last.surface_height == last.nonlinear.msh == last.height_along_wall
    assert last.distance_to_rim == pytest.approx(0.03 - last.nonlinear.msh)
    assert last.distance_along_wall == pytest.approx(last.distance_to_rim)
    assert last.contact_radius == 0.05
    assert last.linear.msh > last.nonlinear.msh > 0.0
    assert list(last.acceleration) == [2.0, 0.0, 0.0]
    assert len(last.linear.modal_position) == len(last.linear.modal_velocity) == 2


def test_imu_and_its_transform(start: Callable[..., Cell]) -> None:
    cell = start(input="imu", sensor_rotation="[3.141592653589793, 0.0, 0.0]")
    cell.add(EstimatorNode())
    estimates = cell.listen(SloshEstimate, topics.ESTIMATE)
    publisher = cell.publisher(Imu, topics.IMU)
    message = Imu()
    message.header.stamp = to_time(cell.now())
    message.linear_acceleration.x, message.linear_acceleration.z = 1.0, -9.81
    message.angular_velocity_covariance[0] = -1.0
    cell.until(lambda: cell.probe.count_publishers(topics.ESTIMATE) > 0)
    publisher.publish(message)
    cell.until(lambda: len(estimates) == 1)
    assert list(estimates[0].acceleration) == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)


def test_poses(start: Callable[..., Cell]) -> None:
    cell = start(input="pose", pose_window="0.04")
    cell.add(EstimatorNode())
    estimates = cell.listen(SloshEstimate, topics.ESTIMATE)
    publisher = cell.publisher(PoseStamped, topics.POSE)
    cell.until(lambda: cell.probe.count_publishers(topics.ESTIMATE) > 0)
    begin = cell.now()
    for k in range(6):
        message = PoseStamped()
        message.header.stamp = to_time(begin + 10 * k * MS)
        message.pose.position.x = 0.5 * 3.0 * (0.01 * k) ** 2
        publisher.publish(message)
    cell.until(lambda: len(estimates) == 2)
    assert to_nanoseconds(estimates[0].header.stamp) == begin + 20 * MS
    assert list(estimates[1].acceleration) == pytest.approx([3.0, 0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("wrong", [True, False])
def test_odometry_whose_twist_contradicts_its_pose_is_flagged(
    start: Callable[..., Cell], wrong: bool
) -> None:
    cell = start(input="odometry", world_frame="odom", max_age="600.0")
    cell.add(EstimatorNode())
    estimates = cell.listen(SloshEstimate, topics.ESTIMATE)
    publisher = cell.publisher(Odometry, topics.ODOMETRY)
    cell.until(lambda: cell.probe.count_publishers(topics.ESTIMATE) > 0)
    begin = cell.now() - 2000 * MS
    for k in range(101):  # along the parent's y axis, which is the vehicle's x axis
        message = Odometry(child_frame_id="container")
        message.header.stamp = to_time(begin + 20 * k * MS)
        message.header.frame_id = "odom"
        message.pose.pose.orientation.z = message.pose.pose.orientation.w = math.sqrt(0.5)
        message.pose.pose.position.y = 0.2 * (0.02 * k) ** 2
        twist = message.twist.twist.linear
        twist.x, twist.y = (0.0, 0.4 * 0.02 * k) if wrong else (0.4 * 0.02 * k, 0.0)
        publisher.publish(message)
        cell.until(lambda k=k: len(estimates) >= k - 20)
    flagged = [bool(e.flags & SloshEstimate.INPUT_CONTRADICTED) for e in estimates]
    assert (flagged[0], flagged[-1]) == (False, wrong)


def test_load_model_and_reset(start: Callable[..., Cell]) -> None:
    cell = start()
    cell.add(EstimatorNode())
    bad = cell.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request(text="container: 7"))
    assert not bad.success
    assert "container" in bad.message
    assert bad.models == "3D-L, 3D-NL"
    flat = TEXT.replace("{name: vertical_acceleration}", "")
    good = cell.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request(text=flat))
    assert good.success
    assert good.models == "2D-L, 2D-NL"
    assert not cell.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request()).success
    assert cell.call(Trigger, topics.RESET, Trigger.Request()).success


@pytest.mark.parametrize(
    ("name", "value"),
    [("max_gap", "-1.0"), ("input", "gyro"), ("max_age", "old"), ("model", "''")],
)
def test_a_bad_parameter_is_refused_by_name(
    start: Callable[..., Cell], name: str, value: str
) -> None:
    start(**{name: value})
    with pytest.raises((SloshMessageError, ModelFileError), match=name):
        EstimatorNode()


def test_the_estimator_says_why_nothing_drives_it(start: Callable[..., Cell]) -> None:
    cell = start()
    cell.add(EstimatorNode())
    reports = cell.listen(DiagnosticArray, "/diagnostics")

    def told(sentence: str) -> None:
        def heard() -> bool:
            words = [status.message for report in reports for status in report.status]
            return any("no usable input for" in word and sentence in word for word in words)

        cell.until(heard)

    told("/accel has no publisher")
    # One process may not use a topic with two types; two may.
    elsewhere = rclpy.Context()
    rclpy.init(context=elsewhere, domain_id=int(os.environ["ROS_DOMAIN_ID"]))
    other = Node("other", context=elsewhere)
    other.create_publisher(Imu, topics.ACCEL, qos.STREAM_OUT)
    told("/accel is published as sensor_msgs/msg/Imu, but must be geometry_msgs/msg/AccelStamped")
    other.destroy_node()
    rclpy.shutdown(context=elsewhere)
    publisher = cell.publisher(AccelStamped, topics.ACCEL)
    told("the publisher of /accel sends no messages")
    cell.until(
        lambda: publisher.publish(accel(cell.now() - 5000 * MS, 1.0)) or said_stale(reports)
    )


def said_stale(reports: list[Any]) -> bool:
    words = [status.message for report in reports for status in report.status]
    return any(
        "messages on /accel" in word and "are stale: their stamps are older than max_age" in word
        for word in words
    )


@pytest.mark.first(1)
@pytest.mark.parametrize(("shift", "way"), [(-100.0, "behind"), (100.0, "ahead of")])
def test_the_monitor_says_that_two_clocks_are_not_one(
    start: Callable[..., Cell], shift: float, way: str
) -> None:
    cell = start()
    cell.add(MonitorNode())
    reports = cell.listen(DiagnosticArray, "/diagnostics")
    estimates = cell.publisher(SloshEstimate, topics.ESTIMATE)
    surfaces = cell.publisher(FreeSurface, topics.FREE_SURFACE)

    def told() -> bool:
        estimate, surface = SloshEstimate(), FreeSurface(msh=0.001)
        estimate.header.stamp = to_time(cell.now())
        surface.header.stamp = to_time(cell.now() + round(shift * 1e9))
        estimates.publish(estimate)
        surfaces.publish(surface)
        return any(way in report.status[0].message for report in reports)

    cell.until(told)
    (status,) = next(r for r in reports if way in r.status[0].message).status
    assert status.level == b"\x02"
    assert status.message.startswith("BLIND")
    assert "nothing is compared; both must use the same clock" in status.message
    assert abs(float(status.message.split(" measurements are ")[1].split(" s ")[0]) - 100.0) < 5.0


def test_the_monitor_learns_the_rim_of_the_estimator_and_holds_the_liquid_to_it(
    start: Callable[..., Cell],
) -> None:
    cell = start()
    monitor = MonitorNode()
    cell.add(monitor)
    events = cell.listen(LimitEvent, topics.LIMIT_EVENT, qos.EVENT)
    told = cell.listen(NodeSettings, topics.SETTINGS, qos.EVENT)
    reports = cell.listen(DiagnosticArray, "/diagnostics")
    estimates = cell.publisher(SloshEstimate, topics.ESTIMATE)
    cup = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.08}"
    document = json.dumps({"parameters": {}, "topics": {}, "files": {"model": cup}})
    announced = cell.probe.create_publisher(NodeSettings, topics.SETTINGS, qos.EVENT)
    announced.publish(NodeSettings(node="estimator", document=document))
    cell.until(lambda: any("rim: 0.00999" in one.document for one in told))

    def spills() -> bool:
        estimate = SloshEstimate()
        estimate.header.stamp = to_time(cell.now())
        estimate.nonlinear.msh = 0.015  # above the rim, below the limit of 20 mm
        estimates.publish(estimate)
        return bool(events)

    cell.until(spills)
    assert events[0].limit == pytest.approx(0.01)
    assert "(rim 10.0 mm" in events[0].description
    cell.until(
        lambda: spills() and any("above the rim 10.0 mm" in r.status[0].message for r in reports)
    )
    (answer,) = monitor.set_parameters([Parameter("rim_distance", value=0.004)])
    assert answer.successful
    cell.until(lambda: spills() and any("rim: 0.00599" in one.document for one in told))
    cell.until(lambda: spills() and "rim limit 6.0 mm" in events[-1].description)
    monitor.set_parameters([Parameter("rim_distance", value=0.04)])
    cell.until(
        lambda: spills() and any("rim_distance: the dist" in r.status[0].message for r in reports)
    )


def test_the_monitor_compares_reports_events_and_tells_which_side_is_silent(
    start: Callable[..., Cell],
) -> None:
    cell = start()
    cell.add(MonitorNode())
    comparisons = cell.listen(SloshComparison, topics.COMPARISON)
    events = cell.listen(LimitEvent, topics.LIMIT_EVENT, qos.EVENT)
    estimates = cell.publisher(SloshEstimate, topics.ESTIMATE)
    surfaces = cell.publisher(FreeSurface, topics.FREE_SURFACE)
    cell.until(lambda: cell.probe.count_publishers(topics.COMPARISON) > 0)
    estimate, surface = SloshEstimate(), FreeSurface()
    surface.msh, surface.msh_stddev = 0.05, 1e-4
    estimate.linear.msh, estimate.nonlinear.msh = 0.047, 0.045

    def matched() -> list[Any]:
        return [c for c in comparisons if c.count]

    def both_speak() -> bool:
        stamp = to_time(cell.now())
        estimate.header.stamp = surface.header.stamp = stamp
        estimates.publish(estimate)
        surfaces.publish(surface)
        return bool(matched())

    cell.until(both_speak)
    first = matched()[0]
    assert first.residual_nonlinear == pytest.approx(0.005)
    assert first.state == SloshComparison.STATE_ERROR
    cell.until(lambda: len(events) >= 2)
    assert {e.source for e in events[:2]} == {
        LimitEvent.SOURCE_MEASURED,
        LimitEvent.SOURCE_ESTIMATED,
    }

    def only_the_estimate_speaks() -> bool:
        estimate.header.stamp = to_time(cell.now())
        estimates.publish(estimate)
        return bool(comparisons[-1].measured_stale)

    cell.until(only_the_estimate_speaks)
    assert not comparisons[-1].estimate_stale

    def only_the_camera_speaks() -> bool:
        surface.header.stamp = to_time(cell.now())
        surfaces.publish(surface)
        return bool(comparisons[-1].estimate_stale)

    cell.until(only_the_camera_speaks)
    assert comparisons[-1].measured == 0.05


def test_with_simulated_time_a_side_is_silent_by_that_time(start: Callable[..., Cell]) -> None:
    cell = start(use_sim_time="true", timeout="0.3")
    cell.add(MonitorNode())
    comparisons = cell.listen(SloshComparison, topics.COMPARISON)
    clock = cell.publisher(Clock, "/clock")
    measured = cell.publisher(FreeSurface, topics.FREE_SURFACE)
    estimated = cell.publisher(SloshEstimate, topics.ESTIMATE)
    cell.until(lambda: cell.probe.count_publishers(topics.COMPARISON) > 0)
    begin = 1_700_000_000_000 * MS

    def tell(offset_ms: int) -> None:
        clock.publish(Clock(clock=to_time(begin + offset_ms * MS)))
        cell.until(lambda: cell.now() == begin + offset_ms * MS)

    def speak(offset_ms: int) -> None:
        estimate = SloshEstimate()
        estimate.header.stamp = to_time(begin + offset_ms * MS)
        estimated.publish(estimate)
        surface = FreeSurface(msh=0.001)
        surface.header.stamp = estimate.header.stamp
        measured.publish(surface)

    tell(0)
    speak(0)
    cell.until(lambda: any(c.measured == 0.001 and not c.estimate_stale for c in comparisons))
    comparisons.clear()
    # A slow simulation: much time passes here, little there.
    for step in range(1, 9):
        tell(5 * step)
        patience = time.monotonic() + 0.1
        cell.until(lambda patience=patience: time.monotonic() > patience)
    # One that stands is told; neither side is silent.
    assert {c.state for c in comparisons} <= {SloshComparison.STATE_BLIND}
    comparisons.clear()
    tell(250)
    speak(250)
    cell.until(lambda: any(not c.measured_stale for c in comparisons))
    # A fast one: a moment here is a long silence there.
    tell(5000)
    estimated.publish(SloshEstimate(header=Header(stamp=to_time(begin + 5000 * MS))))
    cell.until(lambda: any(c.measured_stale for c in comparisons))
    said = cell.listen(DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS)
    cell.until(lambda: any("no advancing" in status.message for m in said for status in m.status))


def test_late_joiners_learn_what_the_models_work_with(start: Callable[..., Cell]) -> None:
    cell = start(max_gap="0.02")
    cell.add(EstimatorNode())
    publisher = cell.publisher(AccelStamped, topics.ACCEL)
    estimates = cell.listen(SloshEstimate, topics.ESTIMATE)
    cell.until(lambda: cell.probe.count_publishers(topics.ESTIMATE) > 0)
    stamp = cell.now()
    publisher.publish(accel(stamp, 2.0))
    cell.until(lambda: len(estimates) == 1)
    announced = cell.listen(NodeSettings, topics.SETTINGS, qos.EVENT)
    cell.until(lambda: len(announced) == 1)
    document = yaml.safe_load(announced[0].document)
    assert announced[0].node == "estimator"
    assert to_nanoseconds(announced[0].header.stamp) == 0
    assert document["parameters"]["max_gap"] == 0.02
    assert parse_model(document["files"]["model"]) == parse_model(TEXT)

    request = LoadModel.Request(text=TEXT.replace("0.07", "0.06"))
    assert cell.call(LoadModel, topics.LOAD_MODEL, request).success
    cell.until(lambda: len(announced) == 2)
    assert parse_model(yaml.safe_load(announced[1].document)["files"]["model"]) == parse_model(
        request.text
    )
    assert to_nanoseconds(announced[1].header.stamp) == stamp  # from the next sample on
    assert cell.call(Trigger, topics.RESET, Trigger.Request()).success
    cell.until(lambda: len(announced) == 3)


def test_the_monitor_warns_of_a_motion_that_the_model_does_not_describe(
    start: Callable[..., Cell],
) -> None:
    cell = start()
    cell.add(MonitorNode())
    reports = cell.listen(DiagnosticArray, "/diagnostics")
    comparisons = cell.listen(SloshComparison, topics.COMPARISON)
    estimates = cell.publisher(SloshEstimate, topics.ESTIMATE)
    surfaces = cell.publisher(FreeSurface, topics.FREE_SURFACE)
    cell.until(lambda: cell.probe.count_publishers(topics.COMPARISON) > 0)
    estimate, surface = SloshEstimate(), FreeSurface()
    surface.msh, surface.msh_stddev, estimate.nonlinear.msh = 0.012, 1e-4, 0.007
    begin = cell.now()
    step = 0

    def warned() -> bool:
        """Sends a motion of 2 s and a rest; returns whether the monitor warned."""
        nonlocal step
        if len(comparisons) >= step:
            step += 1
        stamp = to_time(begin + step * 50 * MS)
        estimate.header.stamp = surface.header.stamp = stamp
        estimate.acceleration[0] = 2.0 if step < 40 else 0.0
        estimates.publish(estimate)
        surfaces.publish(surface)
        return any("slosh discover" in entry.status[0].message for entry in reports)

    cell.until(warned)
    (status,) = next(r for r in reports if "slosh discover" in r.status[0].message).status
    assert status.level == b"\x01"
    facts = {pair.key: pair.value for pair in status.values}
    assert facts["motions"] == facts["motions that disagree"] == "1"


PLAIN = "container: {radius: 0.05, fill_height: 0.07}"
FOUND = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.1}
damping_ratio: auto
effects:
  - name: vertical_acceleration
  - name: gravity_tilt
  - {name: height_scale, gain: 1.25}
  - {name: time_offset, tau: -0.02}
"""


def test_a_found_model_is_loaded_and_acts_on_the_liquid_and_on_the_comparison(
    start: Callable[..., Cell],
) -> None:
    cell = start(input="pose", pose_window="0.04")
    cell.add(EstimatorNode())
    cell.add(MonitorNode())
    estimates = cell.listen(SloshEstimate, topics.ESTIMATE)
    readings = cell.listen(ExpectedReading, topics.EXPECTED_READING)
    comparisons = cell.listen(SloshComparison, topics.COMPARISON)
    poses = cell.publisher(PoseStamped, topics.POSE)
    surfaces = cell.publisher(FreeSurface, topics.FREE_SURFACE)
    for topic in (topics.ESTIMATE, topics.EXPECTED_READING, topics.COMPARISON):
        cell.until(lambda topic=topic: cell.probe.count_publishers(topic) > 0)
    begin, sent = cell.now(), 0

    def tilt(count: int) -> None:
        """Sends poses of a container that tilts by half a degree every 10 ms."""
        nonlocal sent
        for _ in range(count):
            before, half = len(estimates), 0.004 * max(sent - 20, 0)
            message = PoseStamped()
            message.header.stamp = to_time(begin + 10 * sent * MS)
            message.pose.orientation.y, message.pose.orientation.w = math.sin(half), math.cos(half)
            poses.publish(message)
            sent += 1
            if sent >= 5:
                cell.until(lambda before=before: len(estimates) > before)

    tilt(20)
    # The model file has no gravity_tilt: the node adds it where poses tell the attitude.
    assert estimates[-1].nonlinear.model == "3D-NL+gravity_tilt"
    assert estimates[-1].nonlinear.msh < 1e-9
    assert readings == []
    plain = cell.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request(text=PLAIN))
    assert "gravity_tilt is added to the model" in plain.message
    assert plain.models == "2D-L+gravity_tilt, 2D-NL+gravity_tilt"
    loaded = cell.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request(text=FOUND))
    assert loaded.success
    assert loaded.message == "loaded; the models start from rest"
    names = ("3D-L", "3D-NL")
    added = "+gravity_tilt+height_scale+time_offset"
    assert loaded.models == ", ".join(name + added for name in names)
    tilt(30)
    cell.until(lambda: len(readings) == 30)
    last, reading = estimates[-1], readings[-1]
    assert (last.linear.model, last.nonlinear.model) == tuple(name + added for name in names)
    assert last.nonlinear.msh > 1e-3
    assert last.nonlinear.sh_x > 0.0  # the container's x axis points down
    assert reading.header == last.header
    assert reading.nonlinear == pytest.approx(1.25 * last.nonlinear.msh, rel=1e-12)
    assert reading.linear == pytest.approx(1.25 * last.linear.msh, rel=1e-12)
    assert reading.delay == -0.02
    # The picture stamped 20 ms before that estimate shows what it tells.
    surface = FreeSurface(msh=reading.nonlinear)
    surface.header.stamp = to_time(to_nanoseconds(last.header.stamp) - 20 * MS)
    surfaces.publish(surface)
    cell.until(lambda: any(comparison.count for comparison in comparisons))
    (comparison,) = (comparison for comparison in comparisons if comparison.count)
    assert comparison.header.stamp == surface.header.stamp
    assert comparison.residual_nonlinear == 0.0
    assert comparison.estimated_linear == reading.linear


def test_a_model_that_needs_an_attitude_says_so_where_there_is_none(
    start: Callable[..., Cell],
) -> None:
    cell = start()
    cell.add(EstimatorNode())
    reports = cell.listen(DiagnosticArray, "/diagnostics")
    publisher = cell.publisher(AccelStamped, topics.ACCEL)
    loaded = cell.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request(text=FOUND))
    assert loaded.success
    sentence = "gravity_tilt has no effect with the input 'accel'"
    assert sentence in loaded.message

    def warned() -> bool:
        publisher.publish(accel(cell.now(), 0.0))
        return any(entry.status[0].message.startswith(sentence) for entry in reports)

    cell.until(warned)
    plain = cell.call(LoadModel, topics.LOAD_MODEL, LoadModel.Request(text=TEXT))
    assert plain.message == "loaded; the models start from rest"
