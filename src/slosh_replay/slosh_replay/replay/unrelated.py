"""Aligns measurements of unknown clock offset and still level with the estimates.

The offset between the two clocks is estimated for each model by its own least RMS, all in one
search window, and the models are judged over the motion alone. That needs the whole run at once:
such records come from laboratories and last minutes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_base.types import Array
from slosh_motion.signals.alignment import (
    ClockOffset,
    StillLevel,
    estimate_clock_offset,
    find_still_level,
    onset_offset,
)
from slosh_motion.signals.clock_drift import estimate_clock_drift
from slosh_motion.signals.motion_spans import motion_spans
from slosh_replay.recording.heights import Measurements
from slosh_replay.replay.model_set import ModelHeights
from slosh_report.errors import SloshReportError


class Alignment(NamedTuple):
    """A measurement that is aligned with the estimates.

    Attributes:
        still: level of the measurement at rest.
        clocks: offset of the measured clock, by model.
        start, end: of the motion, on the models' clock [s].
        measured: heights above the still level, by the measured clock.
        estimates: by the measured clock as the last model finds it.
        heights: (N, K) of the models at the images [m].
        drift: that the measured clock runs at another rate; empty: nothing of the kind is seen.
    """

    still: StillLevel
    clocks: list[ClockOffset]
    start: float
    end: float
    measured: Measurements
    estimates: ModelHeights
    heights: Array
    drift: str

    def rows(self, dtype: np.dtype[np.void]) -> NDArray[np.void]:
        """Returns the images as rows of a series, with the heights of the models."""
        t = _seconds(self.measured.stamps)
        rows = np.zeros(len(t), dtype=dtype)
        rows["stamp"], rows["measured"] = self.measured.stamps, self.measured.heights
        rows["azimuth"], rows["model_azimuth"] = np.nan, np.nan
        rows["usable"], rows["motion"], rows["flags"] = True, -1, self.measured.flags
        shifted = t[:, None] - [clock.offset for clock in self.clocks]
        inside = (shifted >= self.start) & (shifted <= self.end)
        rows["heights"] = np.where(inside, self.heights, np.nan)
        return rows


def align(name: str, estimates: ModelHeights, measured: Measurements) -> Alignment:
    """Aligns a measurement with the estimates in time and height.

    Args:
        name: of the recording, for errors.
        estimates: of the whole run, with what drove the models.
        measured: usable heights of the whole run.

    Raises:
        SloshBagError: the two sides cannot be laid over each other.
    """
    if not len(measured.stamps) or estimates.accelerations is None:
        raise SloshBagError(f"{name}: holds no usable message of free_surface")
    spans = motion_spans(estimates.stamps, estimates.accelerations)
    if not spans:
        raise SloshBagError(f"{name}: the container does not move; there is nothing to compare")
    first, last = np.searchsorted(estimates.stamps, (spans[0].start_ns, spans[-1].end_ns))
    motion = slice(int(first), int(last))
    t, model_t, raw = _seconds(measured.stamps), _seconds(estimates.stamps), measured.heights
    raised = _raised(estimates)
    try:
        still = find_still_level(t, raw)
        centre = onset_offset(t, raw, model_t, raised.mean(axis=1), still)
        clocks = [
            estimate_clock_offset(t, raw, model_t[motion], column[motion], centre=centre)
            for column in raised.T
        ]
    except SloshReportError as error:
        raise SloshBagError(f"{name}: {error}") from None
    start, end = float(model_t[motion.start]), float(model_t[motion.stop - 1])
    heights = [
        np.interp(t - clock.offset, model_t, column, left=np.nan, right=np.nan)
        for column, clock in zip(raised.T, clocks, strict=True)
    ]
    moving = (model_t >= start) & (model_t <= end)
    drift = estimate_clock_drift(
        t, raw - still.level, model_t[moving], raised[moving, -1], clocks[-1].offset
    )
    return Alignment(
        still,
        clocks,
        start,
        end,
        measured._replace(heights=raw - still.level),
        ModelHeights(
            estimates.stamps + round(clocks[-1].offset * 1e9),
            estimates.heights,
            np.full(len(model_t), np.nan),
            estimates.flags,
            None if np.array_equal(raised, estimates.heights) else raised,
        ),
        np.column_stack(heights),
        drift.text() if drift.seen else "",
    )


def _raised(estimates: ModelHeights) -> Array:
    """Returns modelled measurements [m] relative to their value at rest, one column per model.

    A delay is part of the clocks' offset, an offset of the heights part of the still level.
    """
    readings = estimates.as_read
    raised: Array = readings - (readings[0] - estimates.heights[0])
    return raised


def _seconds(stamps: NDArray[np.int64]) -> Array:
    return np.asarray(stamps * 1e-9, dtype=np.float64)
