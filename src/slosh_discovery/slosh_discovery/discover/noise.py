"""Estimates the noise of measured heights, and the part of a residual that is not noise.

Two questions with two ways to answer them:

- `estimate_noise` looks at the heights alone. Differences of a high order leave nothing of a
  liquid that sways at some Hz, but all of the noise; still parts and repeats add to it.
- `removable` and `is_white` look at a residual. Noise of one sample knows nothing of the next;
  what a better model could remove goes on from sample to sample. So the residual's autocovariance,
  extrapolated from small lags to lag 0, is that part without the noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from slosh_base.types import Array
from slosh_discovery.discover.differences import (
    ORDERS,
    normalised_differences,
    robust_scale,
)
from slosh_discovery.discover.input_series import still_until
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.tuning import TUNING
from slosh_model.simulate import Inputs

OVERSAMPLING = 2
"""Zero padding of the spectrum: a line between two frequencies loses 1 dB, not 4."""


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviation of measured heights, with its source and uncertainty.

    Attributes:
        stddev: of one sample [m], positive.
        uncertainty: standard deviation of `stddev` [m].
        source: what it was taken from: "differences", "still part", "repeats", or several.
    """

    stddev: float
    uncertainty: float
    source: str


@dataclass(frozen=True, slots=True)
class Removable:
    """The part of a residual that is not white noise.

    Attributes:
        rms: its root mean square [m]; 0 where the estimate of its square is negative.
        mean_square: the estimate of its square, which may be negative [m²].
        mean_square_stddev: standard deviation of `mean_square` [m²].
        noise: standard deviation of the white rest [m].
        total: root mean square of the residual [m].
    """

    rms: float
    mean_square: float
    mean_square_stddev: float
    noise: float
    total: float

    @property
    def stddev(self) -> float:
        """Standard deviation of `rms` [m]; for an `rms` near zero, its largest possible value."""
        if self.mean_square > self.mean_square_stddev:
            return 0.5 * self.mean_square_stddev / self.rms
        return math.sqrt(self.mean_square_stddev)

    @property
    def share(self) -> float:
        """Share of the residual's mean square that a better model could remove, in [0, 1]."""
        return min(self.rms**2 / self.total**2, 1.0) if self.total > 0.0 else 0.0


def estimate_noise(motion: MeasuredMotion, others: Sequence[MeasuredMotion] = ()) -> Noise:
    """Estimates the measurement noise of a motion's heights.

    From differences of a high order, the still part before the motion, and repeats, weighted by
    their own uncertainty. Where they contradict one another, the differences hold: they are taken
    while the liquid moves, and that is when the noise matters.

    Args:
        motion: the motion.
        others: further motions; those with the same inputs are repeats.
    """
    differences = difference_noise(motion.t, motion.heights, magnitude=motion.msh is not None)
    estimates = [differences, still_noise(motion)]
    estimates += [repeat_noise(motion, other) for other in others if other is not motion]
    found = [estimate for estimate in estimates if estimate is not None]
    if not found:
        return Noise(TUNING.least_noise, math.inf, "none")
    leading = found[0]
    consistent = [
        other
        for other in found
        if abs(other.stddev - leading.stddev)
        <= TUNING.consistent * math.hypot(other.uncertainty, leading.uncertainty)
    ]
    return _combined(consistent)


def _combined(estimates: Sequence[Noise]) -> Noise:
    """Combines several noise estimates, weighted by their relative uncertainty."""
    sizes = np.array([estimate.stddev for estimate in estimates])
    relative = np.array([estimate.uncertainty for estimate in estimates]) / sizes
    weights = 1.0 / relative**2
    if not weights.any():
        weights = np.ones_like(weights)
    stddev = float(np.sum(weights * sizes) / np.sum(weights))
    sources = dict.fromkeys(part for each in estimates for part in each.source.split(", "))
    return Noise(stddev, stddev / math.sqrt(float(np.sum(weights))), ", ".join(sources))


def difference_noise(t: Array, heights: Array, *, magnitude: bool = False) -> Noise | None:
    """Estimates the noise from high-order divided differences, which remove smooth motion.

    MSH is the length of a vector. Where the peak jumps to the other side it has a kink, which no
    difference removes; its square is smooth. So where the height stands clear of the noise, its
    square is used, and that counts if it leaves less: beside the noise, what is left only adds.

    Args:
        t: (M,) time [s], not necessarily even.
        heights: (M,) or (M, K) [m]; NaN: no sample.
        magnitude: whether the heights are lengths (MSH).

    Returns:
        the noise; None: too few samples without gaps.
    """
    columns = np.atleast_2d(heights.T)
    found = (_difference_noise(t, columns, order, magnitude=magnitude) for order in ORDERS)
    return next((noise for noise in found if noise is not None), None)


