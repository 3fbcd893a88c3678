"""ROS node that computes sloshing heights from acceleration, at the input's rate."""

from __future__ import annotations

import functools
import operator
import sys
import time
from collections import ChainMap
from collections.abc import Mapping
from functools import partial
from threading import Event
from typing import Any

from std_msgs.msg import String
from std_srvs.srv import Trigger

from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_base.compiled.compilation import load_telling
from slosh_base.compiled.compile_cache import sources_digest
from slosh_base.files.nanoseconds import SECOND
from slosh_estimator import SOURCES
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.estimator import Estimate, Estimator
from slosh_estimator.held_container import EMPTY, FRESH, TRAY_PLACE, HeldContainer
from slosh_estimator.nodes.container_changes import ContainerChanges
from slosh_estimator.nodes.estimator_messages import fill, fill_reading, fill_tray
from slosh_estimator.nodes.input_health import InputHealth, fault_facts, rate_facts
from slosh_estimator.nodes.input_subscription import InputSubscription
from slosh_estimator.nodes.observer_output import ObserverOutput
from slosh_estimator.nodes.requested_model import requested_model
from slosh_estimator.nodes.second_source import AUTO, CHOICES, SecondSource
from slosh_estimator.nodes.state_publisher import StatePublisher
from slosh_estimator.readings import has_readings
from slosh_estimator.tray_estimator import TrayEstimator
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag, attitude_warning, began_text
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_model.tray import TRAY, Tray, format_tray, read_tray
from slosh_motion.inputs.gate import DROPPED, GateSettings
from slosh_motion.inputs.inputs import (
    ADDED,
    BY_POSE,
    BY_TWIST,
    JOINTS,
    MESSAGE_TYPES,
    ODOMETRY,
    PLACED,
    POSE_WINDOW,
    ROBOT,
    TOPIC_NAMES,
    WINDOWED,
    AnyInput,
    InputSettings,
)
from slosh_motion.inputs.robot import Robot, read_urdf
from slosh_motion.inputs.sampling import Sample, modes_of
from slosh_msgs.msg import EstimatorState, ExpectedReading, SloshEstimate, TrayEstimate
from slosh_msgs.srv import LoadModel
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import ERROR, OK, WARN, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.prepared import PreparedNode
from slosh_msgs_py.node.readiness import READY, Progress
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.node.settings import SettingsPublisher

LATENCY_EVERY = 10
"""Messages per measured latency: enough for percentiles, and too few to cost time."""
_CONTESTED = int(EstimateFlag.INPUT_CONTESTED)
_CONTRADICTED = int(EstimateFlag.INPUT_CONTRADICTED)
_GATE = GateSettings()
_dynamic = partial(ParameterSpec, read_only=False)
PARAMETERS = (
    ParameterSpec(
        "model", "", "model.yaml of the container and its liquid, or tray.yaml of several"
    ),
    ParameterSpec(
        "containers", "", "folder of model files NAME.yaml for change_container; empty if unused"
    ),
    ParameterSpec(
        "input", "accel", "kind of input messages of the models", choices=tuple(MESSAGE_TYPES)
    ),
    ParameterSpec(
        "world_frame", "world", "frame of poses, and of accelerations along the world's axes; z up"
    ),
    ParameterSpec("container_frame", "container", "container's frame in all published messages"),
    ParameterSpec(
        "urdf", "", "robot description (URDF, xacro) for the input joints; empty: the topic "
        f"{topics.ROBOT_DESCRIPTION}"
    ),
    ParameterSpec(
        "tool_frame", "", "link of the robot that is the container, or carries it; empty: "
        "container_frame"
    ),
    _dynamic(
        "max_gap", _GATE.max_gap,
        "longest gap in the input that the models bridge [s]", (1e-3, 1.0),
    ),
    _dynamic(
        "max_age", _GATE.max_age,
        "largest difference between a sample's stamp and its arrival [s]", (1e-3, 3600.0),
    ),
    _dynamic(
        "max_jump", _GATE.max_jump,
        "largest change of an axis' acceleration between two samples [m/s^2]", (0.1, 1e4),
    ),
    ParameterSpec(
        "starts_at_rest", True,
        "true: the liquid is at rest when the node starts; false: this is unknown",
    ),
    ParameterSpec(
        "sensor_rotation", [0.0, 0.0, 0.0],
        "rotation container <- sensor or tool: roll, pitch, yaw about fixed axes [rad]",
        (-6.3, 6.3),
        length=3,
    ),
    ParameterSpec(
        "sensor_to_origin", [0.0, 0.0, 0.0],
        "vector from sensor or tool to the centre of the still surface, in the container's "
        "axes [m]",
        (-5.0, 5.0), length=3,
    ),
    ParameterSpec(
        "check_input", True, "check gravity, units and attitude of the input"
    ),
    ParameterSpec(
        "second_source", AUTO, "second source that is compared with the input to check axes, "
        "signs and units; auto: the first one that is published", choices=CHOICES,
    ),
    ParameterSpec(
        "pose_window", POSE_WINDOW,
        "length of the window in which poses are differentiated [s]; estimates are delayed by "
        "half of it; 0.0: the longest window that preserves the model's modes", (0.0, 2.0),
    ),
    ParameterSpec(
        "smoothing", 0.0,
        "delay of the differentiated input [s], half of the window; a longer delay reduces "
        "noise and determines the polynomial's degree; 0.0: as pose_window", (0.0, 1.0),
    ),
    ParameterSpec(
        ODOMETRY, BY_TWIST,
        "what the input odometry reads of its messages: the twist, or the pose where the twist "
        "is wrong", choices=(BY_TWIST, BY_POSE),
    ),
    ParameterSpec(
        "observer", True,
        "true: correct a copy of the model by measured heights; publish fused_estimate and calm"
    ),
    _dynamic(
        "calm_tolerance", 1e-3, "wave height up to which the liquid is calm [m]", (1e-5, 1.0)
    ),
)  # fmt: skip
DYNAMIC = tuple(spec.name for spec in PARAMETERS if not spec.read_only)


