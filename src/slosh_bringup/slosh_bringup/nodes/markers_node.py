"""Markers node: the estimated liquid surface and its height limit for RViz and Foxglove.

It looks at the newest messages a few times a second, and computes nothing while nobody listens.
Of a tray it shows the first container.
"""

from __future__ import annotations

import math
import sys
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from rclpy.clock import Clock, ClockType
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from slosh_bag.errors import SloshBagError
from slosh_base.types import Array
from slosh_bringup.surface_mesh import SurfaceMesh, surface_mesh
from slosh_estimator.held_container import held_by
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_motion.recorded.settings import model_of, node_start
from slosh_msgs.msg import ContainerChange, NodeSettings, SloshComparison, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import OK, WARN, DiagnosticsReporter, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.polled import PolledNode, take
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.stamps import to_duration

PARAMETERS = (
    ParameterSpec("rate", 20.0, "rate at which the markers are published [Hz]", (0.5, 60.0)),
)
NAMESPACE = "surface"
SURFACE, CREST, LIMIT = range(3)
"""Numbers of the markers: the surface, its highest place at the wall, the limit at the wall."""
LASTING_NS = 500_000_000
"""Markers disappear so long after the last ones, so that none is taken for the present."""
SILENT = 3.0
"""An estimator is reported after a silence of this length [s]."""
COLOURS = {
    SloshComparison.STATE_OK: (0.16, 0.47, 0.84),
    SloshComparison.STATE_WARN: (0.93, 0.61, 0.10),
    SloshComparison.STATE_ERROR: (0.84, 0.15, 0.16),
}
"""Of the surface by the monitor's state: red, green, blue; of any other state GREY."""
GREY = (0.55, 0.58, 0.62)


