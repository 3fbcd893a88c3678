"""Estimates the noise of a measured acceleration while the container is at rest.

Only what lies near the liquid's own frequencies moves it, so the noise is told by its power
spectral density there. Where the rest is long enough that is seen; else the noise is white.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_discovery.discover.differences import (
    ORDERS,
    normalised_differences,
    robust_scale,
)
from slosh_discovery.discover.input_series import angular_velocity
from slosh_discovery.discover.tuning import TUNING
from slosh_model.simulate import Inputs
from slosh_motion.signals.motion_spans import MOVING, TURNING

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class InputNoise:
    """White noise of an acceleration in the liquid's frequency band.

    Attributes:
        density: power spectral density of each horizontal axis, two-sided [m²/s³].
        stddev: of one sample [m/s²].
        rate: samples per second [Hz].
        quantum: step to which the values are rounded [m/s²]; 0: none is seen.
        constant: horizontal part that is seen at rest [m/s²]: gravity's share where the container
            leans, which the liquid feels, or a bias, which it does not.
    """

    density: float
    stddev: float
    rate: float
    quantum: float = 0.0
    constant: tuple[float, float] = (0.0, 0.0)


def estimate_input_noise(inputs: Inputs) -> InputNoise | None:
    """Estimates the noise of the horizontal acceleration, or returns None if it has none."""
    if len(inputs.t) < 2 * TUNING.least_samples:
        return None
    spacing = float(np.median(np.diff(inputs.t)))
    columns = inputs.acceleration[:, :2].T
    stddev = _white(inputs, columns)
    quantum = max(_quantum(column) for column in columns)
    stddev = max(stddev, quantum / math.sqrt(12.0))
    constant = _constant(inputs)
    if stddev < TUNING.least_input_noise:
        known = math.hypot(*constant) < TUNING.least_input_noise
        return None if known else InputNoise(0.0, 0.0, 1.0 / spacing, quantum, constant)
    density = stddev**2 * spacing
    density *= _colour(inputs, density)
    density = max(density, _rounding(inputs, columns, quantum))
    return InputNoise(density, stddev, 1.0 / spacing, quantum, constant)


def _constant(inputs: Inputs) -> tuple[float, float]:
    """Returns the mean acceleration along both horizontal axes at rest [m/s²].

    The mean without both ends: the median of rounded values is one of these.
    """
    still = resting(inputs, TUNING.rest_margin)
    still = still if still.any() else resting(inputs)
    count = int(np.count_nonzero(still))
    if count < 2 * TUNING.least_samples:
        return 0.0, 0.0
    inner = np.sort(inputs.acceleration[still, :2], axis=0)[count // 5 : count - count // 5]
    x, y = np.mean(inner, axis=0).tolist()
    return x, y


def resting(inputs: Inputs, margin: float = 0.0) -> Mask:
    """Returns a mask (N,) of the samples at rest, at least `margin` [s] away from motions.

    As `motion_spans` says, but that a bias is no motion, nor the noise of a few samples' mean.
    """
    # Without its mean at rest, which a bias leaves.
    moved = inputs.acceleration - np.median(inputs.acceleration, axis=0)
    bins = np.floor((inputs.t - inputs.t[0]) / TUNING.rest_bin).astype(np.int64)
    count = np.maximum(np.bincount(bins), 1)
    means = np.column_stack([np.bincount(bins, column) / count for column in moved.T])
    noise = math.sqrt(3.0) * _rough(inputs.t, moved.T) / np.sqrt(count)
    moving = np.linalg.norm(means, axis=1) > np.maximum(MOVING, TUNING.moves * noise)
    turning = np.linalg.norm(angular_velocity(inputs)[:, :2], axis=1) > TURNING
    moving |= np.bincount(bins, turning) > 0
    # What passes through zero does not rest.
    still = _longer(
        ~moving & (np.bincount(bins) > 0),
        TUNING.rest_bins + 2 * math.ceil(margin / TUNING.rest_bin),
    )
    for _ in range(math.ceil(margin / TUNING.rest_bin)):
        still[1:-1] &= still[2:] & still[:-2]
    return np.asarray(still[bins])


def _longer(marked: Mask, least: int) -> Mask:
    """Returns the mask without runs that are shorter than a minimum number of samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    kept = np.zeros_like(marked)
    for start, end in edges.reshape(-1, 2).tolist():
        kept[start:end] = end - start >= least
    return kept


