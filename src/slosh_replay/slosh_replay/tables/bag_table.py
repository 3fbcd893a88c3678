"""Converts bags to motion tables.

The rows are the input samples that the estimator would take, and the moments of the measured
heights: in between the inputs are interpolated linearly, as the models take them, so that every
height stays at its own moment. Where the stamps coincide nothing is interpolated.

| input | acceleration | qx … qw | wx … wz |
|---|---|---|---|
| accel | as published | the imu's orientation | the imu's angular velocity |
| imu | Rz(ψ) f - g ẑ, with gravity's share along a tilted floor | the yaw ψ alone | the imu's |
| pose, joints, tf | second derivative of the position | the pose's | from orientations |

For accel the imu counts only where it is in the container's frame, beside an accel in the
world's, and has a sample at every stamp of accel: as in the bag of a table.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.topic_choice import find_topic
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagReader, TopicInfo, messages_of
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_motion.inputs.inputs import IMU, InputSettings, WantedInput
from slosh_motion.recorded.input_blocks import InputBlocks, by_chunk, reading
from slosh_motion.recorded.motion import AttitudeCollector, MotionCollector, RecordedMotion
from slosh_motion.recorded.sources import (
    TABLE_COLUMNS,
    TABLE_ORIGIN,
    Sources,
    clocks_unrelated,
    find_sources,
)
from slosh_motion.tables.motion_table import MSH, MotionTable, Remark, eta_azimuths
from slosh_replay.recording.heights import HeightCollector, Measurements
from slosh_replay.tables.table_bag import (
    HEIGHTS,
    HEIGHTS_TYPE,
    IMU_TYPE,
    SURFACE,
    SURFACE_TYPE,
    WALL_POINT,
    table_times,
)

Stamps = NDArray[np.int64]

NO_HEIGHTS: Final = "none"


@dataclass(frozen=True, slots=True)
class TableSettings:
    """Settings for the conversion of a bag to a table.

    Attributes:
        kind: of the input; None: what the recorded estimator read, or the first of them
            that the bag holds.
        measured: topic of the measured heights; 'none': without; None: free_surface, if any.
        absolute: t is the stamp; otherwise it counts from the first row, or in the bag of a
            table from that table's own origin.
        inputs: how the input is read, or in what other than by the recorded estimator; None: as
            by that.
    """

    kind: str | None = None
    measured: str | None = None
    absolute: bool = False
    inputs: InputSettings | WantedInput | None = None


class BagTable(NamedTuple):
    """The motion table of a bag, with remarks on the conversion.

    Attributes:
        table: the table.
        origin_ns: the stamp at t = 0 [ns].
        source: the topic that gave the motion.
        measured: the topic that gave the heights; empty: none.
        notes: what the table cannot hold of the bag, one line each.
    """

    table: MotionTable
    origin_ns: int
    source: str
    measured: str
    notes: tuple[str, ...]


def read_bag_table(
    path: Path,
    settings: TableSettings | None = None,
    progress: Callable[[int], object] = lambda count: None,
) -> BagTable:
    """Converts a bag to a motion table.

    Args:
        path: the bag's folder or MCAP file.
        settings: which topics, and how they are read.
        progress: is told how many messages were read since it was told last.

    Raises:
        SloshBagError: no readable bag, no such topic, no usable input, stamps that go back, or
            heights on a clock of their own.
    """
    chosen = settings or TableSettings()
    reader = BagReader(path)
    sources = find_sources(path, reader, chosen.kind)
    how = reading(reader, sources, chosen.inputs)
    topics, facts = reader.topics(), sources.facts
    columns = facts.get(TABLE_COLUMNS, "").split(",") if chosen.measured is None else []
    surface = _surface(path, topics, chosen.measured, sources, MSH in columns)
    if surface and clocks_unrelated(facts):
        raise SloshBagError(
            f"{path}: {sources.input} and {surface} have unrelated clocks: the heights cannot be "
            f"placed on the motion; leave them out (measured: {NO_HEIGHTS})"
        )
    collector = MotionCollector(sources.kind, how)
    beside, heights = AttitudeCollector(how.frames[1]), TableHeights(columns)
    blocks = InputBlocks(reader, sources, how)
    takers: dict[str, _Taker] = {}
    if sources.kind == "accel":
        takers |= _beside(topics, sources.input, IMU, IMU_TYPE, (beside.fields, beside.add))
    if surface:
        takers[surface] = (heights.surfaces.fields, heights.surfaces.add)
    if surface and chosen.measured is None:
        takers |= _beside(topics, surface, HEIGHTS, HEIGHTS_TYPE, (None, heights.add_walls))
    for chunk in by_chunk(reader.blocks([*blocks.topics, *takers])):
        own = [block for block in chunk if block.topic in blocks.topics]
        if own:
            collector.add(blocks.columns(own))
        for block in chunk:
            if block.topic in takers:
                names, take = takers[block.topic]
                take(reader.columns(block, names) if names else _decoded(reader, block))
            progress(len(block))
    blocks.check()
    clocks = () if TABLE_COLUMNS in facts else tuple(blocks.doubts())
    motion = collector.motion(path, sources.input, clocks)
    if sources.kind == "accel" and collector.in_world and not how.placed:
        motion = beside.added_to(motion)
    motion, placed = heights.placed(motion, how.gate.max_gap)
    origin = _origin(path, chosen.absolute, facts, motion.stamps)
    table = MotionTable(
        _times(path, motion.stamps - origin),
        motion.acceleration,
        motion.attitude,
        motion.angular_velocity,
        placed.msh if surface and heights.has_msh else None,
        placed.eta_azimuth,
        placed.eta,
    )
    told = [blocks.trouble()] if blocks.trouble() else []
    remarks = [Remark(str(doubt), doubt.wrong) for doubt in (*clocks, *collector.doubts)]
    table = replace(table, remarks=(*(Remark(line, wrong=True) for line in told), *remarks))
    notes = (*reader.warnings, *told, *clocks, *collector.notes(), *placed.notes)
    return BagTable(table, origin, sources.input, surface, notes)


class PlacedHeights(NamedTuple):
    """Measured heights at the samples of a motion: maximum, or wall heights by azimuth."""

    msh: Array
    eta_azimuth: Array | None
    eta: Array | None
    notes: tuple[str, ...]


class TableHeights:
    """Collects measured heights and assigns them to the samples of a motion.

    Args:
        columns: those of the table that the bag was made of; empty: of none.

    Attributes:
        surfaces: takes FreeSurface messages.
        has_msh: whether the table is to have the column.
    """

    def __init__(self, columns: list[str]) -> None:
        self.has_msh = MSH in columns or not any(columns)
        azimuth = eta_azimuths(columns)
        self._azimuth: Array | None = azimuth if len(azimuth) else None
        self.surfaces = HeightCollector()
        self._wall_stamps, self._walls = array("q"), array("d")

    def add_walls(self, messages: list[Any]) -> None:
        """Adds measured wall heights from PointCloud2 messages."""
        for message in messages:
            stamp = int(message.header.stamp.sec) * SECOND + int(message.header.stamp.nanosec)
            self._add_wall(stamp, message)

    def _add_wall(self, stamp: int, message: Any) -> None:
        if [f.name for f in message.fields] != list(WALL_POINT.names or ()) or (
            message.point_step != WALL_POINT.itemsize or message.is_bigendian
        ):
            raise SloshBagError(
                f"{HEIGHTS} at {stamp / SECOND:.3f} s: points are not azimuth and height"
            )
        points = np.frombuffer(np.ascontiguousarray(message.data).data, dtype=WALL_POINT)
        if self._azimuth is None:
            self._azimuth = points["azimuth"].copy()
        if not np.array_equal(self._azimuth, points["azimuth"]):
            raise SloshBagError(f"{HEIGHTS} at {stamp / SECOND:.3f} s: the azimuths change")
        self._wall_stamps.append(stamp)
        self._walls.extend(points["height"].tolist())

    def placed(
        self, motion: RecordedMotion, max_gap: float
    ) -> tuple[RecordedMotion, PlacedHeights]:
        """Returns the motion with samples added at the heights' stamps, and the heights.

        Args:
            motion: the motion.
            max_gap: longest time between two samples of the motion that is interpolated [s].
        """
        came = self.surfaces.measurements()
        kept = came.chosen(~np.isnan(came.usable_heights)).in_order()
        wall_stamps, first_wall = np.unique(
            np.array(self._wall_stamps, dtype=np.int64), return_index=True
        )
        wanted = np.union1d(kept.stamps, wall_stamps)
        inside = _reachable(motion.stamps, wanted, round(max_gap * SECOND))
        between = np.setdiff1d(wanted[inside], motion.stamps)
        full = with_rows_at(motion, between)
        msh = np.full(len(full.stamps), np.nan)
        row, known = _rows(full.stamps, kept.stamps)
        msh[row[known]] = kept.heights[known]
        eta = None
        if self._azimuth is not None:
            eta = np.full((len(full.stamps), len(self._azimuth)), np.nan)
            row, known = _rows(full.stamps, wall_stamps)
            walls = np.array(self._walls, dtype=np.float64).reshape(-1, len(self._azimuth))
            eta[row[known]] = walls[first_wall][known]
        notes = _notes(len(between), int(np.count_nonzero(~inside)), came)
        return full, PlacedHeights(msh, self._azimuth, eta, notes)


def _notes(between: int, outside: int, came: Measurements) -> tuple[str, ...]:
    told = (
        (between, "rows between two input samples, at the moments of heights: interpolated"),
        (outside, "heights left out: the input has no sample around them"),
        (int(np.count_nonzero(came.unusable)), "images without a usable height"),
        (
            int(np.count_nonzero(came.saturated)),
            "heights are lower bounds (SATURATED); a table cannot say so",
        ),
    )
    return tuple(f"{count} {text}" for count, text in told if count)


def with_rows_at(motion: RecordedMotion, between: Stamps) -> RecordedMotion:
    """Adds linearly interpolated samples to the motion at the given stamps.

    Args:
        motion: the motion.
        between: (M,) rising stamps within the motion, none of them one of its own [ns].
    """
    if not len(between):
        return motion
    after = np.searchsorted(motion.stamps, between)
    before = after - 1
    start, end = motion.stamps[before], motion.stamps[after]
    share = ((between - start) / (end - start))[:, np.newaxis]
    order = np.argsort(np.concatenate([motion.stamps, between]), kind="stable")

    def filled(values: Array | None, *, unit: bool = False) -> Array | None:
        if values is None:
            return None
        left, right = values[before], values[after]
        if unit:
            left, right = _unit(left), _unit(right)
            # A quaternion and its negative are one attitude: the shorter way is taken.
            right = np.where((left * right).sum(axis=1, keepdims=True) < 0.0, -right, right)
        middle = left + (right - left) * share
        return np.concatenate([values, _unit(middle) if unit else middle])[order]

    acceleration = filled(motion.acceleration)
    return RecordedMotion(
        np.concatenate([motion.stamps, between])[order],
        motion.acceleration if acceleration is None else acceleration,
        filled(motion.attitude, unit=True),
        filled(motion.angular_velocity),
    )


def _unit(quaternions: Array) -> Array:
    unit: Array = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    return unit


def _rows(rows: Stamps, stamps: Stamps) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Returns the sample index for each stamp, and whether the sample has exactly this stamp."""
    row = np.minimum(np.searchsorted(rows, stamps), len(rows) - 1)
    return row, rows[row] == stamps


