"""Whitens autocorrelated noise with a first-order autoregression that allows gaps.

A sample's noise is ρ times that of the sample before, and something new. Over a gap of k sampling
intervals ρᵏ is left of it. Beside it there may be noise that does not remember, of another size
for every sample; the two are told apart by a Kalman filter, whose innovations are white.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from slosh_base.types import Array
from slosh_discovery.discover.differences import robust_scale
from slosh_discovery.discover.tuning import TUNING

Places = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Colour:
    """Autocorrelated noise of a sensor.

    Attributes:
        stddev: of one sample [m], positive.
        correlation: ρ of neighbouring samples, in (-1, 1).
    """

    stddev: float
    correlation: float

    @property
    def memory(self) -> float:
        """The autocorrelation ρ used for whitening; 0 if |ρ| is too large for sensor noise."""
        return self.correlation if abs(self.correlation) <= TUNING.most_colour else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Neighbours:
    """Index of the preceding sample for each sample in concatenated residuals.

    Attributes:
        before: (N,) place of the sample before in its series, -1: none.
        lags: (N,) sampling intervals between the two.
        frames: (N,) number of the image; those of one image follow one another.
    """

    before: Places
    lags: Places
    frames: Places

    def whitened(self, values: Array, colour: Colour) -> Array:
        """Returns a series, or each column of several series, whitened to unit variance."""
        return Whitening.of(self, colour.stddev, colour.memory).applied(values)


@dataclass(frozen=True, slots=True, eq=False)
class Whitening:
    """Filter that whitens correlated noise, by the innovations of a Kalman filter.

    Attributes:
        before: (N,) place of the sample before in its series, -1: none.
        memory: (N,) share of the sample before's noise that is left; 0: none.
        gain: (N,) share of a sample's surprise that is remembered noise; 1: all of it.
        spread: (N,) standard deviation of a sample's surprise [m].
        order: (N,) places series by series; None: every gain is 1, and none is needed.
    """

    before: Places
    memory: Array
    gain: Array
    spread: Array
    order: Places | None

    @classmethod
    def of(
        cls,
        neighbours: Neighbours,
        stddev: float,
        correlation: float,
        forgotten: Array | None = None,
    ) -> Whitening:
        """Creates the whitening filter for noise of some standard deviation and autocorrelation.

        Args:
            neighbours: the samples.
            stddev: of the noise that remembers [m].
            correlation: of it between neighbouring samples.
            forgotten: (N,) variance of the noise that does not [m²]; None: there is none.
        """
        before = neighbours.before
        memory = np.where(before >= 0, correlation**neighbours.lags, 0.0)
        if forgotten is None:
            spread = stddev * np.sqrt(1.0 - memory**2)
            return cls(before, memory, np.ones(len(before)), spread, None)
        gain, spread = _gains(before, memory, stddev**2, forgotten)
        return cls(before, memory, gain, spread, _series_order(before))

    def applied(self, values: Array) -> Array:
        """Whitens a series of heights [m], or each column of several, to unit variance."""
        if self.order is None:
            expected = _rows(self.memory, values) * values[self.before]
        else:
            kept = self.memory * self.gain[self.before]
            expected = self._recursion(
                self.memory - kept, _rows(kept, values) * values[self.before]
            )
        white: Array = (values - expected) / _rows(self.spread, values)
        return white

    def foretold(self, values: Array) -> tuple[Array, Array]:
        """Returns the deviation of each value (N,) from its prediction by all other values.

        By the smoother that goes back over the filter's innovations (de Jong 1989).

        Returns:
            (N,) deviations in units of the variance that they have, and the square roots of its
            inverse [1/m]: one divided by the other is of unit variance.
        """
        surprise = (self.applied(values) / self.spread).tolist()
        precision = (self.spread**-2).tolist()
        ahead = [*self.memory[1:].tolist(), 0.0]
        score, root = np.empty(len(values)), np.empty(len(values))
        told, known = 0.0, 0.0
        for i in range(len(values) - 1, -1, -1):
            share = float(self.gain[i]) * ahead[i]
            score[i] = surprise[i] - share * told
            root[i] = math.sqrt(precision[i] + share * share * known)
            left = ahead[i] - share
            told = surprise[i] + left * told
            known = precision[i] + left * left * known
        return score, root

    def undone(self, white: Array) -> Array:
        """Converts whitened values back to values (N,) [m]; the inverse of `applied`."""
        surprise = self.spread * white
        brought = self.memory * (self.gain * surprise)[self.before]
        order = _series_order(self.before) if self.order is None else self.order
        expected = _recursion(order, self.memory, brought)
        return np.asarray(expected + surprise)

    def _recursion(self, shares: Array, brought: Array) -> Array:
        assert self.order is not None
        return _recursion(self.order, shares, brought)


def _recursion(order: Places, shares: Array, brought: Array) -> Array:
    """Computes the recursion x[i] = shares[i] x[before[i]] + brought[i] along every series."""
    bands = np.ones((2, len(order)))
    bands[1, :-1] = -shares[order][1:]
    solved = np.empty_like(brought)
    solved[order] = solve_banded((1, 0), bands, brought[order], check_finite=False)
    return solved


def _rows(factors: Array, values: Array) -> Array:
    return factors if values.ndim == 1 else factors[:, np.newaxis]


def _gains(
    before: Places, memory: Array, variance: float, forgotten: Array
) -> tuple[Array, Array]:
    """Computes the Kalman gain and the innovation's standard deviation for each sample."""
    gains: list[float] = []
    spreads: list[float] = []
    left: list[float] = []
    for place, share, extra in zip(
        before.tolist(), memory.tolist(), forgotten.tolist(), strict=True
    ):
        known = left[place] if place >= 0 else variance
        expected = variance + share * share * (known - variance)
        total = expected + extra
        gains.append(expected / total)
        spreads.append(math.sqrt(total))
        left.append(expected * extra / total)
    return np.array(gains), np.array(spreads)


