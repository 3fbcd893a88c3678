"""Replays a motion table with measured heights, without a bag."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, Integers
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_model.pose import pose_rows
from slosh_motion.checks.table_checks import InputDoubt, motion_doubts
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import InputSettings
from slosh_motion.inputs.sampling import Samples
from slosh_motion.recorded.inputs import InputReader
from slosh_motion.tables.motion_table import MotionTable
from slosh_replay.recording.heights import Measurements
from slosh_replay.replay.conclusion import conclude
from slosh_replay.replay.result import ReplayResult
from slosh_replay.replay.series import Series
from slosh_replay.replay.setting import Outputs, Setting
from slosh_replay.replay.stream import ReplayStream

_LONGEST_STEP = 3600.0
"""A table's rows belong together, however far apart they are [s]."""
_BLOCK = 50_000
_YAW, _POSE = "yaw", "pose"


class TableReader(InputReader):
    """Converts rows of a table to samples, with the container's attitude if the table has it.

    Args:
        table: the table; as a whole it tells more than row by row.
    """

    def __init__(self, table: MotionTable) -> None:
        gate = GateSettings(max_gap=_LONGEST_STEP, max_jump=math.inf, confirms=False)
        super().__init__("accel", InputSettings("accel", gate, whole=True))
        self._doubts = motion_doubts(table.t, table.acceleration, table.attitude)

    @property
    def doubts(self) -> tuple[InputDoubt, ...]:
        """Suspected faults of the table, one sentence each."""
        return self._doubts

    @property
    def faults(self) -> tuple[str, ...]:
        """Returns no faults, since the table's suspected faults already include them."""
        return ()

    def samples(
        self, stamps: Integers, columns: Mapping[str, NDArray[Any]], rows: NDArray[Any]
    ) -> Samples:
        """Returns the samples of selected rows; drops rows with equal stamps."""
        found = super().samples(stamps, columns, rows)
        if _POSE not in columns:
            return found
        used = rows[np.searchsorted(stamps[rows], found.stamps)]
        return found._replace(yaws=columns[_YAW][used], poses=columns[_POSE][used])


def replay_table(
    name: str,
    table: MotionTable,
    model: Model,
    monitor: MonitorSettings | None = None,
    *,
    source: str | None = None,
    origin_ns: int = 0,
    outputs: Outputs | None = None,
) -> ReplayResult:
    """Replays a motion table; its time column is the clock of inputs and heights.

    Args:
        name: how the result is called.
        table: the motion, with `msh` or `eta`.
        model: container and liquid.
        monitor: limits that are watched.
        source: what drives the models, for the result; None: the table.
        origin_ns: stamp of the time 0 [ns].
        outputs: receives estimates, comparisons and events as they come.

    Raises:
        SloshBagError: the table holds no measured heights.
    """
    heights = table.measured
    if heights is None:
        raise SloshBagError(f"{name}: holds no measured heights; add a column msh or eta_…")
    stamps = np.rint(table.t * 1e9).astype(np.int64) + origin_ns
    columns = _columns(stamps, table)
    limits = (monitor or MonitorSettings()).under_rim(model)
    setting = Setting(model, TableReader(table), limits, outputs=outputs or Outputs())
    with Series(4) as series:
        stream = ReplayStream(name, setting, series)
        for start in range(0, len(stamps), _BLOCK):
            rows = slice(start, start + _BLOCK)
            newest = int(stamps[rows][-1])
            stream.add_input({key: column[rows] for key, column in columns.items()}, newest)
            stream.add_measurements(_measurements(stamps[rows], heights[rows]), newest)
            stream.advance()
        stream.advance(final=True)
        return conclude(name, source or name, stream)


def _columns(stamps: Integers, table: MotionTable) -> dict[str, NDArray[Any]]:
    """Returns the table as columns of AccelStamped messages, with yaw and pose if known."""
    seconds, nanoseconds = np.divmod(stamps, SECOND)
    yaws, poses = pose_rows(table.t, table.attitude, table.angular_velocity)
    turning = {_YAW: yaws, _POSE: poses} if len(poses) else {}
    return {
        **turning,
        "header.stamp.sec": seconds,
        "header.stamp.nanosec": nanoseconds,
        "header.frame_id": np.full(len(stamps), "world", dtype=object),
        **{f"accel.linear.{axis}": table.acceleration[:, i] for i, axis in enumerate("xyz")},
    }


def _measurements(stamps: Integers, heights: Array) -> Measurements:
    unknown = np.full(len(stamps), np.nan)
    return Measurements(stamps, heights, np.zeros(len(stamps), dtype=np.int64), unknown, unknown)
