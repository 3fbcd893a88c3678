"""ROS node that compares the camera with the models and reports limit violations."""

from __future__ import annotations

import math
import sys
from collections import ChainMap
from functools import partial
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_srvs.srv import Trigger

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compile_cache import sources_digest
from slosh_base.files.yaml_document import parse_yaml
from slosh_estimator import SOURCES
from slosh_estimator.agreement import MotionAgreement
from slosh_estimator.comparison import Comparison, EstimatePoint
from slosh_estimator.held_container import given_limit
from slosh_estimator.limits import Event
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import (
    HEIGHT_LIMITS,
    RIM,
    RIM_DISTANCE,
    MonitorSettings,
)
from slosh_estimator.nodes.container_cameras import ContainerCameras, measured_point
from slosh_estimator.nodes.monitor_health import MonitorHealth
from slosh_estimator.prediction_record import Announced, PredictionRecord
from slosh_estimator.readings import Reading, ReadingJoiner
from slosh_estimator.sight import ClockWatch
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_model.tray import TRAY, Tray, parse_tray
from slosh_msgs.msg import (
    ContainerChange,
    ExpectedReading,
    FreeSurface,
    LimitEvent,
    MotionPrediction,
    NodeSettings,
    PredictionOutcome,
    SloshComparison,
    SloshEstimate,
    TrayEstimate,
)
from slosh_msgs_py import qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.node.diagnostics import ERROR, DiagnosticsReporter, Health
from slosh_msgs_py.node.guarded import GuardedNode
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher
from slosh_msgs_py.stamps import to_nanoseconds

CHECK_PERIOD = 0.1
_DEFAULT = MonitorSettings()
_dynamic = partial(ParameterSpec, read_only=False)
PARAMETERS = (
    _dynamic("measured_limit", 0.02, "limit of the measured height [m]", (0.0, 10.0)),
    _dynamic("estimated_limit", 0.02, "limit of the nonlinear model's height [m]", (0.0, 10.0)),
    _dynamic(
        "disagreement_limit", 0.01,
        "limit of the difference between measured and estimated (nonlinear) height [m]",
        (0.0, 10.0),
    ),
    _dynamic(
        "rim_distance", _DEFAULT.rim_distance,
        "least distance of the liquid to the rim [m]; 0.0: the rim itself", (0.0, 10.0),
    ),
    _dynamic(
        "warn_share", _DEFAULT.warn_share, "share of a limit above which the monitor warns",
        (0.01, 1.0),
    ),
    _dynamic(
        "release", _DEFAULT.hysteresis.release, "share of a limit below which a violation ends",
        (0.01, 1.0),
    ),
    _dynamic(
        "hold", _DEFAULT.hysteresis.hold_ns / 1e9,
        "time for which the height must stay below this share [s]", (0.0, 60.0),
    ),
    _dynamic("timeout", _DEFAULT.timeout, "time without messages after which the camera or "
                                          "the estimator counts as silent [s]", (0.05, 0.4)),
    ParameterSpec("buffer", _DEFAULT.buffer, "time that estimates are stored [s]", (0.1, 60.0)),
    ParameterSpec("container_frame", "container", "container's frame in all published messages"),
    ParameterSpec("camera", True, "false: there is no camera; only the estimate is monitored"),
    ParameterSpec(
        "cameras", "",
        "names of those containers of a tray, other than the first, that have a camera of their "
        "own, separated by commas; empty: none",
    ),
)  # fmt: skip
DYNAMIC = tuple(spec.name for spec in PARAMETERS if not spec.read_only)