def _difference_noise(t: Array, columns: Array, order: int, *, magnitude: bool) -> Noise | None:
    plain = _scale_of([normalised_differences(t, column, order) for column in columns], order)
    if plain is None or not magnitude:
        return plain
    best = plain
    for _ in range(2):
        differences = [
            normalised_differences(t, column, order, squared=best.stddev) for column in columns
        ]
        squared = _scale_of(differences, order)
        if squared is None or plain.stddev <= squared.stddev:
            return plain
        best = squared
    return best


def _scale_of(differences: Sequence[Array], order: int) -> Noise | None:
    joined = np.concatenate(list(differences))
    if len(joined) < TUNING.least_samples:
        return None
    scale = robust_scale(joined)
    # Overlapping differences: Σρ² over their lags, (4p)! (p!)⁴ / ((2p)!)⁴ for even sampling.
    overlap = special.comb(4 * order, 2 * order) / special.comb(2 * order, order) ** 2
    longest = max(len(part) for part in differences)
    # Columns of one picture may share their noise: they count as their square root.
    independent = longest * math.sqrt(len(joined) / longest) / overlap
    return Noise(
        scale, scale / math.sqrt(2.0 * TUNING.robust_efficiency * independent), "differences"
    )


def still_noise(motion: MeasuredMotion) -> Noise | None:
    """Estimates the heights' noise before the container moves; None with too few samples.

    None: the part is too short, the clocks differ, or the heights there do not vary at all (a
    detection that locks on a still surface tells nothing of one that moves).
    """
    if not motion.same_clock:
        return None
    still = motion.t < still_until(motion.inputs) - TUNING.settle
    part = motion.heights[still]
    # An azimuth at which nothing was seen has no level.
    part = part[:, np.isfinite(part).any(axis=0)]
    if len(part) < TUNING.least_samples or part.shape[1] == 0:
        return None
    deviations = (part - np.nanmedian(part, axis=0))[np.isfinite(part)]
    if len(deviations) < TUNING.least_samples or not np.median(np.abs(deviations)) > 0.0:
        return None
    count = len(deviations) / math.sqrt(part.shape[1])
    scale = robust_scale(deviations) * math.sqrt(count / (count - 1.0))
    return Noise(scale, scale / math.sqrt(2.0 * 0.9 * count), "still part")


def repeat_noise(motion: MeasuredMotion, other: MeasuredMotion) -> Noise | None:
    """Estimates the noise from a repetition of a motion, or returns None if the motions differ."""
    same = (
        motion.same_clock
        and other.same_clock
        and motion.heights.shape == other.heights.shape
        and np.allclose(motion.t, other.t, rtol=0.0, atol=1e-4)
        and _same_inputs(motion.inputs, other.inputs)
    )
    if not same:
        return None
    difference = motion.heights - other.heights
    deviations = difference[np.isfinite(difference)] / math.sqrt(2.0)
    if len(deviations) < TUNING.least_samples or not np.median(np.abs(deviations)) > 0.0:
        return None
    scale = robust_scale(deviations - np.median(deviations))
    count = len(deviations) / math.sqrt(difference.shape[1])
    return Noise(scale, scale / math.sqrt(2.0 * 0.9 * count), "repeats")


def _same_inputs(first: Inputs, second: Inputs) -> bool:
    for name in ("t", "acceleration", "attitude", "angular_velocity"):
        one, two = getattr(first, name), getattr(second, name)
        if (one is None) != (two is None):
            return False
        if one is not None and (one.shape != two.shape or not np.allclose(one, two, atol=1e-9)):
            return False
    return True


def removable(t: Array, residual: Array, noise: Noise | None = None) -> Removable:
    """Estimates the part of a residual that a better model could remove.

    With γₖ the autocovariance at lag k of the even grid, a parabola through the lags 1 and 2 gives
    (4γ₁ - γ₂)/3 at lag 0, without the white noise that only γ₀ contains. For a sine of 3 Hz at
    60 Hz that is 0.2 % low, for 8 Hz 7 %.

    Args:
        t: (M,) time [s].
        residual: (M,) or (M, K) [m]; NaN: no sample.
        noise: the measurement noise where it is known: sharpens the estimate.
    """
    grid = even_grid(t, residual)
    present = np.isfinite(grid)
    count = int(np.count_nonzero(present))
    if count < TUNING.least_samples:
        return Removable(0.0, 0.0, math.inf, math.nan, math.nan)
    filled = np.where(present, grid, 0.0)
    total = float(np.sum(filled**2)) / count
    first, second = (_autocovariance(filled, present, lag) for lag in (1, 2))
    square = (4.0 * first - second) / 3.0
    white = min(max(total - square, 0.0), total)
    independent = count / grid.shape[1] * _independent_columns(filled, present)
    common = 4.0 * white * max(square, 0.0)
    variance = (17.0 / 9.0 * white**2 + common) / independent
    if noise is not None and math.isfinite(noise.uncertainty):
        direct = total - noise.stddev**2
        direct_variance = (2.0 * noise.stddev**4 + common) / independent
        direct_variance += (2.0 * noise.stddev * noise.uncertainty) ** 2
        weight = variance / max(variance + direct_variance, 1e-300)
        square = weight * direct + (1.0 - weight) * square
        variance = variance * direct_variance / max(variance + direct_variance, 1e-300)
    return Removable(
        rms=math.sqrt(min(max(square, 0.0), total)),
        mean_square=square,
        mean_square_stddev=math.sqrt(variance),
        noise=math.sqrt(max(total - max(square, 0.0), 0.0)),
        total=math.sqrt(total),
    )


