"""Reads the container's motion and the measured heights from a bag, on the bag's clock.

| input | acceleration | attitude | angular velocity |
|---|---|---|---|
| accel | as published | the imu's or the pose's, where one lies beside | likewise |
| imu | Rz(ψ) f - g ẑ | the yaw ψ alone | the imu's |
| pose | second derivative of the position | the pose's orientation | from the orientations |

An imu feels gravity: on a tilted floor its specific force f has gravity's share along the floor
already, as the liquid feels it. So the acceleration is the one that an upright container would
need for the same force, the attitude is the yaw alone, and the effect `gravity_tilt` changes
nothing: the live estimator sees the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader, TopicInfo
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_model.interpolation import columns_at
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.inputs.inputs import IMU, MESSAGE_TYPES, POSE, InputSettings
from slosh_motion.recorded.input_blocks import InputBlocks, by_chunk, reading
from slosh_motion.recorded.inputs import STAMP, stamps_of
from slosh_motion.recorded.motion import FRAME, AttitudeCollector, MotionCollector, RecordedMotion
from slosh_motion.recorded.sources import Sources, find_sources
from slosh_replay.recording.heights import HeightCollector, Measurements

Stamps = NDArray[np.int64]
Columns = Mapping[str, NDArray[Any]]
Tell = Callable[[str], object]
Taker = tuple[tuple[str, ...], Callable[[Columns], None]]
"""Fields of a topic's messages, and what takes their columns."""

_COMPARISON_FIELDS = (*STAMP, "residual_nonlinear", "measured_stale", "estimate_stale")

MAX_GAP_NS = SECOND // 10
"""Widest pair of poses between which an attitude is interpolated [ns]."""
TURN_NS = SECOND // 50
"""To each side of a pose, over which its angular velocity is a mean [ns]."""
_TURN = tuple(f"pose.orientation.{axis}" for axis in "xyzw")


class Heights(NamedTuple):
    """Measured heights [m] with increasing stamps [ns] and standard deviations [m], (N,) each."""

    stamps: Stamps
    msh: Array
    stddev: Array


class Residuals(NamedTuple):
    """Recorded residuals, measured minus estimated (N,) [m], with stamps (N,) [ns]."""

    stamps: Stamps
    values: Array


@dataclass(frozen=True, slots=True)
class BagRecording:
    """The motion and the heights that a bag contains.

    Attributes:
        path: of the bag.
        motion: of the container.
        heights: as measured; saturated and unusable ones are left out.
        residuals: of the recorded comparison; empty: none was recorded.
        facts: about the whole bag.
        max_gap_ns: longest time between two samples that belong together [ns].
    """

    path: Path
    motion: RecordedMotion
    heights: Heights
    residuals: Residuals
    facts: Mapping[str, str]
    max_gap_ns: int


def read_recording(path: Path, reader: BagReader, sources: Sources, tell: Tell) -> BagRecording:
    """Reads the motion and the heights of a bag.

    Args:
        path: of the bag, for what is said of it.
        reader: of the bag.
        sources: its topics.
        tell: is told what is left out, one line each.

    Raises:
        SloshBagError: no measured heights, no usable input, or stamps that go back.
    """
    if sources.surface is None:
        raise SloshBagError(f"{path}: holds no measured heights (free_surface)")
    how = reading(reader, sources)
    container = _Container(sources, how)
    measured, compared = HeightCollector(), _Comparisons()
    takers = container.takers(reader.topics())
    takers[sources.surface] = (measured.fields, measured.add)
    if sources.comparison is not None:
        takers[sources.comparison] = (_COMPARISON_FIELDS, compared.add)
    blocks = InputBlocks(reader, sources, how)
    for chunk in by_chunk(reader.blocks([*blocks.topics, *takers])):
        own = [block for block in chunk if block.topic in blocks.topics]
        if own:
            container.add(blocks.columns(own))
        for block in chunk:
            if block.topic in takers:
                names, take = takers[block.topic]
                take(reader.columns(block, names))
    blocks.check()
    heights, left_out = usable_heights(measured.measurements())
    if not len(heights.stamps):
        raise SloshBagError(f"{path}: holds no usable height in {sources.surface}")
    motion = container.motion(path)
    for doubt in (*blocks.doubts(), *container.doubts):
        tell(doubt.of_file(path))
    for line in (*reader.warnings, *left_out):
        tell(line if line.startswith(str(path)) else f"{path}: {line}")
    return BagRecording(
        path, motion, heights, compared.residuals(), sources.facts,
        round(how.gate.max_gap * SECOND),
    )  # fmt: skip


class _Container:
    """Collects the recorded messages of the container's motion."""

    def __init__(self, sources: Sources, how: InputSettings) -> None:
        self._kind, self._topic = sources.kind, sources.input
        self._moved = MotionCollector(sources.kind, how)
        self._imu, self._poses = AttitudeCollector(how.frames[1]), PoseAttitudes(how.frames[0])

    def takers(self, topics: Mapping[str, TopicInfo]) -> dict[str, Taker]:
        """Returns message handlers by topic, for topics that supplement the input's topic."""
        found: dict[str, Taker] = {}
        if self._kind != "accel":
            return found
        beside: dict[str, Taker] = {
            IMU: (self._imu.fields, self._imu.add),
            POSE: (self._poses.fields, self._poses.add),
        }
        for name, taker in beside.items():
            topic = f"{self._topic.rpartition('/')[0]}/{name}"
            if topic in topics and topics[topic].message_type == MESSAGE_TYPES[name]:
                found[topic] = taker
        return found

    def add(self, columns: Columns) -> None:
        """Adds consecutive messages of the input topic."""
        self._moved.add(columns)

    @property
    def doubts(self) -> tuple[InputDoubt, ...]:
        """Faults of the input, one sentence each; complete after the last message."""
        return self._moved.doubts

    def motion(self, path: Path) -> RecordedMotion:
        """Returns the container's motion from all added messages.

        Raises:
            SloshBagError: nothing usable, or stamps that go back.
        """
        motion = self._moved.motion(path, self._topic)
        if self._kind != "accel" or not self._moved.in_world:
            return motion
        with_imu = self._imu.added_to(motion)
        return self._poses.added_to(motion) if with_imu.attitude is None else with_imu


