"""How noisy an acceleration is: what it does while the container rests.

Only what lies near the liquid's own frequencies moves it, so the noise is told by its power
spectral density there. Where the rest is long enough that is seen; else the noise is white.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.differences import (
    LEAST_SAMPLES,
    ORDERS,
    normalised_differences,
    robust_scale,
)
from slosh_discovery.discover.input_series import angular_velocity
from slosh_files.nanoseconds import SECOND
from slosh_model.simulate import Inputs
from slosh_report.motion_spans import motion_spans

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_NOISE = 1e-6
"""Less is rounding [m/s²]."""
ORDER = 3
"""Of the differences while the container rests: what has begun slowly is no noise."""
MARGIN = 0.3
"""Nearer than this to a motion it may have begun [s]."""
LEAST_REST = 0.5
"""A shorter rest tells of no spectrum [s]."""
BAND = 8.0
"""What moves a liquid in a cup lies below this frequency [Hz]."""
LEAST_LINES = 8
"""Fewer lines of a spectrum tell of no colour,"""
CLEARLY = 3.0
"""nor does a difference of less than so many of its standard deviations."""
LEVELS = 0.3
"""An input whose values are fewer than this share of its samples is rounded."""


@dataclass(frozen=True, slots=True)
class InputNoise:
    """White noise of an acceleration, as far as it moves the liquid.

    Attributes:
        density: power spectral density of each horizontal axis, two-sided [m²/s³].
        stddev: of one sample [m/s²].
        rate: samples per second [Hz].
        quantum: step to which the values are rounded [m/s²]; 0: none is seen.
    """

    density: float
    stddev: float
    rate: float
    quantum: float = 0.0


def estimate_input_noise(inputs: Inputs) -> InputNoise | None:
    """The noise of an acceleration's horizontal part; None: it has none."""
    if len(inputs.t) < 2 * LEAST_SAMPLES:
        return None
    spacing = float(np.median(np.diff(inputs.t)))
    columns = inputs.acceleration[:, :2].T
    stddev = _white(inputs, columns)
    quantum = max(_quantum(column) for column in columns)
    stddev = max(stddev, quantum / math.sqrt(12.0))
    if stddev < LEAST_NOISE:
        return None
    density = stddev**2 * spacing
    return InputNoise(density * _colour(inputs, density), stddev, 1.0 / spacing, quantum)


def resting(inputs: Inputs, margin: float = 0.0) -> Mask:
    """(N,) where the container does not move, nor within a margin [s] of a motion."""
    stamps = np.rint(inputs.t * SECOND).astype(np.int64)
    still = np.ones(len(stamps), dtype=np.bool_)
    reach = round(margin * SECOND)
    # Without its mean at rest, which a bias leaves.
    bias = np.median(inputs.acceleration, axis=0)
    for span in motion_spans(stamps, inputs.acceleration - bias, angular_velocity(inputs)):
        still &= (stamps < span.start_ns - reach) | (stamps > span.end_ns + reach)
    return still


def _white(inputs: Inputs, columns: Array) -> float:
    """Standard deviation of a sample [m/s²], from neighbours."""
    still = resting(inputs)
    if np.count_nonzero(still) >= 2 * LEAST_SAMPLES:
        rest = np.where(still, columns, np.nan)
        found = [normalised_differences(inputs.t, column, ORDER) for column in rest]
        joined = np.concatenate(found)
        if len(joined) >= LEAST_SAMPLES:
            return float(np.sqrt(np.mean(joined**2)))
    # It never rests. Kinks of a motion are rougher than noise in some of the orders.
    scales = []
    for order in ORDERS:
        joined = np.concatenate(
            [normalised_differences(inputs.t, column, order) for column in columns]
        )
        scales += [robust_scale(joined)] if len(joined) >= LEAST_SAMPLES else []
    return min(scales, default=0.0)


def _quantum(values: Array) -> float:
    """Step to which values are rounded; 0: they are not, or hardly change."""
    levels = np.unique(np.round(values, 9))
    if not 3 <= len(levels) <= LEVELS * len(values):
        return 0.0
    step = float(np.diff(levels).min())
    return step if np.allclose(levels / step, np.round(levels / step), atol=0.02) else 0.0


def _colour(inputs: Inputs, density: float) -> float:
    """Power at the liquid's frequencies relative to white noise of that density."""
    still = resting(inputs, MARGIN)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
    power, count = 0.0, 0
    for start, end in edges.reshape(-1, 2).tolist():
        t = inputs.t[start:end]
        if len(t) < LEAST_SAMPLES or t[-1] - t[0] < LEAST_REST:
            continue
        grid = np.linspace(t[0], t[-1], len(t))
        for column in inputs.acceleration[start:end, :2].T:
            even = np.interp(grid, t, column)
            even = even - np.polyval(np.polyfit(grid - grid[0], even, 1), grid - grid[0])
            lines = np.abs(np.fft.rfft(even)[1:]) ** 2 * (grid[1] - grid[0]) / len(grid)
            below = np.fft.rfftfreq(len(grid), grid[1] - grid[0])[1:] <= BAND
            # The straight line has taken most of the first.
            power, count = power + float(lines[below][1:].sum()), count + int(below.sum()) - 1
    if count < LEAST_LINES or power <= 0.0:
        return 1.0
    ratio = power / count / density
    return ratio if abs(math.log(ratio)) > CLEARLY / math.sqrt(count) else 1.0
