"""Runs the estimator's and the monitor's cores over a bag: no DDS, no clock, the same numbers.

Inputs and measurements are read one message after the other; images are not touched. Where the
bag says that its two clocks are unrelated, the offset is estimated for each model by its own
least RMS, all in one search window, and the models are judged over the motion alone.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.motion_table import MotionTable
from slosh_bag.reader import BagReader, TopicInfo
from slosh_bag.replay_accuracy import (
    Estimates,
    Measurements,
    compare,
    compare_unrelated,
    monitor_events,
)
from slosh_bag.replay_result import ReplayResult
from slosh_estimator.accel_input import AccelInput
from slosh_estimator.estimator import Estimator
from slosh_estimator.gate import GateSettings
from slosh_estimator.imu_input import ImuInput, SensorTransform
from slosh_estimator.monitor import MonitorSettings
from slosh_estimator.pose_input import PoseInput
from slosh_estimator.sample import Sample
from slosh_model.containers import Cylinder
from slosh_model.model import Model

Array = NDArray[np.float64]
SURFACE = "free_surface"
INPUTS = {
    "accel": "geometry_msgs/msg/AccelStamped",
    "imu": "sensor_msgs/msg/Imu",
    "pose": "geometry_msgs/msg/PoseStamped",
}
FRAMES = ("world", "container")


class InputSettings(NamedTuple):
    """How the input is read; as the estimator node's parameters.

    Attributes:
        kind: 'accel', 'imu', 'pose'; None: the first of these that the bag holds.
        gate: limits of the gate.
        transform: container ← IMU.
        pose_window: samples of the differentiating window.
    """

    kind: str | None = None
    gate: GateSettings = GateSettings()
    transform: SensorTransform = SensorTransform()
    pose_window: int = 21


class EstimatorBank:
    """The 2D and the 3D twin of a model, each with its L and its NL twin."""

    def __init__(self, model: Model) -> None:
        self._estimators = (Estimator(model.planar()), Estimator(model.spatial()))
        self.names = tuple(
            names[surface] for surface in (0, 1) for names in (e.names for e in self._estimators)
        )
        self._stamps: list[int] = []
        self._rows: list[tuple[float, ...]] = []
        self._flags: list[int] = []
        self._motion: list[float] = []

    def update(self, sample: Sample) -> None:
        """Takes a sample."""
        planar, spatial = (estimator.update(sample) for estimator in self._estimators)
        self._stamps.append(sample.stamp_ns)
        self._rows.append(
            (planar.linear.msh, spatial.linear.msh, planar.nonlinear.msh, spatial.nonlinear.msh)
        )
        self._flags.append(planar.flags | spatial.flags)
        self._motion.append((sample.ax**2 + sample.ay**2 + sample.az**2) ** 0.5)

    def estimates(self) -> Estimates:
        """All that came so far."""
        return Estimates(
            self.names,
            np.array(self._stamps, dtype=np.int64),
            np.array(self._rows, dtype=np.float64).reshape(-1, len(self.names)),
            np.array(self._flags, dtype=np.int64),
            np.array(self._motion, dtype=np.float64),
        )


def replay_bag(
    path: Path,
    model: Model | None = None,
    monitor: MonitorSettings | None = None,
    inputs: InputSettings | None = None,
) -> ReplayResult:
    """Replays a bag.

    Args:
        path: the bag's folder or MCAP file.
        model: container and liquid; None: the container that the bag's metadata gives, with water.
        monitor: limits that are watched.
        inputs: how the input is read.

    Raises:
        SloshBagError: no readable bag, no input or no measurement in it, no model, or clocks that
            cannot be related.
    """
    reader = BagReader(path)
    facts = reader.metadata()
    settings = inputs or InputSettings()
    topics = reader.topics()
    kind, topic = _input_topic(path, topics, settings.kind)
    surface = _topic(topics, SURFACE, "slosh_msgs/msg/FreeSurface")
    if surface is None:
        raise SloshBagError(
            f"{path}: holds no free_surface; detect the heights first (slosh detect), or record it"
        )
    bank = EstimatorBank(model or _noted_model(path, facts))
    adapter = _adapter(kind, settings)
    rows: list[tuple[int, float, int]] = []
    for entry in reader.messages([topic, surface]):
        message = reader.decode(entry)
        if entry.topic == surface:
            rows.append((_stamp(message), message.msh, message.flags))
            continue
        sample = _sample(adapter, message)
        if sample is not None:
            bank.update(sample)
    if not rows or not len(bank.estimates().stamps):
        raise SloshBagError(f"{path}: holds no usable message of {topic} or of {surface}")
    rows.sort(key=lambda row: row[0])  # stamp order, whatever the order of arrival
    counters = {
        "samples_used": adapter.gate.used,
        "samples_dropped": adapter.gate.dropped,
        "gaps": adapter.gate.gaps,
        "images": len(rows),
    }
    measured = Measurements(
        np.array([row[0] for row in rows], dtype=np.int64),
        np.array([row[1] for row in rows], dtype=np.float64),
        np.array([row[2] for row in rows], dtype=np.int64),
    )
    result = _judge(
        path, topic, bank.estimates(), measured, facts.get("clocks") == "unrelated", monitor
    )
    return replace(
        result, counters={**counters, **result.counters}, warnings=tuple(reader.warnings)
    )


def replay_table(
    name: str, table: MotionTable, model: Model, monitor: MonitorSettings | None = None
) -> ReplayResult:
    """Replays a motion table with measured heights; its one column of time is both clocks.

    Args:
        name: how the result is called.
        table: the motion, with `msh` or `eta`.
        model: container and liquid.
        monitor: limits that are watched.

    Raises:
        SloshBagError: the table holds no measured heights.
    """
    heights = table.measured
    if heights is None:
        raise SloshBagError(f"{name}: holds no measured heights; add a column msh or eta_…")
    bank = EstimatorBank(model)
    stamps = np.rint(table.t * 1e9).astype(np.int64)
    rows = zip(stamps.tolist(), table.acceleration.tolist(), strict=True)
    for index, (stamp, (ax, ay, az)) in enumerate(rows):
        bank.update(Sample(stamp, ax, ay, az, 0.0, index == 0))
    measured = Measurements(stamps, heights, np.zeros(len(stamps), dtype=np.int64))
    result = _judge(Path(name), name, bank.estimates(), measured, False, monitor)
    return replace(result, counters={"samples_used": len(stamps), **result.counters})


def _judge(
    path: Path,
    source: str,
    estimates: Estimates,
    measured: Measurements,
    unrelated: bool,
    monitor: MonitorSettings | None,
) -> ReplayResult:
    late = np.flatnonzero(np.diff(estimates.stamps) <= 0)
    if len(late):
        raise SloshBagError(
            f"{path}: the stamps of {source} go back at {estimates.stamps[late[0]] * 1e-9:.3f} s; "
            "cut the bag in two there"
        )
    if unrelated:
        result = compare_unrelated(path.name, source, estimates, measured)
    else:
        result = compare(path.name, source, estimates, measured)
    return monitor_events(result, estimates, measured, monitor or MonitorSettings())


def _topic(topics: dict[str, TopicInfo], name: str, message_type: str) -> str | None:
    """The topic of that last name and type; in a bag of several cells the first."""
    found = sorted(
        topic
        for topic, info in topics.items()
        if topic.rsplit("/", 1)[-1] == name and info.message_type == message_type and info.count
    )
    return found[0] if found else None


def _input_topic(path: Path, topics: dict[str, TopicInfo], kind: str | None) -> tuple[str, str]:
    wanted = list(INPUTS) if kind is None else [kind]
    for name in wanted:
        topic = _topic(topics, name, INPUTS[name])
        if topic is not None:
            return name, topic
    raise SloshBagError(
        f"{path}: holds no message of {', '.join(wanted)}; nothing drives the model"
    )


def _noted_model(path: Path, facts: dict[str, str]) -> Model:
    try:
        radius = float(facts["container_radius"])
        fill_height = float(facts["container_fill_height"])
    except (KeyError, ValueError):
        raise SloshBagError(f"{path}: does not say which container; give a model file") from None
    return Model(Cylinder(radius, fill_height)).spatial()


def _adapter(kind: str, settings: InputSettings) -> AccelInput | ImuInput | PoseInput:
    if kind == "accel":
        return AccelInput(settings.gate, FRAMES)
    if kind == "imu":
        return ImuInput(settings.gate, settings.transform)
    return PoseInput(settings.gate, settings.pose_window)


def _sample(adapter: AccelInput | ImuInput | PoseInput, message: Any) -> Sample | None:
    stamp = _stamp(message)
    if isinstance(adapter, AccelInput):
        a = message.accel.linear
        return adapter.update(stamp, message.header.frame_id, a.x, a.y, a.z)
    if isinstance(adapter, ImuInput):
        f, w = message.linear_acceleration, message.angular_velocity
        unknown = message.angular_velocity_covariance[0] == -1.0  # "not reported" by Imu.msg
        return adapter.update(stamp, (f.x, f.y, f.z), None if unknown else (w.x, w.y, w.z))
    p, q = message.pose.position, message.pose.orientation
    return adapter.update(stamp, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