def is_white(t: Array, residual: Array) -> bool:
    """Returns whether a residual is consistent with white noise; see `whiteness`."""
    return whiteness(t, residual) > TUNING.significance


def whiteness(t: Array, residual: Array) -> float:
    """Returns the p-value of the hypothesis that a residual is white noise.

    The highest line of the spectrum up to SIGNAL_BAND finds one frequency, the autocovariance at
    small lags what is spread over many; the less likely of the two counts, corrected for having
    looked twice and at many frequencies.

    Args:
        t: (M,) time [s].
        residual: (M,) or (M, K) [m]; NaN: no sample.

    Returns:
        in [0, 1]; near 0: something is left that a better model could remove.
    """
    grid = even_grid(t, residual)
    present = np.isfinite(grid)
    if np.count_nonzero(present) < TUNING.least_samples:
        return 1.0
    filled = np.where(present, grid, 0.0)
    by_line = _line_probability(filled, present, float(np.median(np.diff(t))))
    part = removable(t, residual)
    score = part.mean_square / part.mean_square_stddev if part.mean_square_stddev > 0.0 else 0.0
    by_lags = float(special.ndtr(-score))
    return min(by_line / TUNING.spectrum_share, by_lags / (1.0 - TUNING.spectrum_share), 1.0)


def _line_probability(filled: Array, present: NDArray[np.bool_], spacing: float) -> float:
    """Returns the p-value of a residual's highest spectral line below SIGNAL_BAND."""
    rows = len(filled)
    counts = np.count_nonzero(present, axis=0)
    used = counts > 0
    power = np.sum(filled[:, used] ** 2, axis=0) / counts[used]
    if not power.all():
        return 1.0
    spectrum = np.abs(np.fft.rfft(filled[:, used], n=OVERSAMPLING * rows, axis=0)) ** 2
    lines = np.mean(spectrum / (power * counts[used]), axis=1)
    frequencies = np.fft.rfftfreq(OVERSAMPLING * rows, spacing)
    band = (frequencies >= 1.0 / (rows * spacing)) & (frequencies <= TUNING.signal_band)
    columns = _independent_columns(filled, present)
    # A line's power is a gamma variable: an exponential for each independent column.
    tail = float(special.gammaincc(columns, columns * float(lines[band].max(initial=0.0))))
    constant = float(special.gammaincc(0.5 * columns, 0.5 * columns * float(lines[0])))
    chances = 1.0 + TUNING.independent_lines * max(np.count_nonzero(band) / OVERSAMPLING, 1.0)
    least = min(tail, constant, 1.0 - 1e-12)
    return -math.expm1(chances * math.log1p(-least))


def even_grid(t: Array, values: Array) -> Array:
    """Resamples values to a uniform grid, column by column; NaN where nothing was measured."""
    columns = values if values.ndim == 2 else values[:, np.newaxis]
    spacing = float(np.median(np.diff(t)))
    place = np.round((t - t[0]) / spacing).astype(int)
    grid = np.full((int(place[-1]) + 1, columns.shape[1]), np.nan)
    grid[place] = columns
    return grid


def _autocovariance(filled: Array, present: NDArray[np.bool_], lag: int) -> float:
    pairs = int(np.count_nonzero(present[lag:] & present[:-lag]))
    return float(np.sum(filled[lag:] * filled[:-lag])) / pairs if pairs else 0.0


def _independent_columns(filled: Array, present: NDArray[np.bool_]) -> float:
    """Returns the effective number of independent columns, (tr C)² / ‖C‖² with covariance C."""
    if filled.shape[1] == 1:
        return 1.0
    pairs = np.maximum(present.T.astype(float) @ present.astype(float), 1.0)
    covariance = filled.T @ filled / pairs
    size = float(np.sum(covariance**2))
    return max(float(np.trace(covariance)) ** 2 / size, 1.0) if size > 0.0 else 1.0
