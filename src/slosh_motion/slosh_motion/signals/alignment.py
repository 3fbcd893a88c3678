"""Estimates clock offset and still level of measured heights relative to a model.

The offset τ is defined by measured(t) ≈ level + model(t - τ). Least squares alone is not sound: a
record is far longer than its motion, and a model that is laid over the quiet part, or over the
decay after the motion, may fit better than one in its place. So the liquid's main rise gives a
narrow window, every offset in it must have the whole motion covered by measured samples, and least
squares decides in there. The rise is taken at half the height: the very first stir drowns in the
noise, and a camera that sees one side of the wall misses it altogether.

Models are compared fairly if each gets its own offset by its own least RMS, all in one window: one
common offset, found with one of the models, would favour that one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_motion.errors import SloshMotionError
from slosh_motion.tuning import TUNING

SEARCH = TUNING.search
DISTINCT = TUNING.distinct


@dataclass(frozen=True, slots=True)
class StillLevel:
    """Still level and measurement noise before the container moves.

    Attributes:
        level: median height [m].
        noise: standard deviation of the noise, from the median absolute deviation [m].
        start, end: the quiet part on the measured clock [s].
    """

    level: float
    noise: float
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """An offset between two clocks, with its uncertainty.

    Attributes:
        offset: measured clock minus model clock [s].
        stddev: standard deviation from the curvature of the least squares, with the samples
            counted as often as the residual's correlation leaves them independent [s].
        rms: root mean square of the residual at the offset [m].
        onset_offset: the centre of the search window [s].
        runner_up: rms of the next best separate minimum in the window, in units of `rms`; infinite
            where there is none.
        unambiguous: the minimum lies inside the window and no other comes near.
    """

    offset: float
    stddev: float
    rms: float
    onset_offset: float
    runner_up: float
    unambiguous: bool


def find_still_level(t: Array, height: Array) -> StillLevel:
    """Finds still level and noise in the quietest part before the highest wave.

    Args:
        t: (N,) time [s].
        height: (N,) measured heights [m]; NaN: no sample.

    Raises:
        SloshMotionError: the record does not hold a quiet part before its highest point.
    """
    t, height = finite_series(t, height)
    peak = int(np.nanargmax(despike(height)))
    best: StillLevel | None = None
    for first in range(0, peak, 5):
        last = int(np.searchsorted(t, t[first] + TUNING.quiet_window))
        if last > peak or t[last - 1] - t[first] < 0.9 * TUNING.quiet_window:
            continue
        part = height[first:last]
        level = float(np.median(part))
        # Not below 1 µm: a simulated record may be exactly still.
        noise = max(1.4826 * float(np.median(np.abs(part - level))), 1e-6)
        if best is None or noise < best.noise:
            best = StillLevel(level, noise, float(t[first]), float(t[last - 1]))
    if best is None:
        raise SloshMotionError(
            f"no still part of {TUNING.quiet_window} s before the highest height at "
            f"{t[peak]:.2f} s; record the container at rest before the motion"
        )
    return best


def despike(height: Array) -> Array:
    """Replaces single upward spikes of the heights by NaN.

    A spike is one sample that exceeds both its neighbours by over `outlier_share` of the range
    that 98 % of the samples lie in. Sloshing at 3 Hz seen at 60 Hz bends by 5 % of its amplitude
    from a sample to the next, so no crest is taken for a spike.

    Args:
        height: (N,) heights above any level [m].
    """
    height = np.asarray(height, dtype=np.float64)
    return np.where(find_spikes(height, spike_limit(height)), np.nan, height)


def spike_limit(height: Array) -> float:
    """Returns by how much a sample must exceed both neighbours [m] to count as a spike."""
    finite = height[np.isfinite(height)]
    if finite.size < 3:
        return math.inf
    low, high = (float(np.quantile(finite, part)) for part in (0.01, 0.99))
    return max(TUNING.outlier_share * (high - low), 1e-9)


def find_spikes(height: Array, limit: float) -> NDArray[np.bool_]:
    """Returns a mask of the samples that exceed both neighbours by more than a threshold [m]."""
    spikes = np.zeros(height.shape, dtype=bool)
    spikes[1:-1] = height[1:-1] - np.fmax(height[:-2], height[2:]) > limit
    return spikes


def find_onset(t: Array, height: Array, threshold: float) -> float:
    """Returns the time [s] from which |height| stays above a threshold.

    Args:
        t: (N,) time [s].
        height: (N,) heights above the still level [m].
        threshold: [m].

    Raises:
        SloshMotionError: the threshold is never exceeded.
    """
    t, height = finite_series(t, height)
    above = np.abs(height) > threshold
    needed, window = TUNING.sustained
    counts = np.convolve(above, np.ones(window), mode="valid")
    starts = np.flatnonzero(above[: len(counts)] & (counts >= needed))
    if len(starts) == 0:
        raise SloshMotionError(f"no motion: the height never stays above {threshold:.6f} m")
    return float(t[starts[0]])


def onset_offset(
    t: Array, height: Array, model_t: Array, model: Array, still: StillLevel
) -> float:
    """Returns how much later [s] measured heights start to rise than modelled heights.

    Each series' onset is taken at the same share of its own peak, so that a model with a wrong
    gain has its onset in the same place.

    Args:
        t: (N,) measured clock [s].
        height: (N,) measured heights [m], with any still level; NaN: no sample.
        model_t: (M,) model clock [s].
        model: (M,) model heights above the still level [m].

    Raises:
        SloshMotionError: one of the series shows no motion.
    """
    raised = despike(height) - still.level
    after = t >= still.start  # what was before the quiet part is not this motion
    noise = TUNING.onset_noises * still.noise
    # On the measured series' own spacing, so that "sustained" means the same time in both.
    grid = np.arange(model_t[0], model_t[-1], float(np.median(np.diff(t))))
    coarse = np.interp(grid, model_t, model)
    return _rise(t[after], raised[after], noise) - _rise(grid, coarse, 0.0)


def _rise(t: Array, height: Array, least: float) -> float:
    return find_onset(t, height, max(least, TUNING.onset_share * float(np.nanmax(np.abs(height)))))


def estimate_clock_offset(
    t: Array,
    height: Array,
    model_t: Array,
    model: Array,
    *,
    centre: float | None = None,
    search: float = SEARCH,
    still: StillLevel | None = None,
) -> ClockOffset:
    """Estimates the offset of the measurement's clock from the model's clock.

    Args:
        t: (N,) measured clock [s].
        height: (N,) measured heights [m], with any still level; NaN: no sample.
        model_t: (M,) model clock [s], spanning the motion to be compared.
        model: (M,) model heights above the still level [m].
        centre: centre of the search window [s]; None: from the onsets.
        search: half-width of the search window [s].
        still: the measured still level; None: from the quietest part.

    Raises:
        SloshMotionError: no quiet part, no motion, or no offset in the window at which the
            measured record covers the motion.
    """
    still = still or find_still_level(t, height)
    if centre is None:
        centre = onset_offset(t, height, model_t, model, still)
    kept_t, raised = finite_series(t, despike(height) - still.level)
    offsets = centre + np.arange(-search, search + TUNING.offset_step / 2.0, TUNING.offset_step)
    costs = np.array([_mean_square(kept_t, raised, model_t, model, tau) for tau in offsets])
    if not np.isfinite(costs).any():
        raise SloshMotionError(
            f"the measured record ({t[0]:.2f} … {t[-1]:.2f} s) does not cover the motion of "
            f"{model_t[-1] - model_t[0]:.2f} s at any offset near {centre:.2f} s"
        )
    best = int(np.nanargmin(costs))
    offset, curvature = _vertex(offsets, costs, best)
    inside = curvature > 0.0
    mean_square = float(costs[best])
    independent = _independent_samples(kept_t, raised, model_t, model, offset)
    runner_up = _runner_up(costs, best)
    return ClockOffset(
        offset=offset,
        stddev=float(np.sqrt(2.0 * mean_square / (independent * curvature)))
        if curvature > 0.0
        else float("inf"),
        rms=float(np.sqrt(mean_square)),
        onset_offset=float(centre),
        runner_up=runner_up,
        unambiguous=inside and runner_up >= DISTINCT,
    )


def finite_series(t: Array, height: Array) -> tuple[Array, Array]:
    """Returns the samples of a series that have a finite height.

    Raises:
        SloshMotionError: there are hardly any, or times and heights do not match.
    """
    t, height = np.asarray(t, dtype=np.float64), np.asarray(height, dtype=np.float64)
    if t.shape != height.shape or t.ndim != 1:
        raise SloshMotionError(f"time {t.shape} and heights {height.shape} do not match")
    kept = np.isfinite(height)
    if np.count_nonzero(kept) < TUNING.sustained[1]:
        raise SloshMotionError(f"only {np.count_nonzero(kept)} finite heights: no series")
    return t[kept], height[kept]


def _residual(t: Array, height: Array, model_t: Array, model: Array, offset: float) -> Array:
    covered = (t >= model_t[0] + offset) & (t <= model_t[-1] + offset)
    residual: Array = height[covered] - np.interp(t[covered] - offset, model_t, model)
    return residual


def _mean_square(t: Array, height: Array, model_t: Array, model: Array, offset: float) -> float:
    """Returns the mean squared height error [m²] at a clock offset; NaN if too few samples."""
    residual = _residual(t, height, model_t, model, offset)
    # Where both are known at the same moments, what the model lacks is missing on both sides.
    expected = min((model_t[-1] - model_t[0]) / float(np.median(np.diff(t))), len(model_t))
    if len(residual) < TUNING.coverage * expected:
        return float("nan")
    return float(np.mean(residual**2))


def _vertex(offsets: Array, costs: Array, best: int) -> tuple[float, float]:
    """Returns position [s] and curvature [m²/s²] of a minimum, by fitting a parabola.

    A wide bowl, because from one step to the next the cost is rough: samples enter and leave the
    span at its ends. Curvature 0: the minimum is at the window's edge.
    """
    width = round(TUNING.bowl / TUNING.offset_step)
    bowl = slice(best - width, best + width + 1)
    if best < width or best + width >= len(costs) or not np.isfinite(costs[bowl]).all():
        return float(offsets[best]), 0.0
    x = offsets[bowl] - offsets[best]
    second, first, _ = np.polyfit(x, costs[bowl], 2)
    if second <= 0.0:
        return float(offsets[best]), 0.0
    shift = float(np.clip(-first / (2.0 * second), -TUNING.bowl, TUNING.bowl))
    return float(offsets[best]) + shift, 2.0 * float(second)


def _independent_samples(
    t: Array, height: Array, model_t: Array, model: Array, offset: float
) -> float:
    """Returns the effective number of independent samples, given their autocorrelation."""
    residual = _residual(t, height, model_t, model, offset)
    power = float(np.mean(residual**2))
    if power <= 0.0 or len(residual) < 3:
        return float(max(len(residual), 1))
    correlation = float(np.mean(residual[1:] * residual[:-1])) / power
    correlation = min(max(correlation, 0.0), 0.99)
    return max(len(residual) * (1.0 - correlation) / (1.0 + correlation), 1.0)


def _runner_up(costs: Array, best: int) -> float:
    """Returns the rms error at the second-best separate minimum divided by that at the best."""
    filled = np.where(np.isfinite(costs), costs, np.inf)
    others = [
        float(filled[k])
        for k in range(1, len(filled) - 1)
        if abs(k - best) * TUNING.offset_step >= TUNING.separation
        and filled[k] < filled[k - 1]
        and filled[k] <= filled[k + 1]
    ]
    if not others or filled[best] <= 0.0:
        return float("inf")
    return float(np.sqrt(min(others) / filled[best]))