def _rough(t: Array, columns: Array) -> float:
    """Returns the standard deviation of a sample's noise [m/s²], by differences of several orders.

    Kinks of a motion are rougher than its noise in some of the orders.
    """
    scales = []
    for order in ORDERS:
        joined = np.concatenate([normalised_differences(t, column, order) for column in columns])
        scales += [robust_scale(joined)] if len(joined) >= TUNING.least_samples else []
    return min(scales, default=0.0)


def _white(inputs: Inputs, columns: Array) -> float:
    """Returns the standard deviation of a sample's noise [m/s²], by neighbouring samples."""
    still = resting(inputs)
    if np.count_nonzero(still) >= 2 * TUNING.least_samples:
        rest = np.where(still, columns, np.nan)
        found = [normalised_differences(inputs.t, column, TUNING.rest_order) for column in rest]
        joined = np.concatenate(found)
        if len(joined) >= TUNING.least_samples:
            # A kink at a motion's start is no noise; of rounded values most do not change.
            rounded = any(_quantum(column) > 0.0 for column in columns)
            return float(np.sqrt(np.mean(joined**2))) if rounded else robust_scale(joined)
    return _rough(inputs.t, columns)  # it never rests


def _quantum(values: Array) -> float:
    """Returns the rounding step of the values; 0 if they are not rounded or nearly constant."""
    levels = np.unique(np.round(values, 9))
    if not 3 <= len(levels) <= TUNING.rounded_levels * len(values):
        return 0.0
    step = float(np.diff(levels).min())
    if not np.allclose(levels / step, np.round(levels / step), atol=0.02):
        return 0.0
    # The straight ramps of a planned motion have even steps, too, but all of one size in a row.
    steps = np.round(np.diff(values) / step)
    kinks = np.count_nonzero(np.diff(steps))
    return (
        step if kinks > max(TUNING.least_kinks, TUNING.kinked * np.count_nonzero(steps)) else 0.0
    )


def _rounding(inputs: Inputs, columns: Array, quantum: float) -> float:
    """Returns the power spectral density [m²/s³] of the rounding error during motion.

    A ramp crosses each level, and its error is zero in the mean. Where the values turn back after
    a while at one level, all of that time may be off by up to half a step.
    """
    moving = ~resting(inputs)
    if quantum == 0.0 or not moving.any():
        return 0.0
    span = float(inputs.t[-1] - inputs.t[np.argmax(moving)])
    squares = 0.0
    for column in columns:
        steps = np.diff(column)
        at = np.flatnonzero(steps) + 1
        turned = np.signbit(steps[at[1:] - 1]) != np.signbit(steps[at[:-1] - 1])
        lasted = np.diff(inputs.t[at])[turned & moving[(at[1:] + at[:-1]) // 2]]
        squares += float(np.sum(lasted**2))
    return quantum**2 / 12.0 * squares / (span * len(columns))


def _colour(inputs: Inputs, density: float) -> float:
    """Returns the noise power near the liquid's natural frequencies relative to white noise."""
    still = resting(inputs, TUNING.rest_margin)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    power, count = 0.0, 0
    for start, end in edges.reshape(-1, 2).tolist():
        t = inputs.t[start:end]
        if len(t) < TUNING.least_samples or t[-1] - t[0] < TUNING.least_rest:
            continue
        grid = np.linspace(t[0], t[-1], len(t))
        for column in inputs.acceleration[start:end, :2].T:
            even = np.interp(grid, t, column)
            even = even - np.polyval(np.polyfit(grid - grid[0], even, 1), grid - grid[0])
            lines = np.abs(np.fft.rfft(even)[1:]) ** 2 * (grid[1] - grid[0]) / len(grid)
            below = np.fft.rfftfreq(len(grid), grid[1] - grid[0])[1:] <= TUNING.liquid_band
            # The straight line has taken most of the first.
            power, count = power + float(lines[below][1:].sum()), count + int(below.sum()) - 1
    if count < TUNING.least_lines or power <= 0.0:
        return 1.0
    ratio = power / count / density
    return ratio if abs(math.log(ratio)) > TUNING.consistent / math.sqrt(count) else 1.0
