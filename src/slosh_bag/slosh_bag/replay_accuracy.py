"""Judges replayed estimates against measurements.

ε compares two maxima, and a single wrong sample can be the measured one. So samples that stand
out of both neighbours by more than 15 % of the range of the heights are left out of ε, as no
crest of sloshing that is sampled at 60 Hz does that; ε with them is given beside it. σ and RMS
leave them out too; a handful of samples among hundreds does not move them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_bag.replay_result import ModelAccuracy, ReplayResult
from slosh_discovery.alignment import (
    ClockOffset,
    despike,
    estimate_clock_offset,
    find_still_level,
    onset_offset,
)
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.metrics import mean_absolute_error, peak_error, rms_error
from slosh_estimator.monitor import (
    SATURATED,
    UNSETTLED,
    UNUSABLE,
    EstimatePoint,
    MeasuredPoint,
    Monitor,
    MonitorSettings,
)

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MOTION = 0.05
"""The container moves where its acceleration exceeds this [m/s²]."""
MAX_GAP_NS = 50_000_000
"""Widest pair of estimates between which is interpolated."""


class Estimates(NamedTuple):
    """Heights of every model at the input's stamps.

    Attributes:
        names: (K) of the models: 2D-L, 3D-L, 2D-NL, 3D-NL.
        stamps: (M,) [ns].
        heights: (M, K) [m].
        flags: (M,) bits of EstimateFlag.
        acceleration: (M,) its size [m/s²].
    """

    names: tuple[str, ...]
    stamps: Integers
    heights: Array
    flags: Integers
    acceleration: Array


class Measurements(NamedTuple):
    """Stamps (N,) [ns], heights (N,) [m], flags (N,) of FreeSurface.msg."""

    stamps: Integers
    heights: Array
    flags: Integers


def compare(name: str, source: str, estimates: Estimates, measured: Measurements) -> ReplayResult:
    """Result where both sides have one clock; every image between two estimates counts.

    As in the monitor, a saturated height is a lower bound and counts only above the estimate, and
    estimates from an unknown state do not count.
    """
    raw = np.where(measured.flags & UNUSABLE, np.nan, measured.heights)
    clean = despike(raw)
    usable = _settled(estimates, measured.stamps)
    saturated = (measured.flags & SATURATED) != 0
    heights, rows = {}, []
    for column, model in enumerate(estimates.names):
        at_images = _interpolated(estimates, column, measured.stamps)
        heights[model] = at_images
        counted = np.where(usable & ~(saturated & ~(raw > at_images)), at_images, np.nan)
        rows.append(_accuracy(name, model, raw, clean, counted, None))
    counters = {"spikes": int(np.count_nonzero(np.isfinite(raw) & np.isnan(clean)))}
    t = _seconds(measured.stamps)
    return ReplayResult(name, source, t, raw, heights, tuple(rows), counters=counters)


def compare_unrelated(
    name: str, source: str, estimates: Estimates, measured: Measurements
) -> ReplayResult:
    """Result where the measured clock and the still level are unknown; the motion counts.

    Raises:
        SloshBagError: the two sides cannot be laid over each other.
    """
    t = _seconds(measured.stamps)
    raw = np.where(measured.flags & UNUSABLE, np.nan, measured.heights)
    model_t = _seconds(estimates.stamps)
    moving = np.flatnonzero(estimates.acceleration > MOTION)
    if len(moving) == 0:
        raise SloshBagError(f"{name}: the container does not move; there is nothing to compare")
    motion = slice(int(moving[0]), int(moving[-1]) + 1)
    try:
        still = find_still_level(t, raw)
        centre = onset_offset(t, raw, model_t, estimates.heights.mean(axis=1), still)
        clocks = [
            estimate_clock_offset(t, raw, model_t[motion], column[motion], centre=centre)
            for column in estimates.heights.T
        ]
    except SloshDiscoveryError as error:
        raise SloshBagError(f"{name}: {error}") from None
    raised = raw - still.level
    clean = despike(raised)
    heights, rows = {}, []
    for model, column, clock in zip(estimates.names, estimates.heights.T, clocks, strict=True):
        shifted = t - clock.offset
        at_images = np.interp(shifted, model_t, column, left=np.nan, right=np.nan)
        heights[model] = at_images
        inside = (shifted >= model_t[motion.start]) & (shifted <= model_t[motion.stop - 1])
        counted = np.where(inside, at_images, np.nan)
        rows.append(_accuracy(name, model, raised, clean, counted, clock))
    counters = {"spikes": int(np.count_nonzero(np.isfinite(raised) & np.isnan(clean)))}
    return ReplayResult(
        name, source, t, raised, heights, tuple(rows), counters=counters, still=still
    )


def monitor_events(
    result: ReplayResult,
    estimates: Estimates,
    measured: Measurements,
    settings: MonitorSettings,
) -> ReplayResult:
    """The result with the limit events that the monitor's core gives for the two streams.

    The 3D models' estimates are monitored. With unrelated clocks the estimates are shifted by the
    3D-NL model's offset, and the measured heights count from the still level.
    """
    monitor = Monitor(settings)
    clock = result.accuracy[-1].clock
    shift_ns = 0 if clock is None else round(clock.offset * 1e9)
    for point in _merged(result, estimates, measured, shift_ns):
        if isinstance(point, MeasuredPoint):
            monitor.add_measurement(point, point.stamp_ns)
        else:
            monitor.add_estimate(point, point.stamp_ns)
    events = monitor.take_events()
    counters = {**result.counters, "unmatched_images": monitor.unmatched}
    return replace(result, events=tuple(events), counters=counters)


def _merged(
    result: ReplayResult, estimates: Estimates, measured: Measurements, shift_ns: int
) -> Iterator[EstimatePoint | MeasuredPoint]:
    """Both streams in stamp order; an estimate comes before a measurement of the same moment."""
    stamps = np.concatenate((estimates.stamps + shift_ns, measured.stamps))
    first = len(estimates.stamps)
    for index in np.argsort(stamps, kind="stable").tolist():
        stamp = int(stamps[index])
        if index < first:
            row = estimates.heights[index]
            flags = int(estimates.flags[index])
            yield EstimatePoint(stamp, float(row[1]), float(row[3]), flags)
        else:
            height = float(result.measured[index - first])
            yield MeasuredPoint(stamp, height, flags=int(measured.flags[index - first]))


def _accuracy(
    run: str, model: str, raw: Array, clean: Array, counted: Array, clock: ClockOffset | None
) -> ModelAccuracy:
    try:
        return ModelAccuracy(
            name=model,
            sigma=mean_absolute_error(clean, counted),
            epsilon=peak_error(clean, counted),
            epsilon_raw=peak_error(raw, counted),
            rms=rms_error(clean, counted),
            count=int(np.count_nonzero(np.isfinite(clean) & np.isfinite(counted))),
            clock=clock,
        )
    except SloshDiscoveryError:
        raise SloshBagError(
            f"{run}: no image has an estimate at its stamp; do both sides use one clock?"
        ) from None


def _seconds(stamps: Integers) -> Array:
    return np.asarray(stamps * 1e-9, dtype=np.float64)


def _neighbours(estimates: Estimates, stamps: Integers) -> tuple[Integers, Integers]:
    """Indices of the estimates at or before and at or after each stamp, clipped to the series."""
    after = np.searchsorted(estimates.stamps, stamps)
    last = len(estimates.stamps) - 1
    exact = (after <= last) & (estimates.stamps[np.minimum(after, last)] == stamps)
    before = np.where(exact, after, after - 1)
    return np.clip(before, 0, last), np.clip(after, 0, last)


def _interpolated(estimates: Estimates, column: int, stamps: Integers) -> Array:
    """A model's heights at stamps; NaN outside the series and in gaps of it."""
    origin = estimates.stamps[0]
    values = np.interp(
        (stamps - origin) * 1e-9,
        (estimates.stamps - origin) * 1e-9,
        estimates.heights[:, column],
    )
    before, after = _neighbours(estimates, stamps)
    outside = (stamps < origin) | (stamps > estimates.stamps[-1])
    gap = estimates.stamps[after] - estimates.stamps[before] > MAX_GAP_NS
    return np.where(outside | gap, np.nan, values)


def _settled(estimates: Estimates, stamps: Integers) -> NDArray[np.bool_]:
    before, after = _neighbours(estimates, stamps)
    settled: NDArray[np.bool_] = (
        (estimates.flags[before] | estimates.flags[after]) & UNSETTLED
    ) == 0
    return settled
