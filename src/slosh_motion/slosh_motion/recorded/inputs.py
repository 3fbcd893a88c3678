"""Reads the inputs in a recording in the same way as the estimator node."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_base.files.nanoseconds import SECOND
from slosh_model.indices import POSE_COUNT, QW, QX, QY, QZ
from slosh_model.model import TILT, Model
from slosh_model.tilt import added_text, ignored_text, largest_tilt
from slosh_motion.checks.input_faults import MIXED_INPUT
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.inputs.gate import DROPPED, GateSettings, SampleVerdict
from slosh_motion.inputs.inputs import POSE, POSES, ROBOT, InputSettings
from slosh_motion.inputs.sampling import Modes, Samples, gap_sentence, modes_of
from slosh_motion.inputs.sensor_inputs import AccelInput, ImuInput, imu_reading
from slosh_motion.inputs.velocity_input import OdometryPoses, Twist, VelocityInput
from slosh_motion.recorded.settings import NodeStart, first, model_of, settings_of
from slosh_motion.recorded.sources import TABLE_COLUMNS

_FIELDS = {
    "accel": ("accel.linear.x", "accel.linear.y", "accel.linear.z"),
    "imu": (
        "linear_acceleration.x", "linear_acceleration.y", "linear_acceleration.z",
        "angular_velocity.x", "angular_velocity.y", "angular_velocity.z",
        "linear_acceleration_covariance[0]", "angular_velocity_covariance[0]",
    ),
    "pose": (
        "pose.position.x", "pose.position.y", "pose.position.z", "pose.orientation.x",
        "pose.orientation.y", "pose.orientation.z", "pose.orientation.w",
    ),
    "odometry": (
        *(f"twist.twist.{what}.{axis}" for what in ("linear", "angular") for axis in "xyz"),
        *(f"pose.pose.orientation.{axis}" for axis in "xyzw"),
        *(f"pose.pose.position.{axis}" for axis in "xyz"),
    ),
    "twist": (*(f"twist.{what}.{axis}" for what in ("linear", "angular") for axis in "xyz"),),
}  # fmt: skip
_FRAME = "header.frame_id"
PLACED_FIELDS = tuple(f"pose{index}" for index in range(POSE_COUNT))
"""Columns of accelerations that transforms have placed: how the container stands and turns."""
MIXED = 0.05
"""One publisher stamps no such share of its messages before the one ahead of them."""
STAMP = ("header.stamp.sec", "header.stamp.nanosec")
"""Fields of every message with a header that `stamps_of` reads."""
LOGGED = "logged"
"""Column beside the messages' fields: when each was recorded [ns]."""
LACKING = "lacking"
"""Column beside them: whether inputs before it lack that the estimator took."""


def recorded_inputs(starts: Sequence[NodeStart], facts: Mapping[str, str]) -> InputSettings:
    """Returns the input settings with which a recording's estimator ran.

    Args:
        starts: of its nodes; the first estimator's parameters count.
        facts: about the bag. Of a table everything that was put in comes out again.

    Raises:
        SloshBagError: a parameter is missing or cannot be.
    """
    started = first(starts, "estimator")
    if started is not None:
        return settings_of_start(started)._replace(modes=_modes(started))
    # Nobody could tell the world's frame: poses are taken as they come, and that is told.
    if TABLE_COLUMNS in facts:
        unbounded = GateSettings(max_jump=math.inf, confirms=False)
        return InputSettings(gate=unbounded, any_world=True, whole=True)
    return InputSettings(any_world=True)


def settings_of_start(start: NodeStart) -> InputSettings:
    """Returns the input settings in a settings message of the estimator.

    Raises:
        SloshBagError: a parameter is missing or cannot be.
    """
    found = settings_of(start, InputSettings.from_parameters)
    return found._replace(urdf=start.files.get(ROBOT, ""))


def _modes(start: NodeStart) -> Modes:
    return modes_of(model_of(start)) if "model" in start.files else ()


def fields(kind: str) -> tuple[str, ...]:
    """Returns the message fields of an input type that `InputReader.samples` needs."""
    return (*STAMP, _FRAME, *_FIELDS[_columns_of(kind)])


def _columns_of(kind: str) -> str:
    """Returns the type to which an input is converted; poses for joints and transforms."""
    return POSE if kind in POSES else kind


