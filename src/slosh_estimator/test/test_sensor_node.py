"""Tests the sensor node over DDS: it converts forces and levels to FreeSurface messages."""

import json
import math
from collections.abc import Iterator

import pytest
import rclpy
from geometry_msgs.msg import PointStamped, Twist, WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import Range

from slosh_estimator.nodes.sensor_node import SensorNode
from slosh_estimator.observer.surface_heights import SurfaceHeights, wall_heights
from slosh_estimator.sensed.level import LevelPlace, wall_factor
from slosh_model.model_text import parse_model
from slosh_msgs.msg import FreeSurface, NodeSettings, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import ERROR, OK
from slosh_msgs_py.stamps import to_time
from slosh_testing.hearing_robot import Graph

MS = 1_000_000
MODEL = "container: {shape: cylinder, radius: 0.05, fill_height: 0.07}\n"
START = 1000 * 1_000_000_000
OMEGA, SLOSHING, MASS = 18.9, 0.17, 1.0
PAYLOAD = {
    "natural_frequency": {"value": OMEGA}, "sloshing_mass": {"value": SLOSHING},
    "payload_mass": {"value": MASS, "error": 0.002}, "delay": {"value": 0.0},
    "directions": [{"container": [1, 0, 0], "sensor": [0, -1, 0]}],
    "residual_at_rest": 0.01, "residual_in_motion": 0.02,
}  # fmt: skip


class Cell(Graph):
    """The sensor node, with simulated estimator messages and a simulated sensor."""

    def __init__(self) -> None:
        super().__init__(executor=SingleThreadedExecutor())
        self.sensor = self.add(SensorNode())
        self.surfaces = self.listen(FreeSurface, topics.FREE_SURFACE)
        self.beside = self.listen(FreeSurface, topics.SENSED_SURFACE)
        self.stamped = self.listen(WrenchStamped, topics.FORCE)
        settings = self.publisher(NodeSettings, topics.SETTINGS, qos.EVENT)
        message = NodeSettings(node="estimator")
        message.document = json.dumps({"files": {"model": MODEL}})
        settings.publish(message)


@pytest.fixture
def cell(request, tmp_path) -> Iterator[Cell]:
    path = tmp_path / "identification.json"
    path.write_text(json.dumps(PAYLOAD))
    given = {"payload": path, **getattr(request, "param", {})}
    words = [word for name, value in given.items() for word in ("-p", f"{name}:={value}")]
    rclpy.init(args=["--ros-args", *words])
    cell = Cell()
    cell.until(lambda: cell.sensor._model is not None, "the model")
    yield cell
    cell.close()
    rclpy.try_shutdown()


def heights_of(surface):
    fields = (getattr(surface, name) for name in SurfaceHeights._fields)
    return wall_heights(0, SurfaceHeights(*fields)).points