class MarkersNode(PolledNode):
    """Node that publishes the nonlinear model's liquid surface as markers for 3D views."""

    def __init__(self) -> None:
        super().__init__("markers")
        given = declare(self, PARAMETERS)
        self._model: Model | None = None
        self._mesh: SurfaceMesh | None = None
        self._limit, self._own_limit, self._is_empty = math.nan, math.nan, False
        self._colour, self._compared = GREY, -math.inf
        self._heard = time.monotonic()
        self._settings = self.subscribe_polled(NodeSettings, topics.SETTINGS, qos.EVENT)
        self._changes = self.subscribe_polled(
            ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM
        )
        self._estimates = self.subscribe_polled(SloshEstimate, topics.ESTIMATE, qos.NEWEST_IN)
        self._comparisons = self.subscribe_polled(
            SloshComparison, topics.COMPARISON, qos.NEWEST_IN
        )
        self._publisher = self.create_publisher(MarkerArray, topics.MARKERS, qos.LATCHED_STREAM)
        self._report = DiagnosticsReporter(self, self._health)
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(1.0 / given["rate"], self._look, clock=clock)

    def _look(self) -> None:
        """Publishes the markers of the newest estimate, if there is a new one."""
        now = time.monotonic()
        for message in take(self._settings, NodeSettings, 100):
            self._on_settings(message)
        for message in take(self._changes, ContainerChange, 10):
            self._on_change(message)
        for message in take(self._comparisons, SloshComparison, 1):
            self._colour, self._compared = COLOURS.get(message.state, GREY), now
        if now - self._compared > 1.0:
            self._colour = GREY
        for message in take(self._estimates, SloshEstimate, 1):
            self._heard = now
            if self._mesh is not None and self._publisher.get_subscription_count():
                self._publisher.publish(self._markers(message, self._mesh))
                self._report.counts["output"] += 1

    def _on_settings(self, message: NodeSettings) -> None:
        try:
            start = node_start(message, time.time_ns(), topics.SETTINGS)
            if start.node == "monitor":
                limits = MonitorSettings.from_partial(start.parameters).limits
                self._limit = float(np.fmin(limits[Source.MEASURED], limits[Source.ESTIMATED]))
            elif start.node == "estimator":
                self._take_model(model_of(start))
        except (SloshBagError, ValueError) as error:  # a stranger's
            self.faults.add(topics.SETTINGS, error)

    def _on_change(self, message: ContainerChange) -> None:
        if self._model is None and not message.model:
            return
        try:
            held = held_by(message, self._model)  # type: ignore[arg-type]
        except ValueError as error:
            self.faults.add(topics.CONTAINER, error)
            return
        self._is_empty, self._own_limit = held.empty, held.limit
        self._take_model(held.model)

    def _take_model(self, model: Model) -> None:
        if self._model is None or model.container != self._model.container:
            self._mesh = surface_mesh(model.container)
        self._model = model

    def _markers(self, estimate: SloshEstimate, mesh: SurfaceMesh) -> MarkerArray:
        """Creates an estimate's markers, or a delete-all marker if the surface is unknown."""
        found = estimate.nonlinear
        heights = mesh.heights(found.sh_x, found.sh_y)
        if self._is_empty or not np.isfinite([found.msh, found.azimuth, *heights]).all():
            cleared = Marker(action=Marker.DELETEALL, header=estimate.header)
            return MarkerArray(markers=[cleared])
        vertices = points_of(np.column_stack([mesh.points, heights]))
        surface = self._marker(estimate, SURFACE, Marker.TRIANGLE_LIST, (1.0, 1.0, 1.0), 0.8)
        surface.points = [vertices[index] for index in mesh.triangles.ravel().tolist()]
        size = 0.06 * float(np.ptp(mesh.wall))
        crest = self._marker(estimate, CREST, Marker.SPHERE, (size, size, size), 1.0)
        x, y = mesh.on_wall(found.azimuth)
        crest.pose.position = Point(x=float(x), y=float(y), z=float(found.msh))
        return MarkerArray(markers=[surface, crest, self._ring(estimate, mesh, 0.15 * size)])

    def _ring(self, estimate: SloshEstimate, mesh: SurfaceMesh, width: float) -> Marker:
        """Creates a line marker along the wall at the height limit; deletes it without a limit."""
        limit = self._limit if math.isnan(self._own_limit) else self._own_limit
        ring = self._marker(estimate, LIMIT, Marker.LINE_STRIP, (width, 0.0, 0.0), 1.0)
        if math.isnan(limit):
            ring.action = Marker.DELETE
            return ring
        red, green, blue = COLOURS[SloshComparison.STATE_ERROR]
        ring.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
        closed = np.vstack([mesh.wall, mesh.wall[:1]])
        ring.points = points_of(np.column_stack([closed, np.full(len(closed), limit)]))
        return ring

    def _marker(
        self,
        estimate: SloshEstimate,
        number: int,
        kind: int,
        scale: tuple[float, float, float],
        opacity: float,
    ) -> Marker:
        marker = Marker(header=estimate.header, ns=NAMESPACE, id=number, type=kind)
        marker.pose.orientation.w = 1.0
        marker.scale.x, marker.scale.y, marker.scale.z = scale
        red, green, blue = self._colour
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=opacity)
        marker.lifetime = to_duration(LASTING_NS)
        return marker

    def _health(self) -> Health:
        silence = time.monotonic() - self._heard
        if silence > SILENT:
            return WARN, f"no estimate for {silence:.0f} s: no markers"
        if self._mesh is None:
            return WARN, "the estimator has not told its container: no markers"
        if not self._publisher.get_subscription_count():
            return OK, "nobody listens"
        return OK, "the surface is shown"


def points_of(places: Array) -> list[Any]:
    """Converts positions (N, 3) [m] to point messages."""
    return [Point(x=x, y=y, z=z) for x, y, z in places.tolist()]


def main() -> int:
    """Runs the markers node."""
    return run_node(MarkersNode)


if __name__ == "__main__":
    sys.exit(main())
