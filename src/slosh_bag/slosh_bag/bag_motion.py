"""The motion that a bag's input messages tell, through the estimator's own input adapters."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.table_bag import ACCEL_TYPE, IMU_TYPE, NOT_REPORTED, SECOND
from slosh_estimator.accel_input import AccelInput
from slosh_estimator.gate import GateSettings, SampleGate
from slosh_estimator.imu_input import ImuInput, SensorTransform
from slosh_estimator.pose_input import PoseInput
from slosh_estimator.rotation import matrix_from_rpy, rotate
from slosh_estimator.sample import Sample

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Kind = Literal["accel", "imu", "pose"]

POSE, POSE_TYPE = "pose", "geometry_msgs/msg/PoseStamped"
INPUTS: Final[dict[Kind, str]] = {"accel": ACCEL_TYPE, "imu": IMU_TYPE, "pose": POSE_TYPE}
WORLD, CONTAINER = "world", "container"


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """How the input is read; as the estimator node's parameters.

    Attributes:
        gate: limits of the gate.
        transform: container ← IMU.
        pose_window: samples of the differentiating window.
    """

    gate: GateSettings = field(default_factory=GateSettings)
    transform: SensorTransform = field(default_factory=SensorTransform)
    pose_window: int = 21


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion at stamps.

    Attributes:
        stamps: (N,) [ns], strictly increasing.
        acceleration: (N, 3) in the world's axes, gravity excluded [m/s²].
        attitude: (N, 4) quaternion x, y, z, w, world ← container; None: not known.
        angular_velocity: (N, 3) in the container's frame [rad/s]; None: not known.
    """

    stamps: Stamps
    acceleration: Array
    attitude: Array | None = None
    angular_velocity: Array | None = None


class MotionCollector:
    """Takes the messages of one input.

    Args:
        kind: accel, imu or pose.
        settings: how they are read.
    """

    def __init__(self, kind: Kind, settings: MotionSettings) -> None:
        self._kind = kind
        # One adapter of the three: that of poses compiles its filter when it is made.
        self._take: Callable[[Any], Sample | None]
        self.gate: SampleGate
        if kind == "accel":
            accel = AccelInput(settings.gate, (WORLD, CONTAINER))
            self._take, self.gate = partial(self._take_accel, accel), accel.gate
        elif kind == "imu":
            imu = ImuInput(settings.gate, settings.transform)
            self._take, self.gate = partial(self._take_imu, imu), imu.gate
        else:
            pose = PoseInput(settings.gate, settings.pose_window)
            self._take, self.gate = partial(self._take_pose, pose), pose.gate
        transform = settings.transform
        self._matrix = matrix_from_rpy(transform.roll, transform.pitch, transform.yaw)
        # Flat arrays: a list of tuples would take ten times their memory.
        self._stamps, self._acceleration = array("q"), array("d")
        self._attitude, self._turning = array("d"), array("d")
        self._waiting: dict[int, tuple[float, ...]] = {}
        self.in_world = True

    def add(self, message: Any) -> None:
        """Takes a message."""
        sample = self._take(message)
        if sample is not None:
            self._stamps.append(sample.stamp_ns)
            self._acceleration.extend((sample.ax, sample.ay, sample.az))

    def motion(self, path: Path, topic: str) -> Motion:
        """All that came.

        Raises:
            SloshBagError: nothing usable, or the stamps go back.
        """
        stamps = np.array(self._stamps, dtype=np.int64)
        if not len(stamps):
            raise SloshBagError(f"{path}: holds no usable message of {topic}")
        late = np.flatnonzero(np.diff(stamps) <= 0)
        if len(late):
            raise SloshBagError(
                f"{path}: the stamps of {topic} go back at {stamps[late[0]] / SECOND:.3f} s; "
                "cut the bag in two there"
            )
        return Motion(
            stamps,
            np.array(self._acceleration).reshape(-1, 3),
            _complete(self._attitude, len(stamps), 4),
            _complete(self._turning, len(stamps), 3),
        )

    def notes(self) -> list[str]:
        """What a table cannot hold of it, one line each."""
        notes = []
        if self.gate.dropped:
            reasons = ", ".join(
                f"{count} {verdict.value}"
                for verdict, count in self.gate.counts.items()
                if count and not verdict.value.startswith("used")
            )
            notes.append(f"{self.gate.dropped} samples of {self._kind} left out: {reasons}")
        if self.gate.gaps:
            notes.append(
                f"{self.gate.gaps} gaps in {self._kind}: a simulation of the table runs straight "
                "through them, the estimator starts anew after them"
            )
        return notes

    def _take_accel(self, adapter: AccelInput, message: Any) -> Sample | None:
        a = message.accel.linear
        frame = message.header.frame_id
        sample = adapter.update(stamp_of(message), frame, a.x, a.y, a.z)
        self.in_world &= sample is None or frame == WORLD
        return sample

    def _take_imu(self, adapter: ImuInput, message: Any) -> Sample | None:
        f, w = message.linear_acceleration, message.angular_velocity
        known = message.angular_velocity_covariance[0] != NOT_REPORTED
        rate = (w.x, w.y, w.z) if known else None
        sample = adapter.update(stamp_of(message), (f.x, f.y, f.z), rate)
        if sample is not None and rate is not None:
            half = 0.5 * sample.yaw
            self._attitude.extend((0.0, 0.0, math.sin(half), math.cos(half)))
            self._turning.extend(rotate(self._matrix, rate))
        return sample

    def _take_pose(self, adapter: PoseInput, message: Any) -> Sample | None:
        p, q = message.pose.position, message.pose.orientation
        stamp, turn = stamp_of(message), (q.x, q.y, q.z, q.w)
        self._waiting.setdefault(stamp, turn)
        sample = adapter.update(stamp, (p.x, p.y, p.z), turn)
        if sample is not None:
            # The sample is that of the window's centre: its attitude came some poses ago.
            self._attitude.extend(self._waiting[sample.stamp_ns])
            for early in [stamp for stamp in self._waiting if stamp < sample.stamp_ns]:
                del self._waiting[early]
        return sample


