"""Watch node: serves the operator's page with little load on the cell.

It takes messages in batches, ten times a second, as the recorder does: an executor that woke up
for each of them would cost more than everything else here. What comes a thousand times a second
it hears only while nothing else tells it. What viewers do costs their own connection and nobody
else.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import CompressedImage, Image

from slosh_bag.errors import SloshBagError
from slosh_bringup.cell_watch import reports
from slosh_bringup.watch import HOST, PORT, hearing
from slosh_bringup.watch.access import new_access
from slosh_bringup.watch.cells import PAGE_PORT, CellList
from slosh_bringup.watch.picture import Camera, is_small_jpeg
from slosh_bringup.watch.server import Hub, WatchServer, listen, live_app
from slosh_bringup.watch.state import PERIOD, WatchState
from slosh_camera.errors import SloshCameraError
from slosh_camera.images.colour import Image as Pixels
from slosh_camera.images.decoding import decode_compressed, to_image
from slosh_motion.recorded.settings import node_start
from slosh_msgs.msg import (
    Calm,
    FreeSurface,
    FusedEstimate,
    LimitEvent,
    NodeSettings,
    SloshComparison,
    SloshEstimate,
)
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import find_type
from slosh_msgs_py.node.diagnostics import OK, DiagnosticsReporter, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.polled import PolledNode, take
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.stamps import to_nanoseconds

LOOK_EVERY = 2.0
"""Time between two looks at the graph [s]."""
_TYPE = "slosh_msgs/msg/SloshComparison"
Subscribe = Callable[[Any, str, QoSProfile], Subscription]
Take = Callable[[Subscription, Any, int], Iterator[Any]]

PICTURE_EVERY = 3
"""Frames between two camera images."""
BATCH = 2000
"""Most messages of a topic that are taken at once."""
PARAMETERS = (
    ParameterSpec("host", HOST, "address on which the page is served; 0.0.0.0: all addresses"),
    ParameterSpec("port", PORT, "port of the page; 0: any free port", (0, 65535)),
)


class WatchNode(PolledNode):
    """Node that subscribes to a cell's topics and sends its state to web browsers."""

    def __init__(self) -> None:
        super().__init__("watch")
        given = declare(self, PARAMETERS)
        listener = listen(given["host"], given["port"])
        self.access = new_access(given["host"], listener.getsockname()[1])
        self._hub = Hub()
        self._server = WatchServer(listener, lambda: live_app(self._hub, self.access))
        self._state = WatchState()
        self._camera = Camera()
        self._surfaces: deque[FreeSurface] = deque(maxlen=120)
        self._taken: list[tuple[Subscription, Any, Callable[[Any], None]]] = []
        self._add(NodeSettings, topics.SETTINGS, qos.EVENT, self._on_settings)
        self._add(DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS, self._on_diagnostics)
        self._add(LimitEvent, topics.LIMIT_EVENT, qos.EVENT, self._on_event)
        self._add(FreeSurface, topics.FREE_SURFACE, qos.STREAM_IN, self._on_surface)
        self._add(FusedEstimate, topics.FUSED_ESTIMATE, qos.STREAM_IN, self._on_fused)
        self._add(Calm, topics.CALM, qos.STREAM_IN, self._on_calm)
        self._add(SloshComparison, topics.COMPARISON, qos.STREAM_IN, self._on_comparison)
        types = {row.name: row.type for row in topics.TOPICS}
        for topic, hear in hearing.figures().items():
            self._add(find_type(types[topic]), topic, qos.NEWEST_IN, self._on_figure(hear))
        self._others = OtherCells(self, self.subscribe_polled, self.drop_polled, take)
        self._estimates: Subscription | None = None
        self._images: tuple[Subscription, Any] | None = None
        self._image: Image | CompressedImage | None = None
        self._frames = 0
        self._report = DiagnosticsReporter(self, self._health, self._facts)
        self._server.start()
        self.create_timer(PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"the page of this cell: {self.access.url}")

    def close(self) -> None:
        """Stops the web server."""
        self._server.stop()

    def _add(self, kind: Any, topic: str, profile: QoSProfile, use: Callable[[Any], None]) -> None:
        self._taken.append((self.subscribe_polled(kind, topic, profile), kind, use))

    def _look(self) -> None:
        for subscription, kind, use in self._taken:
            for message in take(subscription, kind, BATCH):
                self._report.counts[subscription.topic.rpartition("/")[2]] += 1
                try:
                    use(message)
                except Exception as error:  # one bad message must not cost those after it
                    self.faults.add(subscription.topic, error)
        now = time.monotonic()
        self._others.look(now)
        self._state.cells = self._others.cells.rows(now)
        self._look_at_estimate(now)
        if self._frames % PICTURE_EVERY == 0:
            self._look_at_camera()
        self._frames += 1
        self._server.call(self._hub.put_frame, self._state.frame(now))

    def _look_at_estimate(self, now: float) -> None:
        """Subscribes to estimates, about 1000 per second, only while the monitor is silent."""
        if not self._state.is_alone(now):
            self.drop_polled(self._estimates)
            self._estimates = None
            return
        if self._estimates is None:
            self._estimates = self.subscribe_polled(SloshEstimate, topics.ESTIMATE, qos.NEWEST_IN)
        for message in take(self._estimates, SloshEstimate, 1):
            hearing.hear_estimate(self._state, message, now)

    def _look_at_camera(self) -> None:
        """Shows the previous camera image with its measurement and takes the next image."""
        if self._image is not None:
            self._show(self._image)
            self._image = None
        if not self._hub.viewers:
            self._stop_images()
            return
        topic, kind = self._best_images()
        if self._images is None or self._images[1] is not kind:
            self._stop_images()
            self._images = self.subscribe_polled(kind, topic, qos.IMAGE_IN), kind
            return
        self._image = next(take(self._images[0], kind, 1), None)

    def _best_images(self) -> tuple[str, Any]:
        """Returns the compressed image topic, or the raw topic if only that has a publisher.

        Right after its start a node has heard of no publisher.
        """
        if not self._is_sent(topics.IMAGE_COMPRESSED) and self._is_sent(topics.IMAGE):
            return topics.IMAGE, Image
        return topics.IMAGE_COMPRESSED, CompressedImage

    def _is_sent(self, topic: str) -> bool:
        return bool(self.count_publishers(self.resolve_topic_name(topic)))

    def _stop_images(self) -> None:
        """Unsubscribes from images while no browser is connected."""
        if self._images is not None:
            self.drop_polled(self._images[0])
            self._images = None

    def _show(self, message: Image | CompressedImage) -> None:
        try:
            image = _decoded(message)
        except SloshCameraError:
            return  # the camera node says what is wrong with it
        stamp_ns = to_nanoseconds(message.header.stamp)
        near = min(
            self._surfaces,
            key=lambda surface: abs(to_nanoseconds(surface.header.stamp) - stamp_ns),
            default=None,
        )
        self._server.call(self._hub.put_picture, self._camera.picture(image, stamp_ns, near))

    def _on_comparison(self, message: SloshComparison) -> None:
        now = time.monotonic()
        hearing.hear_comparison(self._state, message, now)
        self._others.hear_comparison(self.get_namespace(), message, now)

    def _on_fused(self, message: FusedEstimate) -> None:
        hearing.hear_fused(self._state, message)

    def _on_calm(self, message: Calm) -> None:
        hearing.hear_calm(self._state, message, time.monotonic())

    def _on_figure(self, hear: hearing.Hear) -> Callable[[Any], None]:
        return lambda message: hear(self._state, message, time.monotonic())

    def _on_surface(self, message: FreeSurface) -> None:
        self._surfaces.append(message)
        hearing.hear_surface(self._state, message)

    def _on_event(self, message: LimitEvent) -> None:
        hearing.hear_event(self._state, message)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for report in reports(message, self.get_namespace()):
            self._state.take_report(report, time.monotonic())
        self._others.hear_diagnostics(message)

    def _on_settings(self, message: NodeSettings) -> None:
        with contextlib.suppress(SloshBagError):  # a stranger's; ours can be read
            start = node_start(message, time.time_ns(), topics.SETTINGS)
            hearing.hear_start(self._state, self._camera, start)
        self._others.hear_settings(self.get_namespace(), message)

    def _health(self) -> Health:
        return OK, f"serving {self._hub.viewers} viewers on {self.access.host}:{self.access.port}"

    def _facts(self) -> dict[str, Any]:
        # A page that needs a token cannot be reached by a link without it.
        page = {} if self.access.token else {PAGE_PORT: self.access.port}
        return {"viewers": self._hub.viewers, "frames": self._frames, **page}


