"""Compares the mounting of a sensor in a bag with another source of the motion."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_base.types import Array, Integers
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.inputs.frames import SensorTransform
from slosh_motion.inputs.inputs import (
    ACCEL,
    IMU,
    JOINTS,
    ODOMETRY,
    POSE,
    ROBOT,
    TRANSFORMS,
    InputSettings,
    WantedInput,
)
from slosh_motion.mounting.verdict import MountingVerdict
from slosh_motion.mounting.watch import MountingWatch
from slosh_motion.recorded.input_blocks import InputBlocks, by_chunk, reading
from slosh_motion.recorded.inputs import InputReader, fields, readings_of, stamps_of
from slosh_motion.recorded.settings import first
from slosh_motion.recorded.sources import Sources, find_sources

SENSORS = (IMU, ACCEL)
"""Kinds of topics whose mounting can be compared, the first that is there is taken."""
REFERENCES = (POSE, JOINTS, TRANSFORMS, ODOMETRY)
"""Kinds of topics that tell the container's motion, in the order in which they are tried."""
_FRAME = "header.frame_id"


class MountingWanted(NamedTuple):
    """The mounting check that the user wants: sensor, reference and stated mounting.

    Attributes:
        sensor, reference: kinds; None: the first of SENSORS, of REFERENCES that is there.
        rotation: roll, pitch, yaw of container ← sensor [rad]; None: as recorded or by TF.
        to_origin: from the sensor to the container's origin [m]; None: likewise.
        cell: namespace; None: the bag's only or first cell.
    """

    sensor: str | None = None
    reference: str | None = None
    robot: WantedInput | None = None
    rotation: tuple[float, float, float] | None = None
    to_origin: tuple[float, float, float] | None = None
    cell: str | None = None


class MountingCheck(NamedTuple):
    """Result of the check of a sensor's mounting in a bag.

    Attributes:
        reference: kind and topic of what it was compared with; empty: there is nothing.
        verdict: of the comparison; None: nothing moved, or there is nothing.
        doubts: what the sensor's own values say: gravity, unit, tilt.
        missing: why nothing was compared; empty: something was.
    """

    kind: str
    topic: str
    messages: int
    frame: str
    reference: tuple[str, str]
    verdict: MountingVerdict | None
    motions: int
    told: SensorTransform
    doubts: tuple[InputDoubt, ...]
    reference_doubts: tuple[InputDoubt, ...]
    missing: str

    @property
    def wrong(self) -> tuple[str, ...]:
        """Faults of the sensor's mounting, one clause each; empty if none were found."""
        if self.verdict is not None:
            return self.verdict.wrong
        return tuple(doubt for doubt in self.doubts if doubt.wrong)


def check_mounting(path: Path, wanted: MountingWanted) -> MountingCheck:
    """Checks the mounting of a sensor in a bag by comparison with another source.

    Raises:
        SloshBagError: no readable bag, no such sensor or reference, or the robot's description
            does not fit.
    """
    reader = BagReader(path)
    sources = _first_of(path, reader, SENSORS, wanted.sensor, wanted.cell)
    if sources is None:
        raise SloshBagError(f"{path}: holds no message of {' or '.join(SENSORS)} to check")
    how = _said(reader, sources, wanted)
    other = _first_of(path, reader, REFERENCES, wanted.reference, wanted.cell)
    sensor = _Sensor(sources.kind, how)
    if other is None:
        for chunk in by_chunk(reader.blocks([sources.input])):
            sensor.take(reader.columns(chunk[0], sensor.fields))
        missing = f"the bag holds no {', '.join(REFERENCES[:-1])} or {REFERENCES[-1]}"
        return sensor.answer(sources, ("", ""), (), missing)
    motion = _Motion(reader, other, _reference_settings(reader, other, wanted))
    for chunk in by_chunk(reader.blocks([sources.input, *motion.topics])):
        motion.take([block for block in chunk if block.topic in motion.topics], sensor)
        for block in chunk:
            if block.topic == sources.input:
                sensor.take(reader.columns(block, sensor.fields))
        sensor.look()
    motion.finish()
    sensor.look(finished=True)
    return sensor.answer(sources, (other.kind, other.input), motion.doubts, motion.missing())


def _first_of(
    path: Path, reader: BagReader, kinds: tuple[str, ...], wanted: str | None, cell: str | None
) -> Sources | None:
    """Returns the topics of the wanted input type, or of the first one that is recorded."""
    if wanted is not None:
        return find_sources(path, reader, wanted, cell)
    for kind in kinds:
        try:
            return find_sources(path, reader, kind, cell)
        except SloshBagError:
            continue
    return None


def _said(reader: BagReader, sources: Sources, wanted: MountingWanted) -> InputSettings:
    """Returns the settings with the mounting that the user states for the sensor."""
    how = _own_settings(reader, sources)
    told = how.transform
    roll, pitch, yaw = wanted.rotation or (told.roll, told.pitch, told.yaw)
    place = wanted.to_origin or told.to_origin
    return how._replace(transform=SensorTransform(roll, pitch, yaw, place))