class AttitudeCollector:
    """Takes what an imu in the container's frame tells beside accel."""

    def __init__(self) -> None:
        self._stamps, self._attitude, self._turning = array("q"), array("d"), array("d")

    def add(self, message: Any) -> None:
        """Takes an Imu message."""
        if message.header.frame_id != CONTAINER:
            return
        self._stamps.append(stamp_of(message))
        if message.orientation_covariance[0] != NOT_REPORTED:
            q = message.orientation
            self._attitude.extend((q.x, q.y, q.z, q.w))
        if message.angular_velocity_covariance[0] != NOT_REPORTED:
            w = message.angular_velocity
            self._turning.extend((w.x, w.y, w.z))

    def added_to(self, motion: Motion) -> Motion:
        """The motion with attitude and angular velocity, where every sample has them."""
        count = len(self._stamps)
        attitude = _complete(self._attitude, count, 4)
        turning = _complete(self._turning, count, 3)
        stamps, first = np.unique(np.array(self._stamps, dtype=np.int64), return_index=True)
        place = np.searchsorted(stamps, motion.stamps)
        if not count or place[-1] == len(stamps) or (stamps[place] != motion.stamps).any():
            return motion
        order = first[place]
        return replace(
            motion,
            attitude=_finite(None if attitude is None else attitude[order]),
            angular_velocity=_finite(None if turning is None else turning[order]),
        )


def stamp_of(message: Any) -> int:
    """A message's stamp [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


def _complete(values: array[float], rows: int, width: int) -> Array | None:
    """The values as (rows, width); None where a row has none."""
    if not rows or len(values) != rows * width:
        return None
    return np.array(values, dtype=np.float64).reshape(rows, width)


def _finite(values: Array | None) -> Array | None:
    """The values; None where one is not finite: 'not reported' by REP-145 is NaN."""
    return values if values is not None and np.isfinite(values).all() else None