def _decoded(message: Image | CompressedImage) -> Pixels | bytes:
    if isinstance(message, CompressedImage):
        data = bytes(message.data)
        if is_small_jpeg(data):
            return data
        return decode_compressed(message.format, message.data)
    return to_image(
        message.encoding, message.height, message.width, message.step, message.data,
        big_endian=bool(message.is_bigendian),
    )  # fmt: skip


def main() -> int:
    """Runs the watch node."""
    return run_node(WatchNode)


class OtherCells:
    """Finds cells by their SloshComparison topics and receives the newest messages of each.

    Args:
        node: the node.
        subscribe: makes a subscription that no executor serves.
        drop: ends it.
        take: yields its messages.

    Attributes:
        cells: the list, with the node's own cell.
    """

    def __init__(
        self, node: Node, subscribe: Subscribe, drop: Callable[[Subscription], None], take: Take
    ) -> None:
        self._node, self._subscribe, self._drop, self._take = node, subscribe, drop, take
        self._own = node.get_namespace()
        self.cells = CellList(self._own)
        self._heard: dict[str, tuple[Subscription, Subscription]] = {}
        self._looked = -LOOK_EVERY

    def look(self, now: float) -> None:
        """Processes the received messages; searches for new cells at intervals."""
        if now - self._looked >= LOOK_EVERY:
            self._looked = now
            self._find()
        for name, (comparisons, settings) in self._heard.items():
            for message in self._take(comparisons, SloshComparison, 1):
                self.hear_comparison(name, message, now)
            for message in self._take(settings, NodeSettings, 100):
                self.hear_settings(name, message)

    def hear_comparison(self, name: str, message: SloshComparison, now: float) -> None:
        """Updates a cell's entry in the list from its SloshComparison message."""
        self.cells.take_comparison(name, hearing.compared(message), now)

    def hear_settings(self, name: str, message: NodeSettings) -> None:
        """Passes the settings of a cell's node to the list of cells."""
        with contextlib.suppress(SloshBagError):  # a stranger's; ours can be read
            start = node_start(message, time.time_ns(), topics.SETTINGS)
            self.cells.take_parameters(name, start.node, start.parameters)

    def hear_diagnostics(self, message: Any) -> None:
        """Passes the diagnostics of the nodes of all known cells to the list of cells."""
        for name in self.cells.names:
            for report in reports(message, name):
                self.cells.take_report(name, report)

    def _names(self, topic: str) -> set[str]:
        """Returns the namespaces of the cells that publish SloshComparison messages on a topic."""
        name = topics.cell_name(topic, _TYPE)
        if name is not None:
            return {name.namespace or "/"}
        return {one.node_namespace for one in self._node.get_publishers_info_by_topic(topic)}

    def _find(self) -> None:
        found: dict[str, str] = {}
        for topic, types in self._node.get_topic_names_and_types():
            if _TYPE in types and self._node.count_publishers(topic):
                found |= dict.fromkeys(self._names(topic), topic)
        found.pop(self._own, None)
        for name in self._heard.keys() - found.keys():
            for subscription in self._heard.pop(name):
                self._drop(subscription)
        for name in found.keys() - self._heard.keys():
            settings = f"{name.rstrip('/')}/{topics.SETTINGS}"
            self._heard[name] = (
                self._subscribe(SloshComparison, found[name], qos.NEWEST_IN),
                self._subscribe(NodeSettings, settings, qos.EVENT),
            )
        self.cells.keep(found)


if __name__ == "__main__":
    sys.exit(main())
