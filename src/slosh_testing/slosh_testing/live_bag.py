"""Writes bags as a live cell would record them, one sample at a time."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path

import numpy as np
import yaml

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_base.compiled.arithmetic import arithmetic_fingerprint
from slosh_estimator.estimator import Estimator
from slosh_estimator.held_container import (
    EMPTY,
    FRESH,
    TRAY_PLACE,
    HeldContainer,
    tray_holding,
)
from slosh_estimator.tray_estimator import TrayEstimate, TrayEstimator
from slosh_model.constants import GRAVITY
from slosh_model.model_text import format_model, parse_model
from slosh_model.tray import TRAY, Tray, format_tray
from slosh_motion.inputs.frames import SensorTransform
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.sampling import modes_of
from slosh_msgs_py.journal_format import MESSAGE, MICROSECOND, checksum

TEXT = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07, rim_height: 0.135}
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity, alpha: 0.58}]
"""
MODEL = parse_model(TEXT)
Quaternion = tuple[float, float, float, float]
START = 1_700_000_000_000_000_000
MS = 1_000_000
PARAMETERS = {
    "estimator": {
        "input": "accel", "world_frame": "world", "container_frame": "container",
        "max_gap": 0.05, "max_age": 0.5, "max_jump": 20.0, "sensor_rotation": [0.0, 0.0, 0.0],
        "sensor_to_origin": [0.0, 0.0, 0.0],
    },
    "monitor": {
        "measured_limit": 0.006, "estimated_limit": 0.02, "disagreement_limit": 0.01,
        "warn_share": 0.8, "release": 0.9, "hold": 0.1, "timeout": 0.3, "buffer": 2.0,
        "container_frame": "container",
    },
}  # fmt: skip
STATE_EVERY, NOTED = 125, 200
TYPES = {
    "accel": "geometry_msgs/msg/AccelStamped",
    "estimate": "slosh_msgs/msg/SloshEstimate",
    "estimator_state": "slosh_msgs/msg/EstimatorState",
    "free_surface": "slosh_msgs/msg/FreeSurface",
    "imu": "sensor_msgs/msg/Imu",
    "journal": "slosh_msgs/msg/Journal",
    "pose": "geometry_msgs/msg/PoseStamped",
    "settings": "slosh_msgs/msg/NodeSettings",
    "tray_estimate": "slosh_msgs/msg/TrayEstimate",
}