def test_a_force_that_sways_is_a_wave_that_sways(cell):
    motion = cell.publisher(SloshEstimate, topics.ESTIMATE)
    sensor = cell.publisher(WrenchStamped, topics.FORCE)
    amplitude = 0.3  # N
    for k in range(0, 2500, 4):
        stamp = to_time(START + k * MS)
        estimate, wrench = SloshEstimate(), WrenchStamped()
        estimate.header.stamp = wrench.header.stamp = stamp
        wrench.wrench.force.y = 2.0 + amplitude * math.sin(OMEGA * 1e-3 * k)
        motion.publish(estimate)
        sensor.publish(wrench)
        if k % 40 == 0:
            cell.until(lambda k=k: cell.sensor._report.counts["force"] > k // 4, "the force")
    cell.until(lambda: len(cell.surfaces) > 30, "surfaces")
    parsed = parse_model(MODEL).nonlinear()
    expected = amplitude / (SLOSHING * OMEGA**2) * parsed.height_gains()[0]
    late = cell.surfaces[10:]
    assert max(one.msh for one in late) == pytest.approx(expected, rel=0.1)
    # The sensor's -y is the container's +x, and the liquid pulls where it is.
    for one in late:
        at = one.header.stamp.sec + 1e-9 * one.header.stamp.nanosec - START * 1e-9
        height = expected * math.sin(OMEGA * at)
        assert one.sh_right == pytest.approx(height, abs=0.25 * expected)
        points = heights_of(one)
        assert sorted(points[:, 1].tolist()) == pytest.approx(
            sorted((one.sh_right, -one.sh_right))
        )
    assert not cell.beside


@pytest.mark.parametrize(
    "cell",
    [{"unstamped_force": "robot/force", "unstamped_type": "twist", "beside_camera": True}],
    indirect=True,
)
def test_a_twist_without_a_stamp_is_stamped_for_the_recorder(cell):
    sensor = cell.publisher(Twist, "robot/force", qos.STREAM_OUT)
    message = Twist()
    message.linear.x = 3.0
    sensor.publish(message)
    cell.until(lambda: cell.stamped, "the stamped force")
    assert cell.stamped[0].wrench.force.x == 3.0
    assert cell.stamped[0].header.stamp.sec > 0


@pytest.mark.parametrize(
    "cell",
    [{"payload": '""', "level_distance": 0.1, "level_place": "[0.0, 0.03]"}],
    indirect=True,
)
def test_level_sensors_tell_the_wall_s_height_at_their_place(cell):
    ranges = cell.publisher(Range, topics.LEVEL)
    points = cell.publisher(PointStamped, topics.LEVEL_POINT)
    factor = wall_factor(parse_model(MODEL), LevelPlace(0.0, 0.03))
    for distance in (math.inf, 0.001, 0.095):  # nothing seen, too near, 5 mm above
        ranges.publish(Range(range=distance, min_range=0.02, max_range=1.0))
    cell.until(lambda: cell.surfaces, "a surface")
    (point,) = heights_of(cell.surfaces[0]).tolist()
    assert point[:2] == pytest.approx([0.5 * math.pi, factor * 0.005], rel=1e-5)
    assert 1.0 < factor < 1.5
    message = PointStamped()
    message.point.x, message.point.z = -0.05, -0.002
    points.publish(message)
    cell.until(lambda: len(cell.surfaces) > 1, "the other surface")
    (point,) = heights_of(cell.surfaces[1]).tolist()
    assert point[:2] == pytest.approx([math.pi, -0.002])
    message.point.x = 0.0
    points.publish(message)
    cell.until(lambda: cell.sensor._failure, "the failure")
    assert "mount it near the wall" in cell.sensor._failure


@pytest.mark.parametrize(
    "cell", [{"payload": '""', "level_distance": 0.1, "level_place": "[0.0, 0.03]"}], indirect=True
)
def test_a_level_in_millimetres_is_named_and_not_told(cell):
    ranges = cell.publisher(Range, topics.LEVEL)
    points = cell.publisher(PointStamped, topics.LEVEL_POINT)
    ranges.publish(Range(range=95.0, min_range=20.0, max_range=1000.0))
    cell.until(lambda: cell.sensor._failure, "the failure")
    assert cell.sensor._health()[0] == ERROR
    message = PointStamped()
    message.point.x, message.point.z = 0.04, 5.0
    points.publish(message)
    cell.until(lambda: "5 m is not in the container" in cell.sensor._failure, "the failure")
    assert "is the sensor's value in mm?" in cell.sensor._failure
    assert not cell.surfaces
    message.point.z = 0.005
    points.publish(message)
    cell.until(lambda: cell.surfaces, "a surface")
    assert not cell.sensor._failure
    assert cell.sensor._health()[0] == OK


def test_forces_that_are_no_numbers_are_named(cell):
    sensor = cell.publisher(WrenchStamped, topics.FORCE)
    wrench = WrenchStamped()
    wrench.wrench.force.x = math.nan
    for _ in range(5):
        sensor.publish(wrench)
    cell.until(lambda: cell.sensor._report.counts["force"] >= 5, "the forces")
    level, text = cell.sensor._health()
    assert level == ERROR
    assert "not finite, or not in order" in text