def _own_settings(reader: BagReader, sources: Sources) -> InputSettings:
    """Returns a sensor's mounting settings: the estimator's, or else those of fixed transforms."""
    started = first(sources.starts, "estimator")
    if started is not None and started.parameters.get("input") == sources.kind:
        return reading(reader, sources)
    plain = InputSettings(any_world=True)
    if started is not None:
        names = started.parameters
        frames = (names.get("world_frame", "world"), names.get("container_frame", "container"))
        plain = plain._replace(
            frames=frames, urdf=started.files.get(ROBOT, ""),
            tool_frame=names.get("tool_frame", ""),
        )  # fmt: skip
    return reading(reader, sources, plain)


def _reference_settings(
    reader: BagReader, sources: Sources, wanted: MountingWanted
) -> InputSettings:
    how = _own_settings(reader, sources)
    return how if wanted.robot is None else wanted.robot.over(how)._replace(kind=sources.kind)


class _Sensor:
    """Collects the messages of the sensor whose mounting is checked."""

    def __init__(self, kind: str, how: InputSettings) -> None:
        self._reader = InputReader(kind, how)
        self.fields = fields(kind)
        self._kind, self._how = kind, how
        self._watch: MountingWatch | None = None
        self._count, self._frame = 0, ""
        self._waiting: list[Any] = []

    def take(self, columns: Mapping[str, Any]) -> None:
        """Adds consecutive messages of the sensor to the mounting check."""
        stamps = stamps_of(columns)
        if not len(stamps):
            return
        if self._watch is None:
            self._frame = str(columns[_FRAME][0])
            expected, in_world = self._how.expected(self._kind, self._frame)
            self._watch = MountingWatch(expected, in_world=in_world)
            for row in self._waiting:
                self._watch.take_motion(*row)
        self._count += len(stamps)
        self._reader.samples(stamps, columns, np.arange(len(stamps)))
        for stamp, force, rate in _rows(stamps, *readings_of(self._kind, columns)):
            self._watch.take_sensor(stamp, force, rate)

    def take_motion(self, *row: Any) -> None:
        """Adds a sample of the container's motion to the mounting check."""
        if self._watch is None:
            self._waiting.append(row)
        else:
            self._watch.take_motion(*row)

    def look(self, *, finished: bool = False) -> None:
        """Checks the mounting with each motion that has ended since the last call."""
        if self._watch is not None:
            self._watch.look(finished=finished)

    def answer(
        self, sources: Sources, reference: tuple[str, str],
        doubts: tuple[InputDoubt, ...], missing: str,
    ) -> MountingCheck:  # fmt: skip
        """Returns the result of the mounting check."""
        self._reader.finish()
        watch = self._watch
        verdict = None if watch is None else watch.verdict
        if reference[0] and not missing and verdict is None:
            missing = "no motion in it that both tell: 0.3 s and 0.3 m/s² at least"
        return MountingCheck(
            sources.kind, sources.input, self._count, self._frame, reference, verdict,
            0 if watch is None else watch.motions, self._how.transform, self._reader.doubts,
            doubts, missing if verdict is None else "",
        )  # fmt: skip


class _Motion:
    """Collects the messages of the source that gives the container's motion."""

    def __init__(self, reader: BagReader, sources: Sources, how: InputSettings) -> None:
        self._blocks = InputBlocks(reader, sources, how)
        self._reader = InputReader(sources.kind, how)
        self.topics = self._blocks.topics
        self._count = 0

    def take(self, blocks: list[Any], sensor: _Sensor) -> None:
        """Adds the message blocks of a chunk and passes the motion on to the sensor."""
        if not blocks:
            return
        columns = self._blocks.columns(blocks)
        stamps = stamps_of(columns)
        if not len(stamps):
            return
        samples = self._reader.samples(stamps, columns, np.arange(len(stamps)))
        self._count += len(samples.stamps)
        poses = None if samples.poses is None else samples.poses.tolist()
        for number, (stamp, a) in enumerate(
            zip(samples.stamps.tolist(), samples.accelerations.tolist(), strict=True)
        ):
            sensor.take_motion(stamp, tuple(a), None if poses is None else poses[number])

    def finish(self) -> None:
        """Processes the remaining samples at the end of the input."""
        self._reader.finish()

    @property
    def doubts(self) -> tuple[InputDoubt, ...]:
        """Suspected faults of this source, one sentence each."""
        return self._reader.doubts

    def missing(self) -> str:
        """Returns why this source gives no motion; empty if it gives one."""
        if self._count:
            return ""
        return self._blocks.trouble() or f"it tells no motion{self._reader.refusal}"


def _rows(stamps: Integers, force: Array, rate: Array | None) -> Iterator[tuple[int, Any, Any]]:
    turns = [None] * len(stamps) if rate is None else map(tuple, rate.tolist())
    return zip(stamps.tolist(), map(tuple, force.tolist()), turns, strict=True)