class MonitorNode(GuardedNode):
    """ROS node of the monitor: converts messages, compares heights, publishes results."""

    def __init__(self) -> None:
        super().__init__("monitor", journaled=True)
        self._given = given = declare(
            self, PARAMETERS, MonitorSettings.from_parameters, self._on_change
        )
        self._frame = given["container_frame"]
        heard = (topics.ESTIMATE, topics.FREE_SURFACE) if given["camera"] else (topics.ESTIMATE,)
        names = (*heard, topics.COMPARISON, topics.LIMIT_EVENT)
        self._rim: dict[str, float] = {}
        self._model: Model | None = None
        self._complaint = ""
        known = ChainMap(self._rim, given)
        self._settings = SettingsPublisher(
            self, sources_digest(*SOURCES), arithmetic_fingerprint(), known, names
        )
        self._settings.publish({})
        self._core = Monitor(MonitorSettings.from_parameters(given))
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._clock_watch = ClockWatch()
        self._comparisons = self.create_publisher(
            SloshComparison, topics.COMPARISON, qos.STREAM_OUT
        )
        self._events = self.create_publisher(LimitEvent, topics.LIMIT_EVENT, qos.EVENT)
        self.create_subscription(SloshEstimate, topics.ESTIMATE, self._on_estimate, qos.STREAM_IN)
        self.create_subscription(TrayEstimate, topics.TRAY_ESTIMATE, self._on_tray, qos.STREAM_IN)
        self._joiner = ReadingJoiner()
        self.create_subscription(
            ExpectedReading, topics.EXPECTED_READING, self._on_reading, qos.STREAM_IN
        )
        self._cameras = ContainerCameras(
            self, given["cameras"], self._core.next_excess, self._arrival, self._announce
        )
        if given["camera"]:
            self.create_subscription(
                FreeSurface, topics.FREE_SURFACE, self._on_free_surface, qos.STREAM_IN
            )
        self.create_subscription(
            ContainerChange, topics.CONTAINER, self._on_container, qos.LATCHED_STREAM
        )
        self.create_subscription(NodeSettings, topics.SETTINGS, self._on_settings, qos.EVENT)
        self.create_service(Trigger, f"monitor/{topics.RESET}", self._on_reset)
        self._judge = MonitorHealth(self, self._core)
        self._predictions = PredictionWatch(self, self._frame)
        self._measured = 0
        self._level_off = False
        self._report = DiagnosticsReporter(self, self._health, self._facts)
        self.create_timer(CHECK_PERIOD, self._on_check, clock=self._steady)

    def _on_change(self, changed: tuple[str, ...]) -> None:
        if RIM_DISTANCE in changed:
            changed = (*changed, *self._moved_rim())
        wanted = MonitorSettings.from_parameters({**self._given, **self._rim})
        stamp_ns = self._core.change_settings(wanted)
        self._cameras.change_settings(wanted, stamp_ns)
        self._settings.publish_change(changed, stamp_ns)

    def _moved_rim(self) -> tuple[str, ...]:
        """Updates the rim's height from the model; returns the parameter's name if it changed."""
        if self._model is None:
            return ()
        settings = MonitorSettings.from_parameters(self._given)
        rim, self._complaint = settings.near_rim(self._model)
        if self._rim.get(RIM) == rim or not (self._rim or math.isfinite(rim)):
            return ()
        self._rim[RIM] = rim
        return (RIM,)

    def _on_settings(self, message: NodeSettings) -> None:
        """Updates the rim and the tray from the estimator's published settings."""
        model = announced_model(message)
        if model is None:
            return
        tray, stamp_ns = announced_tray(message), to_nanoseconds(message.header.stamp)
        self._cameras.carry(tray, stamp_ns, MonitorSettings.from_parameters(self._given))
        if tray is not None:
            self._core.carry(tray, stamp_ns)
            self._predictions.first = tray.first.name
        self._model = model
        changed = self._moved_rim()
        if changed:
            self._on_change(changed)

    def _on_container(self, message: ContainerChange) -> None:
        """After a change of the container, applies the new container's limits to later data."""
        try:
            model = parse_model(message.model, topics.CONTAINER) if message.model else None
            limit = given_limit(message.limit)
        except ValueError as error:
            self.get_logger().error(f"{topics.CONTAINER}: not followed: {error}")
            return
        if message.tray and model == self._model:
            return  # another place of the tray has changed, as the settings say
        before = dict(self._rim)
        self._rim.clear()
        if message.present and not math.isnan(limit):
            self._rim.update(dict.fromkeys(HEIGHT_LIMITS, limit))
        rim = before.get(RIM, math.nan)
        if model is not None:
            self._model, settings = model, MonitorSettings.from_parameters(self._given)
            rim, self._complaint = settings.near_rim(model)
        if RIM in before or math.isfinite(rim):
            self._rim[RIM] = rim
        if self._rim != before or model is not None:
            stamp_ns = to_nanoseconds(message.header.stamp)
            wanted = MonitorSettings.from_parameters({**self._given, **self._rim})
            self._core.change_settings(wanted, stamp_ns or None)
            self._core.motions.reset()  # what disagreed was another container
            self._settings.publish_change(tuple({**before, **self._rim}), stamp_ns)

    def _on_estimate(self, message: SloshEstimate) -> None:
        self._report.counts["estimate"] += 1
        stamp_ns = to_nanoseconds(message.header.stamp)
        point = EstimatePoint(
            stamp_ns,
            message.linear.msh,
            message.nonlinear.msh,
            message.flags,
            tuple(message.acceleration.tolist()),
            azimuth=message.nonlinear.azimuth,
        )
        self._add(self._joiner.add_estimate(point, message.nonlinear.model))

    def _on_tray(self, message: TrayEstimate) -> None:
        if self._core.tray is None or len(message.msh) != len(self._core.tray.tray.containers):
            return  # not announced yet, or a stranger's
        self._core.add_tray(to_nanoseconds(message.header.stamp), message.msh.tolist())
        self._publish([])
        self._cameras.add_tray(message)

    def _on_reading(self, message: ExpectedReading) -> None:
        reading = Reading(
            to_nanoseconds(message.header.stamp),
            message.linear,
            message.nonlinear,
            round(message.delay * 1e9),
        )
        self._add(self._joiner.add_reading(reading))

    def _add(self, points: list[EstimatePoint]) -> None:
        for point in points:
            self._publish(self._core.add_estimate(point, self._arrival()))

    def _on_free_surface(self, message: FreeSurface) -> None:
        self._report.counts["free_surface"] += 1
        self._measured += 1
        self._publish(self._core.add_measurement(measured_point(message), self._arrival()))

    def _on_check(self) -> None:
        self._core.standstill = (
            self._clock_watch.look(self.steady_ns(), self.now_ns()) if self.is_simulated else ""
        )
        self._publish(self._core.check(self._arrival()))
        self._cameras.check()
        level = bool(self._core.level.text)
        if level and not self._level_off:
            self.get_logger().warning(self._core.level.text)
        self._level_off = level
        for motion in self._core.motions.take_finished():
            self._predictions.judge(motion)
            if motion.disagrees:
                self.get_logger().warning(motion.sentence)

    def _arrival(self) -> int:
        """Returns the arrival time [ns] by a steady clock, or by simulated time if in use.

        By that a slow simulation is no more silent than a fast one.
        """
        return self.now_ns() if self.is_simulated else self.steady_ns()

    def _publish(self, comparisons: list[Comparison]) -> None:
        for comparison in comparisons:
            fields = comparison._asdict()
            self._comparisons.publish(filled(SloshComparison, frame_id=self._frame, **fields))
            self._report.counts["comparison"] += 1
            if not comparison.measured_stale:
                age = int(self.get_clock().now().nanoseconds) - comparison.stamp_ns
                self._report.latency(age)
        for event in self._core.take_events():
            self._announce(event, self._frame)

    def _announce(self, event: Event, frame: str) -> None:
        self._events.publish(event_message(event, frame))
        self.get_logger().warning(f"limit {event.kind.name.lower()}: {event.description}")

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._core.reset_accuracy()
        self._cameras.reset()
        self._predictions.reset()
        response.success, response.message = True, "MAE and epsilon are reset"
        return response

    def _health(self) -> Health:
        first = self._judge.look(self._arrival(), self._measured)
        level, text = self._cameras.health(first)
        return (ERROR, f"{self._complaint}; {text}") if self._complaint else (level, text)

    def _facts(self) -> dict[str, Any]:
        core = self._core
        return {
            **{name: self._given[name] for name in DYNAMIC},
            "MAE L [mm]": f"{1e3 * core.linear.sigma:.2f}",
            "MAE NL [mm]": f"{1e3 * core.nonlinear.sigma:.2f}",
            "epsilon L [%]": f"{1e2 * core.linear.epsilon:.1f}",
            "epsilon NL [%]": f"{1e2 * core.nonlinear.epsilon:.1f}",
            "motions": core.motions.finished,
            "motions that disagree": core.motions.disagreeing,
            "measurements without an estimate": core.unmatched,
            "estimates out of order": core.late_estimates,
            "estimates without an expected reading": self._joiner.lost,
            **({"rim [mm]": f"{1e3 * core.settings.rim:.1f}"} if self._rim else {}),
            **(core.tray.facts() if core.tray is not None else {}),
            **core.motions.clocks.facts(),
            **self._cameras.facts(),
            **self._predictions.facts(),
            **self._judge.facts(self._report.counts),
        }