def _reachable(rows: Stamps, stamps: Stamps, max_gap_ns: int) -> NDArray[np.bool_]:
    """Returns whether each stamp is at a sample, or between two samples close to each other."""
    after = np.searchsorted(rows, stamps)
    last = len(rows) - 1
    exact = rows[np.minimum(after, last)] == stamps
    gap = rows[np.minimum(after, last)] - rows[np.maximum(after - 1, 0)]
    reachable: NDArray[np.bool_] = exact | ((after > 0) & (after <= last) & (gap <= max_gap_ns))
    return reachable


_Taker = tuple[Sequence[str] | None, Callable[[Any], None]]


def _beside(
    topics: Mapping[str, TopicInfo], topic: str, name: str, message_type: str, taker: _Taker
) -> dict[str, _Taker]:
    """Returns the handler of a topic next to another topic; empty if the bag lacks it."""
    other = f"{topic.rpartition('/')[0]}/{name}"
    found = topics.get(other)
    return {other: taker} if found and found.message_type == message_type else {}


def _decoded(reader: BagReader, block: MessageBlock) -> list[Any]:
    """Returns the messages of a block, each decoded to an object."""
    return [reader.decode(message) for message in messages_of(block)]


def _surface(
    path: Path,
    topics: Mapping[str, TopicInfo],
    measured: str | None,
    sources: Sources,
    expected: bool,
) -> str:
    """Returns the topic of the measured heights; empty if there is none."""
    if measured == NO_HEIGHTS:
        return ""
    if measured is None:
        # Without messages where the heights of the table that the bag was made of are all unknown.
        empty = f"{sources.input.rpartition('/')[0]}/{SURFACE}" if expected else ""
        return sources.surface or (empty if empty in topics else "")
    topic = find_topic(path, topics, measured)
    if topics[topic].message_type != SURFACE_TYPE:
        raise SloshBagError(f"{path}: {topic} is {topics[topic].message_type}, not {SURFACE_TYPE}")
    return topic


def _origin(path: Path, absolute: bool, facts: Mapping[str, str], stamps: Stamps) -> int:
    if absolute:
        return 0
    noted = facts.get(TABLE_ORIGIN)
    if noted is None:
        return int(stamps[0])
    try:
        return int(noted)
    except ValueError:
        raise SloshBagError(f"{path}: {TABLE_ORIGIN} = {noted!r} is not a whole number") from None


def _times(path: Path, nanoseconds: Stamps) -> Array:
    times = table_times(nanoseconds)
    if (np.diff(times) <= 0.0).any():
        raise SloshBagError(
            f"{path}: stamps differ by less than the resolution of seconds since the epoch; "
            "count from the first row instead"
        )
    return times
