"""Sensor node: publishes heights from a force sensor or level sensors, as a camera node does."""

from __future__ import annotations

import math
import sys
from typing import Any

from geometry_msgs.msg import PointStamped, Twist, Wrench, WrenchStamped
from sensor_msgs.msg import Range

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compile_cache import sources_digest
from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError
from slosh_estimator import SOURCES
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.nodes.monitor_node import announced_model
from slosh_estimator.sensed.force_surface import ForceSurface, Motion, SensedWave
from slosh_estimator.sensed.level import LevelPlace, strange_height, wall_factor
from slosh_estimator.sensed.payload import LONGEST, Payload, parse_payload
from slosh_estimator.sensed.surface import level_fields, wave_fields
from slosh_model.model import Model
from slosh_motion.errors import SloshMotionError
from slosh_msgs.msg import FreeSurface, NodeSettings, SloshEstimate
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.node.diagnostics import ERROR, OK, WARN, DiagnosticsReporter, Health
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_msgs_py.stamps import to_nanoseconds, to_time

TWIST, WRENCH = "twist", "wrench"
UNSTAMPED = {TWIST: Twist, WRENCH: Wrench}
PAYLOAD = "payload"
PARAMETERS = (
    ParameterSpec(
        PAYLOAD, "", "identification.json of `slosh identify --force`; empty: no force"
    ),
    ParameterSpec(
        "unstamped_force", "", "topic of forces without stamps, which are stamped on arrival and "
        "published again as `force`; empty if unused",
    ),
    ParameterSpec(
        "unstamped_type", WRENCH, "type of unstamped_force: geometry_msgs/Wrench, or Twist with "
        "the force as its linear part", choices=tuple(UNSTAMPED),
    ),
    ParameterSpec(
        "level_distance", 0.0, "distance from the level sensor (`level`) down to the still level "
        "[m]; 0.0: no such sensor", (0.0, 10.0),
    ),
    ParameterSpec(
        "level_place", [0.0, 0.0], "place that the level sensor measures: x, y in the container's "
        "frame [m]", (-5.0, 5.0), length=2,
    ),
    ParameterSpec("level_stddev", 1e-3, "standard deviation of a measured level [m]", (1e-5, 0.1)),
    ParameterSpec(
        "beside_camera", False, "true: publish sensed_surface, since a camera node publishes "
        "free_surface",
    ),
    ParameterSpec("container_frame", "container", "container's frame in all published messages"),
)  # fmt: skip