class EstimatorNode(PreparedNode):
    """ROS node of the estimator: converts messages, runs the models, publishes heights.

    Args:
        later: it gets ready by `run_node`.
    """

    def __init__(self, *, later: bool = False) -> None:
        super().__init__("estimator", journaled=True)
        self._values = values = declare(
            self, PARAMETERS, InputSettings.from_parameters, self._on_change
        )
        # Asked for each message: the clock's own property takes a lock each time.
        self._ros_time_is_active = self.get_clock().handle.get_ros_time_override_is_enabled
        self._tray = read_tray(values["model"])
        self._message = SloshEstimate()
        self._reading = ExpectedReading()
        self._tray_message, self._tray_ns = TrayEstimate(), -(2**62)
        self._message.header.frame_id = values["container_frame"]
        self._reading.header.frame_id = values["container_frame"]
        self._kind = values["input"]
        names = (TOPIC_NAMES[self._kind], topics.ESTIMATE)
        self._given: dict[str, Any] = {}  # by fixed transforms
        self._container: dict[str, Any] = {}  # by `change_container`
        self._known = ChainMap(self._container, self._given, values)
        self._settings = SettingsPublisher(
            self, sources_digest(*SOURCES), arithmetic_fingerprint(), self._known, names
        )
        self._publisher = self.create_publisher(SloshEstimate, topics.ESTIMATE, qos.STREAM_OUT)
        self._readings = self.create_publisher(
            ExpectedReading, topics.EXPECTED_READING, qos.STREAM_OUT
        )
        self._states = StatePublisher(self, values["container_frame"])
        self._flags = self._contested = self._contradicted = 0
        self._observed: ObserverOutput | None = None
        self._described, self._urdf, self._patient = Event(), "", later
        if self._kind == JOINTS:
            self._ask_for_the_robot()
        elif values["urdf"]:  # for the second source
            self._urdf = read_urdf(values["urdf"])
        self._watch(self._health, self._facts)
        self._get_ready(later=later)

    def prepare(self, progress: Progress) -> None:
        """Compiles or loads the compiled code of models and inputs, and checks it."""
        load_telling(progress, "slosh_estimator.estimate_kernel")
        if self._values["observer"]:
            load_telling(progress, "slosh_estimator.observer.observer_kernel")
        if self._kind in WINDOWED:
            load_telling(progress, "slosh_motion.inputs.pose_input")
        if self._kind == JOINTS:
            self._await_the_robot()
        at_rest = self._values["starts_at_rest"]
        self._estimator = Estimator(self._prepared(self._tray.first.placed), at_rest=at_rest)
        self._estimator.empty = self._tray.first.empty
        if self._tray.first.empty:
            self._container[EMPTY] = True
        self._others = TrayEstimator(self._tray, self._prepared, at_rest=at_rest)

    def _ask_for_the_robot(self) -> None:
        """Reads the robot description from a file, or subscribes to its topic."""
        if self._values["urdf"]:
            self._urdf = read_urdf(self._values["urdf"])
            self._robot(self._values["urdf"])
            self._described.set()
            return

        def described(message: String) -> None:
            if not self._described.is_set():
                self._urdf = message.data
                self._described.set()

        self.create_subscription(String, topics.ROBOT_DESCRIPTION, described, qos.EVENT)

    def _await_the_robot(self) -> None:
        topic = self.resolve_topic_name(topics.ROBOT_DESCRIPTION)
        if not self._described.is_set():
            text = f"no robot description on {topic} yet; or set urdf to its file"
            if not self._patient:
                raise SloshEstimatorError(f"input joints: {text}")
            self.waits(text)
            self._described.wait()
        self._robot(topic)

    def _robot(self, name: str) -> Robot:
        """Creates the robot from its description; raises an error if it does not fit."""
        values = self._values
        tool = values["tool_frame"] or values["container_frame"]
        return Robot(self._urdf, tool, values["world_frame"], name)

    def _prepared(self, model: Model) -> Model:
        """Returns the model to run; it computes gravity from the attitude if the input has one."""
        prepared = InputSettings.from_parameters(self._known).felt(self._kind, model)
        self._added = "" if prepared is model else ADDED
        if self._added:
            self.get_logger().info(self._added)
        return prepared

    def begin(self) -> None:
        """Subscribes to the input and starts the services."""
        self._set_names()
        self._subscribe()
        self._input.sampling.carry(modes_of(self._estimator.model))
        self._changes = ContainerChanges(
            self, self._tray, self._values["containers"],
            lambda: self._input.gate.last_ns or self.now_ns(), self._take,
        )  # fmt: skip
        if self._tray.is_tray:
            self._trays = self.create_publisher(TrayEstimate, topics.TRAY_ESTIMATE, qos.STREAM_OUT)
            self._tray_message.header.frame_id = self._values["container_frame"]
            self._tray_message.containers = list(self._tray.names)
        self._announce_start()
        if self._values["observer"]:
            self._observed = ObserverOutput(
                self, self._values["container_frame"], self._values["calm_tolerance"],
                self._estimator.model,
            )  # fmt: skip
        self.create_service(LoadModel, topics.LOAD_MODEL, self._on_load_model)
        self.create_service(Trigger, topics.RESET, self._on_reset)

    def close(self) -> None:
        """Ends all action goals that wait until the liquid is calm."""
        if self._observed is not None:
            self._observed.close()

    def stands_at(self, topic: str) -> int | None:
        """Returns the stamp that a state on a topic would have now [ns]; None: none."""
        if topic == topics.ESTIMATOR_STATE:
            return self._input.gate.last_ns
        return self._observed.stands_at(topic) if self._observed is not None else None

    def take_up(self, message: Any) -> None:
        """Restores a published state, as a replay does behind what its recording lacks.

        Raises:
            SloshEstimatorError: the state is one of another model, input or version.
        """
        if isinstance(message, EstimatorState):
            self._states.take_up(message, self._estimator, self._input)
        elif self._observed is not None:
            self._observed.take_up(message)

    @property
    def _input(self) -> AnyInput:
        return self._subscription.source

    def _subscribe(self) -> None:
        name = TOPIC_NAMES[self._kind]
        self._input_health = InputHealth(self, name, MESSAGE_TYPES[self._kind])
        how = InputSettings.from_parameters(self._values)._replace(urdf=self._urdf)
        self._second = SecondSource(
            self, self._kind, self._values["second_source"],
            lambda: InputSettings.from_parameters(self._known), self._urdf, self.now_ns,
        )  # fmt: skip
        self._subscription = InputSubscription(
            self, self._kind, how, self.now_ns, self._answer, self._mount, self._second.told,
            self._reach,
        )  # fmt: skip

    def _mount(self, parameters: Mapping[str, Any]) -> InputSettings:
        """Applies the sensor mounting that fixed transforms give, before any sample is used."""
        self._given.update(parameters)
        told = ", ".join(f"{name} = {value}" for name, value in parameters.items())
        self.get_logger().info(f"mounted as {topics.TF_STATIC} says: {told}")
        if PLACED in parameters:
            self._feel_gravity()
        self._announce_start()
        modes = modes_of(self._estimator.model)
        return InputSettings.from_parameters(self._known)._replace(modes=modes)

    def _feel_gravity(self) -> None:
        """Restarts the models with gravity by attitude, which transforms now provide."""
        at_rest = self._values["starts_at_rest"]
        self._estimator.load_model(
            self._prepared(self._tray.first.placed), empty=self._tray.first.empty
        )
        self._others = TrayEstimator(self._tray, self._prepared, at_rest=at_rest)
        self._set_names()
        self._observe_anew()

    def _now(self) -> int:
        # The system clock read directly costs a tenth of a Time object.
        if self._ros_time_is_active():
            return int(self.get_clock().now().nanoseconds)
        return time.time_ns()

    def _reach(self, stamp_ns: int) -> None:
        """Applies container changes that are due before an input with this stamp [ns]."""
        if stamp_ns <= self._changes.next_ns:  # nearly always: the clock is not asked
            return
        if stamp_ns - self.now_ns() <= self._values["max_age"] * SECOND:
            self._changes.reach(stamp_ns)

    def _answer(self, input_ns: int, *samples: Sample | None) -> None:
        self._report.counts["input"] += 1
        self._second.follow(input_ns, *samples)
        for sample in samples:
            if sample is not None:
                self._estimate(input_ns, sample, last=sample is samples[-1])

    def _estimate(self, input_ns: int, sample: Sample, *, last: bool) -> None:
        estimate = self._estimator.update(sample)
        if last:  # what the reader remembers is behind all samples of the message
            self._states.look(input_ns, self._estimator, self._input)
        flags = estimate.flags | self._contested | self._contradicted
        source = self._input
        if self._subscription.contested or source.contested:
            flags |= _CONTESTED
        gate = source.gate
        if source.contradicted or gate.unit.text:
            flags |= _CONTRADICTED
        self._flags |= flags
        fill(self._message, estimate, self._wall)
        self._message.flags = flags
        self._message.samples_used = gate.used
        self._message.samples_dropped = gate.dropped
        if self._tray.is_tray:
            self._publish_tray(sample, estimate)
        if self._has_readings:
            late = self._estimator.reading_delay(sample.stamp_ns)
            fill_reading(self._reading, estimate, late)
            self._readings.publish(self._reading)
        self._publisher.publish(self._message)
        if self._observed is not None and not self._estimator.empty:
            self._observed.follow(sample, estimate.flags)
        self._report.counts["output"] += 1
        if gate.used % LATENCY_EVERY == 0:
            self._report.latency(self._now() - sample.stamp_ns)

    def _publish_tray(self, sample: Sample, estimate: Estimate) -> None:
        """Estimates the tray's further containers; publishes all at a reduced rate."""
        tray = self._others.update(sample, estimate)
        self._flags |= functools.reduce(operator.or_, tray.flags)
        if not 0 <= sample.stamp_ns - self._tray_ns < TUNING.tray_ns:
            self._tray_ns = sample.stamp_ns
            fill_tray(self._tray_message, sample.stamp_ns, tray)
            self._trays.publish(self._tray_message)

    def _take(self, index: int, held: HeldContainer, tray: Tray) -> int:
        """Replaces one tray place's container; returns the last stamp before the change [ns].

        Args:
            index: of the place on the tray, from 0; of one container 0.
            held: what is there.
            tray: with it.
        """
        model = self._prepared(tray.containers[index].placed)
        if not index:
            self._estimator.load_model(model, fresh=held.fresh, empty=held.empty)
            self._container.update(held.recorded)
        self._others.change(tray, index, fresh=held.fresh)
        self._tray = tray
        place = {TRAY_PLACE: tray.names[index]} if tray.is_tray else {}
        self._container.update({FRESH: held.fresh, **place})
        self._announce_start()
        self._container.update({FRESH: False, **dict.fromkeys(place, "")})  # of this start alone
        self._set_names()
        if not index:
            self._observe_anew()
            self._input.sampling.carry(modes_of(self._estimator.model))
        return self._input.gate.last_ns or 0

    def _on_load_model(
        self, request: LoadModel.Request, response: LoadModel.Response
    ) -> LoadModel.Response:
        try:
            self._changes.load(requested_model(request, self.get_logger().warning))
        except ValueError as error:
            response.success, response.message = False, str(error)
        else:
            remark = "".join(f"; {line}" for line in (self._attitude_warning, self._added) if line)
            response.success = True
            response.message = f"loaded; the models start from rest{remark}"
        response.models = ", ".join(self._estimator.names)
        return response

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._estimator.reset()
        self._others.reset()
        self._observe_anew()
        self._announce_start()
        response.success, response.message = True, "the models start from rest"
        return response

    def _observe_anew(self) -> None:
        if self._observed is not None:
            self._observed.load(self._estimator.model)

    def _announce_start(self) -> None:
        """Publishes the settings that apply from the next sample on."""
        files = {"model": format_model(self._estimator.model)}
        if self._tray.is_tray:
            files[TRAY] = format_tray(self._tray.of(self._prepared))
        if self._urdf:
            files[ROBOT] = self._urdf
        self._settings.publish(files, self._input.gate.last_ns or 0)

    def _on_change(self, changed: tuple[str, ...]) -> None:
        """Applies changed input limits to the next samples."""
        if self._observed is not None and "calm_tolerance" in changed:
            self._observed.set_tolerance(self._values["calm_tolerance"])
        if self.readiness.state == READY:
            gate = self._input.gate
            gate.change(InputSettings.from_parameters(self._values).gate)
            self._settings.publish_change(changed, gate.last_ns or 0)

    def _set_names(self) -> None:
        linear, nonlinear = self._estimator.names
        self._message.linear.model, self._message.nonlinear.model = linear, nonlinear
        self._has_readings = has_readings(linear)
        others = (other.model for other in self._others.others)
        models = () if PLACED in self._given else (self._estimator.model, *others)
        warnings = (attitude_warning(model, self._kind) for model in models)
        self._attitude_warning = next(filter(None, warnings), "")
        self._wall = self._estimator.model.container.wall

    def _health(self) -> Health:
        fault = self._input_health.look(self._input.gate)
        faults = self._input_health.faults(self._input)
        rivals = self._subscription.rivals()
        self._contested = _CONTESTED if self._subscription.rivalled else 0
        wrong_input, second = self._second.look()
        clocks = self._subscription.clock_doubt()
        wrong_clock = clocks is not None and clocks.wrong
        self._contradicted = _CONTRADICTED if wrong_input or wrong_clock else 0
        doubt = self._input.doubt
        messages = self._input.message_doubts() if self._input.flags else ()
        doubts = tuple(one for one in (doubt, clocks, *messages) if one is not None)
        wrong = next((one.text for one in doubts if one.wrong), "") or wrong_input
        warning = rivals or self._subscription.trouble() or wrong or self._input.warning()
        if warning:
            return ERROR, warning
        if fault is not None and fault[0] != WARN:
            return fault
        hint = self._attitude_warning or self._input.sampling.sentence() or second
        hint = hint or (self._observed.warning() if self._observed is not None else "")
        remark = hint or self._began() or (doubts[0].text if doubts else self._input.remark())
        if remark or faults:
            return WARN, remark or faults
        if fault is not None:
            return fault
        flags, self._flags = self._flags, 0
        if not self._tray.present:
            return OK, "no container: the gripper is empty"
        # That one is the container's shape, no trouble.
        flags &= ~(EstimateFlag.LINEAR_ONLY | EstimateFlag.NO_CONTAINER)
        if flags:
            names = (flag.name or "" for flag in EstimateFlag if flag & flags)
            return WARN, f"validity flags {flags:#x}: {', '.join(names)}"
        return OK, f"estimating with {', '.join(self._estimator.names)}"

    def _began(self) -> str:
        """Returns that the input began in motion, as long as that makes the estimates wrong."""
        began = self._input.began
        if began is None or not self._flags & EstimateFlag.SETTLING:
            return ""
        return began_text(began.text, self._estimator.model)

    def _facts(self) -> dict[str, Any]:
        gate = self._input.gate
        dropped = {f"dropped: {verdict.value}": gate.counts[verdict] for verdict in DROPPED}
        return {
            **{name: self._values[name] for name in DYNAMIC},
            **dropped,
            "gaps": gate.gaps,
            "divergences": self._estimator.divergences,
            **self._subscription.facts(),
            **self._second.facts(),
            **self._input_health.facts(self._subscription.count),
            **rate_facts(self._input),
            **fault_facts(self._input),
            **self._changes.facts(),
            **(self._observed.facts() if self._observed is not None else {}),
        }


def main() -> int:
    """Runs the estimator node."""
    return run_node(lambda: EstimatorNode(later=True))


if __name__ == "__main__":
    sys.exit(main())