def usable_heights(measured: Measurements) -> tuple[Heights, list[str]]:
    """Returns the usable heights, each stamp once, and remarks on the omitted ones."""
    unusable = ~np.isfinite(measured.usable_heights)
    saturated = ~unusable & measured.saturated
    told = (
        (int(np.count_nonzero(unusable)), "images without a usable height are left out"),
        (
            int(np.count_nonzero(saturated)),
            "saturated heights are left out: they are lower bounds",
        ),
    )
    kept = measured.chosen(~unusable & ~saturated).in_order()
    notes = [f"{count} {text}" for count, text in told if count]
    return Heights(kept.stamps, kept.heights, kept.stddev), notes


class _Comparisons:
    """Collects recorded SloshComparison messages."""

    def __init__(self) -> None:
        self._parts: list[Residuals] = []

    def add(self, columns: Columns) -> None:
        values = columns["residual_nonlinear"]
        kept = np.isfinite(values)
        for name in ("measured_stale", "estimate_stale"):
            kept &= ~columns[name].astype(bool)
        self._parts.append(Residuals(stamps_of(columns)[kept], values[kept]))

    def residuals(self) -> Residuals:
        """Returns the residuals [m] of all comparisons that have both heights."""
        if not self._parts:
            return Residuals(np.empty(0, dtype=np.int64), np.empty(0))
        stamps, values = (np.concatenate(column) for column in zip(*self._parts, strict=True))
        rising, first = np.unique(stamps, return_index=True)
        return Residuals(rising, values[first])


def sources_of(path: Path) -> tuple[BagReader, Sources]:
    """Returns a reader for a bag, and the topics of its motion and heights.

    Raises:
        SloshBagError: no readable bag, or nothing in it that drives a model.
    """
    reader = BagReader(path)
    return reader, find_sources(path, reader)


class PoseAttitudes:
    """Collects recorded poses of the container in the world frame.

    Args:
        world: name of the world's frame.

    Attributes:
        fields: the columns that it takes.
    """

    fields = (*STAMP, FRAME, *_TURN)

    def __init__(self, world: str) -> None:
        self._world = world
        self._stamps: list[Stamps] = []
        self._turns: list[Array] = []

    def add(self, columns: Mapping[str, NDArray[Any]]) -> None:
        """Adds consecutive messages with poses of the container."""
        turns = np.column_stack([columns[name] for name in _TURN])
        # A quaternion without a length is none; NaN compares false.
        usable = (columns[FRAME] == self._world) & (np.linalg.norm(turns, axis=1) > 0.0)
        self._stamps.append(stamps_of(columns)[usable])
        self._turns.append(turns[usable])

    def added_to(self, motion: RecordedMotion) -> RecordedMotion:
        """Returns the motion with attitude and angular velocity, if the poses cover it."""
        if not self._stamps:
            return motion
        stamps, first = np.unique(np.concatenate(self._stamps), return_index=True)
        if not _cover(stamps, motion.stamps):
            return motion
        turns = np.concatenate(self._turns)[first]
        span = max(1, round(TURN_NS / float(np.median(np.diff(stamps)))))
        turning = angular_velocity(stamps, turns, span)
        at = np.clip(motion.stamps, stamps[0], stamps[-1]) - stamps[0]
        since = stamps - stamps[0]
        attitude = Slerp(since, Rotation.from_quat(turns))(at).as_quat()
        rates = columns_at(at, since, turning)
        return replace(motion, attitude=attitude, angular_velocity=rates)


def _cover(stamps: Stamps, wanted: Stamps) -> bool:
    """Returns whether recorded stamps cover all wanted stamps, without long gaps around them."""
    if len(stamps) < 2:
        return False
    after = np.clip(np.searchsorted(stamps, wanted), 1, len(stamps) - 1)
    between = stamps[after] - stamps[after - 1]
    outside = np.maximum(stamps[0] - wanted, wanted - stamps[-1])
    return bool((between <= MAX_GAP_NS).all() and (outside <= MAX_GAP_NS).all())


def angular_velocity(stamps: Stamps, attitude: Array, span: int) -> Array:
    """Returns the mean angular velocity (N, 3) [rad/s] about each sample, in the container frame.

    Args:
        stamps: (N,) rising [ns].
        attitude: (N, 4) quaternions x, y, z, w, world ← container.
        span: samples to each side; fewer at the ends.
    """
    rows = np.arange(len(stamps))
    before, after = np.maximum(rows - span, 0), np.minimum(rows + span, len(rows) - 1)
    seconds = (stamps[after] - stamps[before])[:, np.newaxis] / SECOND
    turns = Rotation.from_quat(attitude)
    angles: Array = (turns[before].inv() * turns[after]).as_rotvec()
    return np.divide(angles, seconds, out=np.zeros_like(angles), where=seconds > 0.0)