class SensorNode(GuardedNode):
    """ROS node that converts sensor messages to liquid heights and publishes them."""

    def __init__(self) -> None:
        super().__init__("sensor", journaled=True)
        self._given = given = declare(self, PARAMETERS)
        self._payload, text = _read_payload(given[PAYLOAD])
        self._force: ForceSurface | None = None
        self._model: Model | None = None
        self._failure = ""
        self._frame = given["container_frame"]
        name = topics.SENSED_SURFACE if given["beside_camera"] else topics.FREE_SURFACE
        self._publisher = self.create_publisher(FreeSurface, name, qos.STREAM_OUT)
        self._report = DiagnosticsReporter(self, self._health, self._facts)
        hear = self.create_subscription
        hear(NodeSettings, topics.SETTINGS, self._on_settings, qos.EVENT)
        if self._payload is not None:
            hear(SloshEstimate, topics.ESTIMATE, self._on_estimate, qos.STREAM_IN)
            self._hear_force(given["unstamped_force"], given["unstamped_type"])
        if given["level_distance"]:
            hear(Range, topics.LEVEL, self._on_range, qos.STREAM_IN)
        hear(PointStamped, topics.LEVEL_POINT, self._on_point, qos.STREAM_IN)
        names = (topics.ESTIMATE, topics.FORCE, topics.LEVEL, topics.LEVEL_POINT, name)
        self._settings = SettingsPublisher(
            self, sources_digest(*SOURCES), arithmetic_fingerprint(), given, names
        )
        self._settings.publish({PAYLOAD: text} if text else {})

    def _hear_force(self, unstamped: str, kind: str) -> None:
        """Subscribes to forces; republishes unstamped forces with stamps, to be recorded."""
        if not unstamped:
            self.create_subscription(WrenchStamped, topics.FORCE, self._on_force, qos.STREAM_IN)
            return
        stamped = self.create_publisher(WrenchStamped, topics.FORCE, qos.STREAM_OUT)

        def on_unstamped(message: Any) -> None:
            force = message.linear if kind == TWIST else message.force
            wrench = WrenchStamped()
            wrench.header.stamp = to_time(self.now_ns())
            to = wrench.wrench.force
            to.x, to.y, to.z = force.x, force.y, force.z
            stamped.publish(wrench)
            self._on_force(wrench)

        self.create_subscription(UNSTAMPED[kind], unstamped, on_unstamped, qos.STREAM_IN)

    def _on_settings(self, message: NodeSettings) -> None:
        """Adopts the estimator's model from its published settings, at first and when changed."""
        model = announced_model(message)
        if model is None or model == self._model:
            return
        self._model = model
        if self._payload is not None:
            self._force = ForceSurface(model, self._payload)

    def _on_estimate(self, message: SloshEstimate) -> None:
        if self._force is not None:
            ax, ay, _ = message.acceleration.tolist()
            stamp_ns = to_nanoseconds(message.header.stamp)
            self._tell(self._force.take_motion(Motion(stamp_ns, ax, ay, message.yaw)))

    def _on_force(self, message: WrenchStamped) -> None:
        self._report.counts["force"] += 1
        if self._force is not None:
            force, stamp_ns = message.wrench.force, to_nanoseconds(message.header.stamp)
            self._tell(self._force.take_force(stamp_ns, force.x, force.y, force.z))

    def _tell(self, waves: list[SensedWave]) -> None:
        assert self._model is not None
        for wave in waves:
            self._publish(wave.stamp_ns, wave_fields(wave, self._model.container.reaches[0]))

    def _on_range(self, message: Range) -> None:
        distance = message.range
        if not message.min_range <= distance <= message.max_range:
            return  # nothing was seen: REP-117
        x, y = self._given["level_place"]
        height = self._given["level_distance"] - distance
        self._level(to_nanoseconds(message.header.stamp), x, y, height)

    def _on_point(self, message: PointStamped) -> None:
        point = message.point
        self._level(to_nanoseconds(message.header.stamp), point.x, point.y, point.z)

    def _level(self, stamp_ns: int, x: float, y: float, height: float) -> None:
        """Publishes a height [m] that was measured at one place on the surface."""
        self._report.counts["level"] += 1
        if self._model is None or not math.isfinite(x + y + height):
            return
        place = LevelPlace(math.atan2(y, x), math.hypot(x, y))
        try:
            factor = wall_factor(self._model, place)
        except SloshMotionError as error:
            self._failure = str(error)
            return
        self._failure = strange_height(height, self._model)
        if self._failure:
            return
        stddev = factor * self._given["level_stddev"]
        self._publish(stamp_ns, level_fields(factor * height, place.azimuth, stddev))

    def _publish(self, stamp_ns: int, fields: dict[str, float]) -> None:
        self._report.counts["output"] += 1
        self._publisher.publish(
            filled(FreeSurface, stamp_ns=stamp_ns, frame_id=self._frame, **fields)
        )
        self._report.latency(int(self.get_clock().now().nanoseconds) - stamp_ns)

    def _health(self) -> Health:
        wrong = self._failure or (self._force.wrong if self._force is not None else "")
        if wrong:
            return ERROR, wrong
        if self._model is None:
            return WARN, "waiting for the estimator's model"
        counts = self._report.counts
        if self._payload is not None and not counts["force"]:
            return WARN, f"no force on {self.resolve_topic_name(topics.FORCE)} yet"
        refused = self._force.refused if self._force is not None else 0
        if refused > counts["force"] // 2:
            return ERROR, f"{refused} forces or motions rejected: not finite, or not in order"
        if not counts["output"] and (self._payload is not None or counts["level"]):
            return WARN, "no height yet: motion and force have no common time"
        return OK, "publishing heights of the wave"

    def _facts(self) -> dict[str, Any]:
        return {"refused": self._force.refused} if self._force is not None else {}


def _read_payload(path: str) -> tuple[Payload | None, str]:
    """Reads the payload file of a force sensor; returns payload and text, None without file."""
    if not path:
        return None, ""
    try:
        text = read_text(path, LONGEST)
    except TextFileError as error:
        raise SloshEstimatorError(str(error)) from None
    return parse_payload(text, path), text


def main() -> int:
    """Runs the sensor node."""
    return run_node(SensorNode)


if __name__ == "__main__":
    sys.exit(main())
