"""The markers node over DDS: what RViz and Foxglove are given."""

import json
import math

import numpy as np
import pytest
import rclpy
from visualization_msgs.msg import Marker, MarkerArray

from slosh_bringup.errors import SloshBringupError
from slosh_bringup.launched_cell import LaunchedCell
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.nodes.markers_node import COLOURS, CREST, GREY, LIMIT, SURFACE, MarkersNode
from slosh_model import format_model
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_msgs.msg import (
    ContainerChange,
    ModelEstimate,
    NodeSettings,
    SloshComparison,
    SloshEstimate,
)
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.node.diagnostics import OK, WARN
from slosh_testing.hearing_robot import Graph

CELL = "/line_1"
CUP = Model(Cylinder(0.05, 0.07))


@pytest.fixture
def graph():
    rclpy.init()
    made = Graph(namespace=CELL)
    yield made
    made.close()
    rclpy.try_shutdown()


@pytest.fixture
def cell(graph):
    """Provides a running markers node and publishers of its inputs."""
    node = graph.with_parameters(MarkersNode, CELL, rate=60.0)
    heard = graph.listen(MarkerArray, topics.MARKERS)
    topic = {
        kind: graph.publisher(kind, name, profile)
        for kind, name, profile in (
            (NodeSettings, topics.SETTINGS, qos.EVENT),
            (ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM),
            (SloshComparison, topics.COMPARISON, qos.STREAM_OUT),
            (SloshEstimate, topics.ESTIMATE, qos.STREAM_OUT),
        )
    }
    return graph, node, heard, topic


def estimate(sh_x=0.003, sh_y=0.004):
    found = filled(
        ModelEstimate, model="3D-NL", sh_x=sh_x, sh_y=sh_y, msh=math.hypot(sh_x, sh_y),
        azimuth=math.atan2(sh_y, sh_x),
    )  # fmt: skip
    message = filled(SloshEstimate, stamp_ns=5_000, frame_id="container")
    message.nonlinear = found
    return message


def tell(topic, node, parameters=(), files=()):
    document = json.dumps({"parameters": dict(parameters), "files": dict(files)})
    topic[NodeSettings].publish(NodeSettings(node=node, document=document))


def shown(cell, wanted, **state):
    """Waits for markers that satisfy a condition and returns them."""
    graph, _, heard, topic = cell
    heard.clear()

    def come():
        topic[SloshEstimate].publish(estimate(**state))
        return heard and wanted({marker.id: marker for marker in heard[-1].markers})

    graph.until(come, "the markers")
    return {marker.id: marker for marker in heard[-1].markers}


def test_the_surface_is_tilted_and_the_limit_is_at_the_wall(cell):
    _, node, _, topic = cell
    assert node._health()[0] == WARN
    tell(topic, "estimator", files={"model": format_model(CUP)})
    tell(topic, "monitor", {"measured_limit": 0.02, "estimated_limit": 0.015})
    topic[SloshComparison].publish(SloshComparison(state=SloshComparison.STATE_WARN))
    red_green_blue = COLOURS[SloshComparison.STATE_WARN]
    found = shown(
        cell,
        lambda m: m[LIMIT].points and m[SURFACE].color.r == pytest.approx(red_green_blue[0]),
    )
    assert {marker.header.frame_id for marker in found.values()} == {"container"}
    assert {marker.header.stamp.nanosec for marker in found.values()} == {5_000}
    surface = np.array([[p.x, p.y, p.z] for p in found[SURFACE].points])
    assert len(surface) % 3 == 0
    highest = surface[surface[:, 2].argmax()]
    assert highest[2] == pytest.approx(0.005, rel=0.01)
    assert math.atan2(highest[1], highest[0]) == pytest.approx(math.atan2(4.0, 3.0), abs=0.1)
    crest = found[CREST].pose.position
    assert (crest.x, crest.y, crest.z) == pytest.approx((0.03, 0.04, 0.005), rel=0.01)
    ring = np.array([[p.x, p.y, p.z] for p in found[LIMIT].points])
    np.testing.assert_allclose(np.hypot(ring[:, 0], ring[:, 1]), 0.05)
    np.testing.assert_array_equal(ring[:, 2], 0.015)  # the lower of the two
    np.testing.assert_array_equal(ring[0], ring[-1])
    assert node._health()[0] == OK


def test_another_container_and_none_are_followed(cell):
    _, _, _, topic = cell
    tell(topic, "estimator", files={"model": format_model(CUP)})
    found = shown(cell, lambda m: SURFACE in m)
    assert found[LIMIT].action == Marker.DELETE
    assert found[SURFACE].color.g == pytest.approx(GREY[1])
    wide = format_model(Model(Cylinder(0.08, 0.07)))
    topic[ContainerChange].publish(
        filled(ContainerChange, present=True, model=wide, limit=0.03, fill_height=0.07)
    )
    found = shown(cell, lambda m: SURFACE in m and m[LIMIT].points)
    assert max(p.x for p in found[LIMIT].points) == pytest.approx(0.08, rel=0.01)
    assert found[LIMIT].points[0].z == 0.03
    topic[ContainerChange].publish(filled(ContainerChange, present=False))
    (cleared,) = shown(cell, lambda m: len(m) == 1).values()
    assert cleared.action == Marker.DELETEALL


def test_what_is_unknown_is_not_shown(cell):
    _, node, _, topic = cell
    tell(topic, "estimator", files={"model": "no: model"})
    tell(topic, "estimator", files={"model": format_model(CUP)})
    (cleared,) = shown(cell, len, sh_x=math.nan).values()
    assert cleared.action == Marker.DELETEALL
    assert node.faults.total == 1


def test_a_cell_file_and_a_launch_start_the_node(tmp_path):
    from datetime import datetime

    (tmp_path / "model.yaml").write_text("")
    path = tmp_path / "cell.yaml"
    path.write_text("model: model.yaml\ncamera: none\nmarkers: true\nhardware_id: SN 42\n")
    setup = read_setup(path)
    assert "markers" in [one.name for one in setup.processes(tmp_path / "bag")]
    assert setup.hardware_id == "SN 42"
    launched = LaunchedCell({"record": "false", "markers": "true"}, datetime(2026, 11, 26), print)
    assert "markers" in [process.name for process in launched.processes]
    for line in ("markers: maybe", "hardware_id: [1]"):
        path.write_text(f"model: model.yaml\ncamera: none\n{line}\n")
        with pytest.raises(SloshBringupError, match=rf"cell\.yaml:3: {line.split(':')[0]} = "):
            read_setup(path)