def event_message(event: Event, frame: str) -> LimitEvent:
    """Converts a limit event to a message."""
    return filled(
        LimitEvent,
        stamp_ns=event.stamp_ns,
        frame_id=frame,
        id=event.id,
        kind=int(event.kind),
        source=int(event.source),
        limit=event.limit,
        peak=event.peak,
        peak_stamp_ns=event.peak_stamp_ns,
        duration_ns=max(event.duration_ns, 0),
        description=event.description,
    )


def announced_model(message: NodeSettings) -> Model | None:
    """Returns the model in a settings message of the estimator; None if it cannot be read.

    None: it is another node's, or a stranger's that cannot be read.
    """
    if message.node != "estimator":
        return None
    try:
        document = parse_yaml(message.document, "settings of the estimator").value
        return parse_model(document["files"]["model"], "the estimator's model")
    except (KeyError, TypeError, ValueError):
        return None


def announced_tray(message: NodeSettings) -> Tray | None:
    """Returns the tray that the estimator's settings name; None if the settings are invalid."""
    try:
        document = parse_yaml(message.document, "settings of the estimator").value
        return parse_tray(document["files"][TRAY], "the estimator's tray")
    except (KeyError, TypeError, ValueError):
        return None


class PredictionWatch:
    """Compares predicted with measured peak heights of motions and publishes the outcomes.

    Args:
        node: the node.
        frame: of the container.

    Attributes:
        first: name of a tray's first container, of which estimates and heights are.
    """

    def __init__(self, node: Node, frame: str) -> None:
        self._node, self._frame, self.first = node, frame, ""
        self._record = PredictionRecord()
        self._outcomes = node.create_publisher(
            PredictionOutcome, topics.PREDICTION_OUTCOME, qos.EVENT
        )
        node.create_subscription(
            MotionPrediction, topics.PREDICTION, self._on_prediction, qos.EVENT
        )

    def reset(self) -> None:
        """Discards the outcomes of all earlier predictions."""
        self._record.reset()

    def judge(self, motion: MotionAgreement) -> None:
        """Compares a finished motion with its prediction and publishes the outcome."""
        outcome = self._record.judge(motion)
        if outcome is None:
            return
        message = filled(PredictionOutcome, frame_id=self._frame, **outcome._asdict())
        self._outcomes.publish(message)
        self._node.get_logger().info(f"planned motion {outcome.id}: {outcome.description}")

    def facts(self) -> dict[str, Any]:
        """Returns the accuracy of the predictions by name, for the diagnostics."""
        record, last = self._record, self._record.last
        if last is None:
            return {"predictions": 0}
        return {
            "predictions": record.count,
            "last prediction": last.description,
            "MAE of predictions [mm]": f"{1e3 * record.sigma:.2f}",
            "epsilon of predictions [%]": f"{1e2 * record.epsilon:.1f}",
        }

    def _on_prediction(self, message: MotionPrediction) -> None:
        if message.container not in ("", self.first):
            return  # of another container than the estimates
        self._record.announce(
            Announced(
                message.id,
                to_nanoseconds(message.header.stamp),
                to_nanoseconds(message.start),
                message.duration,
                message.peak,
            )
        )


def main() -> int:
    """Runs the monitor node."""
    return run_node(MonitorNode)


if __name__ == "__main__":
    sys.exit(main())
