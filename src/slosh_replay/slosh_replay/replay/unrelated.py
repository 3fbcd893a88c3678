"""Judges a run whose measured clock and still level are unknown.

The offset between the two clocks is estimated for each model by its own least RMS, all in one
search window, and the models are judged over the motion alone. That needs the whole run at once:
such records come from laboratories and last minutes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_base.types import Array
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_metrics.alignment import (
    ClockOffset,
    StillLevel,
    estimate_clock_offset,
    find_still_level,
    onset_offset,
)
from slosh_metrics.clock_drift import estimate_clock_drift
from slosh_metrics.motion_spans import motion_spans
from slosh_replay.recording.heights import Measurements
from slosh_replay.replay.accuracy import judge
from slosh_replay.replay.model_set import ModelHeights
from slosh_replay.replay.monitor_feed import Heights, MonitorFeed
from slosh_replay.replay.result import ReplayResult
from slosh_replay.replay.series import Series
from slosh_report.errors import SloshReportError


class WholeRun(NamedTuple):
    """All that drove and measured a run.

    Attributes:
        names: of the models.
        heights: of the models.
        acceleration: (M, 3) the input [m/s²].
        measured: by the camera.
    """

    names: Sequence[str]
    heights: ModelHeights
    acceleration: Array
    measured: Measurements


class _Alignment(NamedTuple):
    """Where the measurement lies over the models: still level, clock by model, motion."""

    still: StillLevel
    clocks: list[ClockOffset]
    start: float
    end: float


def judge_unrelated(
    name: str, source: str, run: WholeRun, monitor: MonitorSettings
) -> ReplayResult:
    """The result of such a run.

    The 3D models' estimates are monitored, shifted by the 3D-NL model's offset; measured heights
    count from the still level.

    Args:
        name: of the bag.
        source: topic that drove the models.
        run: the run.
        monitor: limits that are watched.

    Raises:
        SloshBagError: the two sides cannot be laid over each other.
    """
    t = _seconds(run.measured.stamps)
    raw = run.measured.usable_heights
    found = _align(name, t, raw, run)
    raised = raw - found.still.level
    model_t = _seconds(run.heights.stamps)
    heights = {
        model: np.interp(t - clock.offset, model_t, column, left=np.nan, right=np.nan)
        for model, column, clock in zip(run.names, _raised(run).T, found.clocks, strict=True)
    }
    with Series(len(run.names)) as series:
        rows = np.zeros(len(t), dtype=series.dtype)
        rows["stamp"], rows["measured"], rows["azimuth"] = run.measured.stamps, raised, np.nan
        for column, (model, clock) in enumerate(zip(run.names, found.clocks, strict=True)):
            shifted = t - clock.offset
            inside = (shifted >= found.start) & (shifted <= found.end)
            rows["heights"][:, column] = np.where(inside, heights[model], np.nan)
        rows["usable"], rows["motion"], rows["model_azimuth"] = True, -1, np.nan
        series.append(rows)
        judged = judge(series, run.names, clocks=found.clocks)
    shift_ns = round(found.clocks[-1].offset * 1e9)
    feed = MonitorFeed(monitor)
    _monitor(feed, run, raised, shift_ns)
    none = np.full(len(t), np.nan)
    return ReplayResult(
        name=name, source=source, stamps=run.measured.stamps, measured=raised, heights=heights,
        accuracy=judged.models, events=tuple(feed.take_events()),
        counters={"images": len(t), "spikes": judged.spikes,
                  "unmatched_images": feed.monitor.unmatched},
        still=found.still, azimuth=none, model_azimuth=none, flags=run.measured.flags,
        limits=monitor,
        warnings=tuple(f"{name}: {line}" for line in (judged.warning, _drift(found, run)) if line),
    )  # fmt: skip


def _drift(found: _Alignment, run: WholeRun) -> str:
    """That the heights' clock runs at another rate; empty: nothing of the kind is seen."""
    model_t = _seconds(run.heights.stamps)
    motion = (model_t >= found.start) & (model_t <= found.end)
    drift = estimate_clock_drift(
        _seconds(run.measured.stamps),
        run.measured.usable_heights - found.still.level,
        model_t[motion],
        _raised(run)[motion, -1],
        found.clocks[-1].offset,
    )
    return drift.text() if drift.seen else ""


def _align(name: str, t: Array, raw: Array, run: WholeRun) -> _Alignment:
    model_t = _seconds(run.heights.stamps)
    spans = motion_spans(run.heights.stamps, run.acceleration)
    if not spans:
        raise SloshBagError(f"{name}: the container does not move; there is nothing to compare")
    first, last = np.searchsorted(run.heights.stamps, (spans[0].start_ns, spans[-1].end_ns))
    motion = slice(int(first), int(last))
    heights = _raised(run)
    try:
        still = find_still_level(t, raw)
        centre = onset_offset(t, raw, model_t, heights.mean(axis=1), still)
        clocks = [
            estimate_clock_offset(t, raw, model_t[motion], column[motion], centre=centre)
            for column in heights.T
        ]
    except SloshReportError as error:
        raise SloshBagError(f"{name}: {error}") from None
    return _Alignment(still, clocks, float(model_t[motion.start]), float(model_t[motion.stop - 1]))


def _monitor(feed: MonitorFeed, run: WholeRun, raised: Array, shift_ns: int) -> None:
    heights = run.heights
    readings = _raised(run)[:, [1, 3]]
    estimates = Heights(
        heights.stamps + shift_ns, heights.heights[:, 1], heights.heights[:, 3], heights.flags,
        None if np.array_equal(readings, heights.heights[:, [1, 3]]) else readings,
    )  # fmt: skip
    feed.add(estimates, run.measured._replace(heights=raised))


def _raised(run: WholeRun) -> Array:
    """What a sensor reads of the models' heights (M, K) [m], above what it reads at rest.

    A delay is part of the clocks' offset, an offset of the heights part of the still level.
    """
    readings = run.heights.as_read
    raised: Array = readings - (readings[0] - run.heights.heights[0])
    return raised


def _seconds(stamps: NDArray[np.int64]) -> Array:
    return np.asarray(stamps * 1e-9, dtype=np.float64)