class InputReader:
    """Converts columns of input messages to samples, as the estimator node does.

    Args:
        kind: of the input, see `slosh_motion.inputs.inputs`.

    Attributes:
        max_gap_ns: the longest gap that is integrated across [ns].
    """

    def __init__(self, kind: str, settings: InputSettings) -> None:
        self.kind = kind
        self.max_gap_ns = round(settings.gate.max_gap * 1e9)
        self._settings = settings
        self._adapter = self._settings.reader(self.kind)
        self._used_before = self._dropped_before = self._gaps_before = 0
        self._slow = ""
        self._slow_count = self._count = 0
        self._raised: dict[int, InputDoubt] = {}
        self._faults: list[str] = []
        self._messages: list[InputDoubt] = []  # before restarts
        self._tilted: NDArray[np.float64] | None = None

    @property
    def counters(self) -> dict[str, int]:
        """Numbers of used samples, dropped samples and gaps since the start."""
        gate = self._adapter.gate
        return {
            "samples_used": self._used_before + gate.used,
            "samples_dropped": self._dropped_before + gate.dropped,
            "gaps": self._gaps_before + gate.gaps,
        }

    @property
    def doubts(self) -> tuple[InputDoubt, ...]:
        """Suspected faults of the input and remarks, one sentence each."""
        found = {**self._raised, **self._raised_now()}
        remark = self._adapter.remark()
        messages = [*self._messages, *self._told_now()]
        return (*found.values(), *messages, *([InputDoubt(remark, wrong=False)] if remark else []))

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults of sensor, driver or network, one sentence each."""
        return (*self._faults, *self._adapter.check.faults.texts())

    @property
    def refusal(self) -> str:
        """Returns why messages were refused, as the end of a sentence; empty if none were."""
        gate = self._adapter.gate
        refused = self._adapter.refusal()
        if refused:
            return f": {refused}"
        worst = max(DROPPED, key=lambda verdict: gate.counts[verdict])
        if gate.counts[worst]:
            return f": {gate.counts[worst]} are {worst.value}"
        return ""

    def finish(self) -> None:
        """Processes the remaining samples at the end of the input."""
        self._adapter.check.finish()

    def _told_now(self) -> list[InputDoubt]:
        began = self._adapter.began
        told = () if began is None else (began,)
        return [InputDoubt.of(doubt) for doubt in (*told, *self._adapter.message_doubts())]

    def _raised_now(self) -> dict[int, InputDoubt]:
        return {kind: InputDoubt.of(doubt) for kind, doubt in self._adapter.check.raised.items()}

    def change(self, settings: InputSettings) -> None:
        """Applies changed input limits to the next messages, as a live node does."""
        self._settings = self._settings._replace(gate=settings.gate)
        self._adapter.gate.change(self._settings.gate)

    def restart(self, settings: InputSettings | None = None) -> None:
        """Resets the input reader, as a restart of the live node did.

        Args:
            settings: of the new node; None: as before.
        """
        if settings is not None:
            self._settings = settings
        self._adapter.check.faults.finish()
        self._faults += self._adapter.check.faults.texts()
        self._raised |= self._raised_now()
        self._messages += self._told_now()
        counters = self.counters
        self._used_before = counters["samples_used"]
        self._dropped_before = counters["samples_dropped"]
        self._gaps_before = counters["gaps"]
        self._adapter = self._settings.reader(self.kind)

    def carry(self, modes: Modes) -> None:
        """Replaces the model's sloshing modes, from the next input sample on."""
        self._settings = self._settings._replace(modes=modes)
        self._adapter.sampling.carry(modes)

    def warnings(self) -> list[str]:
        """Warnings about the rate and order of the input, with remedies, one line each."""
        counts, gate = self.counters, self._adapter.gate
        late = gate.counts[SampleVerdict.DISORDERED]
        if late > MIXED * (late + gate.used):
            return [
                f"{late} of {late + gate.used} messages of {self.kind} are stamped before the one "
                f"ahead of them, and are not used: {MIXED_INPUT}"
            ]
        # Of samples that are all gaps, one in two is used: their rate is not that of the input.
        line = gap_sentence(gate, counts["samples_used"], counts["gaps"]) or self._slow_line()
        return [line] if line else []

    def _slow_line(self) -> str:
        """Describes a rate that is too low, and where it is so at less than half of the samples.

        A few long intervals, as of a busy machine, are not the rate of the input.
        """
        if not self._slow or 2 * self._slow_count >= self._count:
            return self._slow
        return f"at {self._slow_count} of {self._count} samples {self._slow}"

    def _told(self, samples: Samples) -> Samples:
        """Counts samples, and those that come too slowly, for the warning; returns the samples."""
        self._count += len(samples.stamps)
        if samples.slow is not None:
            self._slow_count += int(np.count_nonzero(samples.slow))
        self._slow = self._adapter.sampling.sentence() or self._slow
        return samples

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Restores the state of the live input reader after the message with this stamp [ns].

        Raises:
            SloshMotionError: the memory is of another kind of input.
        """
        self._adapter.take_up(stamp_ns, memory)

    def samples(
        self, stamps: NDArray[np.int64], columns: Mapping[str, NDArray[Any]], rows: NDArray[Any]
    ) -> Samples:
        """Returns the samples of messages with given indices, without those that the node drops.

        Args:
            stamps: (N,) of the messages [ns].
            columns: their fields by name, (N,) each.
            rows: indices of those to take, in order.
        """
        adapter = self._adapter
        values = np.column_stack([columns[name][rows] for name in _FIELDS[_columns_of(self.kind)]])
        if isinstance(adapter, AccelInput):
            poses = None
            if self._settings.placed:
                poses = np.column_stack([columns[name][rows] for name in PLACED_FIELDS])
            return self._told(
                adapter.update_many(stamps[rows], columns[_FRAME][rows], values, poses)
            )
        found = []
        frames = columns[_FRAME][rows].tolist()
        for stamp, frame, row in zip(stamps[rows].tolist(), frames, values.tolist(), strict=True):
            if isinstance(adapter, ImuInput):
                force, rate = imu_reading(tuple(row[:3]), tuple(row[3:6]), *row[6:])
                sample = adapter.update(stamp, force, rate)
                if sample is not None:
                    found.append(sample)
            elif isinstance(adapter, VelocityInput | OdometryPoses):
                found += adapter.update_twist(twist_of(stamp, row, frame))
            else:
                found += adapter.update(stamp, tuple(row[:3]), tuple(row[3:]), None, frame)
        adapter.check.faults.look()
        samples = self._told(Samples.of(found))
        if samples.poses is not None and len(samples.poses):
            attitude = samples.poses[:, [QX, QY, QZ, QW]]
            if self._tilted is None or largest_tilt(attitude) > largest_tilt(self._tilted):
                self._tilted = attitude
        return samples

    def ignored_tilt(self, given: Model, used: Model) -> list[str]:
        """Tells in one line if a model ignored the container's tilt, or was changed for it.

        None of an attitude that is in doubt itself.

        Args:
            given: the model before `InputSettings.felt`.
        """
        if any(doubt.wrong for doubt in self.doubts):
            return []
        added = added_text(given, self._tilted) if used.has(TILT) else ""
        text = f"the container {added}" if added else ignored_text(used, self._tilted)
        return [text] if text else []


def twist_of(stamp_ns: int, row: Sequence[float], frame: str) -> Twist:
    """Creates a velocity from an Odometry message, in the axes of the moving frame."""
    vx, vy, vz, wx, wy, wz, *pose = row
    linear, angular = (vx, vy, vz), (wx, wy, wz)
    if not pose:
        return Twist(stamp_ns, linear, angular, None, frame)
    qx, qy, qz, qw, x, y, z = pose
    return Twist(stamp_ns, linear, angular, (qx, qy, qz, qw), "", (x, y, z))


def readings_of(
    kind: str, columns: Mapping[str, NDArray[Any]]
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Returns accelerations [m/s²] and angular velocities [rad/s] (N, 3) in the sensor's axes.

    Args:
        columns: their fields by name, (N,) each.

    Returns:
        accelerations, and angular velocities; None: such messages have none.
    """
    values = np.column_stack([columns[name] for name in _FIELDS[kind]]).astype(np.float64)
    if kind != "imu":
        return values, None
    force, rate = values[:, :3], values[:, 3:6]
    force[values[:, 6] < 0.0] = math.nan
    rate[values[:, 7] < 0.0] = math.nan
    return force, rate


def stamps_of(columns: Mapping[str, NDArray[Any]]) -> NDArray[np.int64]:
    """Returns the header stamps of messages [ns]."""
    seconds = columns["header.stamp.sec"].astype(np.int64)
    return np.asarray(seconds * SECOND + columns["header.stamp.nanosec"], dtype=np.int64)