def motion(seconds: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """Returns stamps [ns] at 500 Hz and accelerations (N, 3) of a motion from rest to rest."""
    t = np.arange(0.0, seconds + 2.0, 0.002)
    swell = np.where((t > 1.0) & (t < 1.0 + seconds), np.sin(np.pi * (t - 1.0) / seconds) ** 2, 0)
    waves = np.column_stack(
        (4.0 * np.sin(13.0 * t), 3.0 * np.cos(11.0 * t), 2.0 * np.sin(9.0 * t))
    )
    return START + np.rint(t * 1e9).astype(np.int64), swell[:, None] * waves


class LiveBag:
    """Writes a bag of a simulated live run; its attributes set faults and changes.

    Attributes:
        unused: indices of inputs that the recorder heard and the estimator did not.
        unrecorded: indices of inputs whose estimates the recorder missed.
        unheard: indices of inputs that the estimator used and the recorder missed.
        states: whether the estimator tells its state, every STATE_EVERY inputs.
        journal: whether it notes the inputs that it takes.
        delay: from an index to the time from an input's stamp until it is taken [ns].
        restarts: indices of inputs with which a new estimator process begins.
        idle: indices of inputs before which an estimator process begins and ends; the next one,
            which takes that input first, does not take the liquid for still.
        loads: model texts by the index of the first input that they apply to.
        holds: what the gripper holds by the index of the first input that it applies to.
        places: which place of the tray holds what, by the index of the first input of it.
        changes: changed input parameters by the index of the first input that they apply to.
        gaps: in the inputs of the last estimator process that was written.
        camera_gap: from and to which moment there are no images [s].
        height: measured height over what the model expects the camera to read.
        attitude: quaternion by the index of the pose.
        kind: what drives the estimator: 'accel', 'imu' or 'pose'.
        pose_window: of the estimator; the default is that of recordings of old.
        every: one in so many inputs is there, of 500 a second.
        image_flags: of every measurement.
        image_ahead: by how much the camera's clock is ahead [ns].
        image_lag, estimate_lag: from an index to the time until the recorder hears of it [ns].
        topics: those that are written; None: all.
        namespace: of the cell.
        remap: full names of topics that have others than those below the namespace.
        facts: of the whole bag.
        tray: whose first container the model is of; None: there is none.
        checks: whether the estimator checks its input; None: it is one of the time before.
        rotation: sensor_rotation of the estimator [rad].
        offset: what the input tells beyond what is true [m/s²].
        rate: angular velocity that an IMU tells [rad/s].
    """

    def __init__(self, kind: str = "accel") -> None:
        self.unused: Collection[int] = ()
        self.unrecorded: Collection[int] = ()
        self.unheard: Collection[int] = ()
        self.states = self.journal = False
        self.delay: Callable[[int], int] = lambda index: 0
        self._noted: list[tuple[int, int]] = []
        self._first = 0
        self.restarts: Collection[int] = ()
        self.idle: Collection[int] = ()
        self.loads: dict[int, str] = {}
        self.holds: dict[int, HeldContainer] = {}
        self.places: dict[int, tuple[int, HeldContainer]] = {}
        self.changes: dict[int, dict[str, float]] = {}
        self.gaps = 0
        self.camera_gap = (0.0, 0.0)
        self.height = 1.0
        self.attitude: Callable[[int], Quaternion] = lambda index: (0.0, 0.0, 0.0, 1.0)
        self.model = MODEL
        self.kind = kind
        self.pose_window: float = 21
        self.every = 1
        self.image_flags = self.image_ahead = 0
        self.image_lag: Callable[[int], int] = lambda index: 20 * MS
        self.estimate_lag: Callable[[int], int] = lambda index: 0
        self.topics: Collection[str] | None = None
        self.namespace = "/slosh"
        self.remap: dict[str, str] = {}
        self.facts: dict[str, str] = {}
        self.tray: Tray | None = None
        self._others: TrayEstimator | None = None
        self._of_tray: TrayEstimate | None = None
        self.checks: bool | None = None
        self.rotation = (0.0, 0.0, 0.0)
        self.offset = (0.0, 0.0, 0.0)
        self.rate = (0.0, 0.0, 0.3)
        self._definitions = Definitions()
        for message_type in TYPES.values():
            self._definitions.hash(message_type)  # makes the type known
        self._types = self._definitions.typestore.types
        self._entries: list[tuple[int, str, str, bytes]] = []

    def write(self, folder: Path, seconds: float = 3.0, beside: Iterable[LiveBag] = ()) -> Path:
        """Writes the bag and returns its folder; `beside` adds messages of other cells."""
        entries = self.entries(seconds)
        for other in beside:
            entries += other.entries(seconds)
        with BagWriter(folder, self._definitions, self.facts) as writer:
            for _, topic, kind, _ in entries:
                writer.add_topic(topic, kind)
            for log_ns, topic, _, data in sorted(entries, key=lambda entry: entry[0]):
                writer.write(topic, data, log_ns)
        return folder

    def entries(self, seconds: float) -> list[tuple[int, str, str, bytes]]:
        """Returns log time [ns], topic, type and bytes of each message."""
        self._entries = []
        self._settings("monitor", 0, {}, START - MS)
        self._run(*motion(seconds))
        self._tell_noted()
        return self._entries

    def _run(self, stamps: np.ndarray, accelerations: np.ndarray) -> None:
        # A container that is moved as the poses say is accelerated as the table says.
        steps = np.diff(stamps, prepend=stamps[0])[:, None] * 1e-9
        positions = np.cumsum(np.cumsum(accelerations * steps, axis=0) * steps, axis=0).tolist()
        estimator, source = self._start(self.model, 0, int(stamps[0]) - MS)
        for index in range(0, len(stamps), self.every):
            stamp, a = int(stamps[index]), accelerations[index].tolist()
            if index in self.idle:
                self._start(estimator.model, 0, stamp - MS)
                estimator, source = self._start(estimator.model, 0, stamp - 1, at_rest=False)
            if index in self.restarts:
                estimator, source = self._start(estimator.model, 0, stamp - 1)
            self._change(estimator, source, index, int(stamps[index - self.every]), stamp)
            samples = self._input(source, index, stamp, a, positions[index])
            if not samples:
                continue
            sample, recorded = samples[-1], index not in self.unrecorded
            for sample in samples:
                estimate = estimator.update(sample)
                self._follow_tray(sample, estimate)
                if self.states and index % STATE_EVERY == 0 and recorded and sample is samples[-1]:
                    self._state(estimator, source, stamp)
                if recorded:
                    lag = self.estimate_lag(index)
                    self._estimate(estimator, estimate, source.gate, stamp + lag)
                    self._put_tray(sample.stamp_ns, stamp + lag)
            self.gaps = source.gate.gaps
            second = (stamp - START) * 1e-9
            if index % 8 == 0 and not self.camera_gap[0] <= second < self.camera_gap[1]:
                height = self.height * estimate.nonlinear.reading
                shown = sample.stamp_ns + round(1e9 * estimator.reading_delay(sample.stamp_ns))
                self._surface(
                    shown + self.image_ahead, height, estimate,
                    self.image_lag(index) - self.image_ahead,
                )  # fmt: skip

    def _change(self, estimator, source, index: int, before: int, stamp: int) -> None:
        """Loads a model or changes parameters if either is due before this input."""
        if index in self.loads:
            estimator.load_model(parse_model(self.loads[index]))
            source.sampling.carry(modes_of(estimator.model))
            files = {"model": format_model(estimator.model)}
            self._settings("estimator", before, files, stamp - 1)
        if index in self.holds:
            held = self.holds[index]
            estimator.load_model(held.model, fresh=held.fresh, empty=held.empty)
            source.sampling.carry(modes_of(estimator.model))
            files = {"model": format_model(held.model)}
            self._settings("estimator", before, files, stamp - 1, **held.recorded)
        if index in self.places:
            self._change_place(estimator, source, *self.places[index], before, stamp)
        if index in self.changes:
            own = {"max_jump": GateSettings().max_jump, **self.changes[index]}
            source.gate.change(GateSettings(**own))
            files = {"model": format_model(estimator.model)}
            changed = list(self.changes[index])
            last = source.gate.last_ns or 0
            self._settings("estimator", last, files, stamp - 1, changed, **own)

    def _change_place(
        self, estimator, source, place: int, held: HeldContainer, before: int, stamp: int
    ) -> None:
        """Replaces the container in one place of the tray, as the estimator's node does."""
        tray = tray_holding(self._others.tray, place, held, self.tray.containers[place].limit)
        own = {TRAY_PLACE: tray.names[place], FRESH: held.fresh}
        if place == 0:
            estimator.load_model(tray.first.placed, fresh=held.fresh, empty=held.empty)
            source.sampling.carry(modes_of(estimator.model))
            own |= held.recorded
        self._others.change(tray, place, fresh=held.fresh)
        files = {"model": format_model(estimator.model), TRAY: format_tray(tray)}
        own.setdefault(EMPTY, tray.first.empty)
        self._settings("estimator", before, files, stamp - 1, **own)

    def _input(self, source, index: int, stamp: int, a: list[float], position: list[float]):
        """Records an input; returns the samples that the estimator makes of it."""
        x, y, z = a = [value + more for value, more in zip(a, self.offset, strict=True)]
        heard = index not in self.unheard
        if self.kind == "accel":
            fields = {"accel": self._accel(a)}
            given = ("world", x, y, z)
        elif self.kind == "imu":
            given = ((x, y, z + GRAVITY), self.rate)
            fields = self._imu(*given)
        else:
            given = (tuple(position), self.attitude(index))
            fields = {"pose": self._pose(*given)}
        before = len(self._entries)
        self._put(self.kind, stamp, **fields)
        noted = [checksum(data) for *_, data in self._entries[before:]]
        if not heard:
            del self._entries[before:]
        found = None
        if index not in self.unused:
            arrival = stamp + self.delay(index)
            found = source.update(stamp, *given, *([arrival] if self.journal else []))
            if self.journal:
                self._noted += [(check, arrival) for check in noted]
            if len(self._noted) >= NOTED:
                self._tell_noted()
        return found if isinstance(found, list) else [found] * (found is not None)

    def _tell_noted(self) -> None:
        """Publishes the journal of the inputs taken since the last one."""
        if not self._noted:
            return
        checks, times = zip(*self._noted, strict=True)
        first, count = self._first, len(checks)
        self._put(
            "journal", times[0], times[-1], node="estimator", first=first, steady=0,
            sources=[f"{MESSAGE}{self._full(self.kind)}"], source=np.zeros(count, np.uint8),
            check=np.array(checks, np.uint32), content=np.empty(0, np.uint8),
            time=np.array([(one - times[0]) // MICROSECOND for one in times], np.uint32),
            steady_time=np.zeros(count, np.uint32),
        )  # fmt: skip
        self._first, self._noted = first + count, []

    def _start(self, model, stamp: int, log_ns: int, *, at_rest: bool = True):
        files = {"model": format_model(model)}
        self._others, self._of_tray = None, None
        if self.tray is not None:
            files[TRAY] = format_tray(self.tray)
            self._others = TrayEstimator(self.tray, at_rest=at_rest)
        own = {"starts_at_rest": at_rest, "pose_window": self.pose_window}
        self._settings("estimator", stamp, files, log_ns, **own)
        source = InputSettings(
            self.kind, GateSettings(), SensorTransform(*self.rotation), self.pose_window,
            modes=modes_of(model), checks=self.checks,
        ).reader(self.kind)  # fmt: skip
        return Estimator(model, at_rest=at_rest), source

    def _settings(
        self,
        node: str,
        stamp: int,
        files: dict[str, str],
        log_ns: int,
        changed: Sequence[str] = (),
        **own: object,
    ) -> None:
        parameters = {**PARAMETERS[node], **own}
        if node == "estimator":
            parameters["input"] = self.kind
            parameters["sensor_rotation"] = list(self.rotation)
            parameters.setdefault("pose_window", self.pose_window)
            if self.checks is not None:
                parameters["check_input"] = self.checks
        names = (self.kind, "free_surface", "estimate")
        full = {name: self._full(name) for name in names}
        told = {"parameters": parameters, "topics": full, "files": files}
        document = yaml.safe_dump({**told, "changed": list(changed)} if changed else told)
        self._put(
            "settings", stamp, log_ns, node=node, code="0123", document=document,
            arithmetic=arithmetic_fingerprint(),
        )  # fmt: skip

    def _accel(self, a: list[float]):
        vector = self._types["geometry_msgs/msg/Vector3"]
        return self._types["geometry_msgs/msg/Accel"](
            linear=vector(*a), angular=vector(0.0, 0.0, 0.0)
        )

    def _imu(self, force: tuple[float, ...], rate: tuple[float, ...]) -> dict[str, object]:
        vector = self._types["geometry_msgs/msg/Vector3"]
        nothing = np.zeros(9)
        return {
            "orientation": self._types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
            "orientation_covariance": nothing,
            "angular_velocity": vector(*rate),
            "angular_velocity_covariance": nothing,
            "linear_acceleration": vector(*force),
            "linear_acceleration_covariance": nothing,
        }

    def _pose(self, position: tuple[float, ...], attitude: tuple[float, ...]):
        return self._types["geometry_msgs/msg/Pose"](
            self._types["geometry_msgs/msg/Point"](*position),
            self._types["geometry_msgs/msg/Quaternion"](*attitude),
        )

    def _estimate(self, estimator: Estimator, estimate, gate, log_ns: int) -> None:
        models = []
        for name, state in zip(
            estimator.names, (estimate.linear, estimate.nonlinear), strict=True
        ):
            modal = np.array(state.modal).reshape(-1, 4)
            models.append(
                self._types["slosh_msgs/msg/ModelEstimate"](
                    name, *state[:4], modal[:, :2].ravel(), modal[:, 2:].ravel()
                )
            )
        sample = estimate.sample
        self._put(
            "estimate", sample.stamp_ns, log_ns, linear=models[0], nonlinear=models[1],
            acceleration=np.array(sample[1:4]), jerk=estimate.jerk, yaw=sample.yaw,
            flags=estimate.flags, samples_used=gate.used, samples_dropped=gate.dropped,
            **estimator.model.container.wall.place(estimate.nonlinear.msh)._asdict(),
        )  # fmt: skip

    def _follow_tray(self, sample, estimate) -> None:
        if self._others is not None:
            self._of_tray = self._others.update(sample, estimate)

    def _put_tray(self, stamp: int, log_ns: int) -> None:
        told = self._of_tray
        if told is None:
            return
        linear = [one.linear for one in told.each]
        self._put(
            "tray_estimate", stamp, log_ns, containers=list(self.tray.names),
            msh=np.array(told.msh), azimuth=np.array(told.azimuth),
            flags=np.array(told.flags, np.uint16), worst=told.worst,
            linear_msh=np.array([one.msh for one in linear]),
            linear_reading=np.array([one.reading for one in linear]),
            reading=np.array([one.nonlinear.reading for one in told.each]),
            delay=np.array(told.delays),
            modes=np.array([len(one.modal) // 4 for one in linear], np.uint8),
            linear_modal=np.concatenate([one.modal for one in linear]),
            modal=np.concatenate([one.nonlinear.modal for one in told.each]),
            acceleration=np.array(told.each[0].sample[1:4]),
        )  # fmt: skip

    def _state(self, estimator: Estimator, source, stamp: int) -> None:
        state = estimator.state()
        sample = state.sample
        self._put(
            "estimator_state", stamp, samples_used=source.gate.used,
            sample_stamp=sample.stamp_ns, sample=np.array([*sample[1:5], *(sample.pose or ())]),
            first_stamp=state.first_ns, settled_stamp=state.settled_ns, linear=state.linear,
            nonlinear=state.nonlinear, checks=state.checks, input=np.array(source.memory),
        )  # fmt: skip

    def _surface(self, stamp: int, height: float, estimate, lag: int) -> None:
        kind = self._types[TYPES["free_surface"]]
        unknown = {
            name: float("nan")
            for name, kind in kind.__annotations__.items()
            if kind in (float, "float") and not name.isupper()
        }
        none = np.empty(0, dtype=np.float32)
        given = {"msh": height, "azimuth": estimate.nonlinear.azimuth}
        self._put(
            "free_surface", stamp, stamp + lag, **{**unknown, **given},
            profile_azimuth=none, profile_height=none, peak_side=0, flags=self.image_flags,
        )  # fmt: skip

    def _put(self, topic: str, stamp: int, log_ns: int | None = None, **fields) -> None:
        if self.topics is not None and topic not in self.topics:
            return
        time = self._types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
        header = self._types["std_msgs/msg/Header"](stamp=time, frame_id="world")
        kind = TYPES[topic]
        message = self._types[kind](header=header, **fields)
        data = bytes(self._definitions.typestore.serialize_cdr(message, kind))
        log_ns = stamp if log_ns is None else log_ns
        self._entries.append((log_ns, self._full(topic), kind, data))

    def _full(self, topic: str) -> str:
        return self.remap.get(topic, f"{self.namespace}/{topic}")