def _series_order(before: Places) -> Places:
    """Returns the order of samples in which each follows its predecessor in time."""
    if np.array_equal(before, np.arange(-1, len(before) - 1)):
        return np.arange(len(before))
    series: list[int] = []
    count = 0
    for place in before.tolist():
        if place < 0:
            series.append(count)
            count += 1
        else:
            series.append(series[place])
    return np.argsort(np.array(series, dtype=np.int64), kind="stable")


def neighbours_in(t: Array, kept: NDArray[np.bool_]) -> Neighbours:
    """Finds the preceding sample of each used height of one motion.

    Args:
        t: (M,) times of the heights [s].
        kept: (M, K) where there is a sample.
    """
    spacing = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    slots = np.round((t - t[0]) / spacing).astype(np.int64)
    numbers = np.full(kept.shape, -1, dtype=np.int64)
    numbers[kept] = np.arange(int(kept.sum()))
    before = np.full(int(kept.sum()), -1, dtype=np.int64)
    lags = np.ones_like(before)
    for column in range(kept.shape[1]):
        rows = np.flatnonzero(kept[:, column])
        own = numbers[rows, column]
        before[own[1:]] = own[:-1]
        lags[own[1:]] = np.maximum(np.diff(slots[rows]), 1)
    frames = np.broadcast_to(np.arange(len(kept))[:, np.newaxis], kept.shape)[kept]
    return Neighbours(before, lags, frames)


def estimate_colour(residual: Array, neighbours: Neighbours, parameters: int) -> Colour:
    """Estimates standard deviation and autocorrelation of a residual's noise, despite outliers.

    By the scales of sums and differences of neighbours, whose squares are as (1 + ρ) to (1 - ρ)
    (Gnanadesikan and Kettenring).

    Args:
        residual: (N,) [m].
        neighbours: of its samples.
        parameters: number of fitted ones, by which the residual is smaller than the noise.
    """
    count = len(residual)
    stddev = robust_scale(residual) * math.sqrt(count / max(count - parameters, 1))
    linked = np.flatnonzero((neighbours.before >= 0) & (neighbours.lags == 1))
    if len(linked) < TUNING.least_samples:
        return Colour(max(stddev, TUNING.least_noise), 0.0)
    one, other = residual[linked], residual[neighbours.before[linked]]
    sums, differences = robust_scale(one + other) ** 2, robust_scale(one - other) ** 2
    correlation = (sums - differences) / (sums + differences)
    return Colour(
        max(stddev, TUNING.least_noise),
        float(np.clip(correlation, -TUNING.largest_colour, TUNING.largest_colour)),
    )
