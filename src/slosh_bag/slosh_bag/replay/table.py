"""Replays a motion table."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.motion_table import MotionTable
from slosh_bag.replay.bank import EstimatorBank
from slosh_bag.replay.conclusion import conclude
from slosh_bag.replay.inputs import InputReader, InputSettings
from slosh_bag.replay.monitor_feed import Measurements, MonitorFeed
from slosh_bag.replay.result import ReplayResult
from slosh_bag.replay.run import Parts, ReplayRun
from slosh_bag.replay.series import Series
from slosh_estimator.gate import GateSettings
from slosh_estimator.monitor import MonitorSettings
from slosh_model.model import Model

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

_LONGEST_STEP = 3600.0
"""A table's rows belong together, however far apart they are [s]."""
_BLOCK = 50_000


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
    stamps = np.rint(table.t * 1e9).astype(np.int64)
    settings = InputSettings("accel", GateSettings(max_gap=_LONGEST_STEP))
    with Series(4) as series:
        parts = Parts(
            EstimatorBank(model),
            InputReader("accel", settings),
            MonitorFeed(monitor or MonitorSettings()),
            series,
        )
        run = ReplayRun(name, parts)
        for start in range(0, len(stamps), _BLOCK):
            rows = slice(start, start + _BLOCK)
            newest = int(stamps[rows][-1])
            run.add_input(_columns(stamps[rows], table.acceleration[rows]), newest)
            run.add_measurements(_measurements(stamps[rows], heights[rows]), newest)
            run.advance()
        run.advance(final=True)
        return conclude(name, name, run, parts)


def _columns(stamps: Integers, acceleration: Array) -> dict[str, NDArray[Any]]:
    """The rows as columns of AccelStamped.msg."""
    seconds, nanoseconds = np.divmod(stamps, 1_000_000_000)
    return {
        "header.stamp.sec": seconds,
        "header.stamp.nanosec": nanoseconds,
        "header.frame_id": np.full(len(stamps), "world", dtype=object),
        **{f"accel.linear.{axis}": acceleration[:, i] for i, axis in enumerate("xyz")},
    }


def _measurements(stamps: Integers, heights: Array) -> Measurements:
    unknown = np.full(len(stamps), np.nan)
    return Measurements(stamps, heights, np.zeros(len(stamps), dtype=np.int64), unknown, unknown)
