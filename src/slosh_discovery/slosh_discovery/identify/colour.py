"""Noise that remembers: a first-order autoregression with gaps, and how a residual is freed of it.

A sample's noise is ρ times that of the sample before, and something new. Over a gap of k sampling
intervals ρᵏ is left of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.differences import LEAST_NOISE, robust_scale
from slosh_discovery.identify.trials import Trial

Array = NDArray[np.float64]
Places = NDArray[np.int64]

MOST = 0.9
"""A residual that goes together more strongly than this is no noise, but what the model lacks: to
free it of that would leave to the fit what the model gets wrong fastest."""
LARGEST = 0.99
LEAST_PAIRS = 12
"""Fewer neighbours tell of no colour."""


@dataclass(frozen=True, slots=True)
class Colour:
    """Noise of a sensor.

    Attributes:
        stddev: of one sample [m], positive.
        correlation: ρ of neighbouring samples, in (-1, 1).
    """

    stddev: float
    correlation: float

    @property
    def memory(self) -> float:
        """ρ of which a residual is freed; 0 where it is no noise's."""
        return self.correlation if abs(self.correlation) <= MOST else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Neighbours:
    """Which sample of a long row of residuals comes before which; see `Trial`.

    Attributes:
        before: (N,) place of the sample before, -1: none.
        lags: (N,) sampling intervals between the two.
        frames: (N,) number of the image; those of one image follow one another.
    """

    before: Places
    lags: Places
    frames: Places

    def whitened(self, values: Array, colour: Colour) -> Array:
        """Values (N,) or (N, P) without the colour, in units of the noise."""
        linked = self.before >= 0
        memory = np.where(linked, colour.memory**self.lags, 0.0)
        fresh = colour.stddev * np.sqrt(1.0 - memory**2)
        if values.ndim == 2:
            memory, fresh = memory[:, np.newaxis], fresh[:, np.newaxis]
        white: Array = (values - memory * values[self.before]) / fresh
        return white


def neighbours_of(trials: Sequence[Trial]) -> Neighbours:
    """Of the residuals of several trials in a row."""
    starts = np.cumsum([0, *(trial.count for trial in trials)])
    frame_starts = np.cumsum([0, *(len(trial.prepared.t) for trial in trials)])
    before = [
        np.where(trial.before >= 0, trial.before + start, -1)
        for trial, start in zip(trials, starts.tolist(), strict=False)
    ]
    frames = [
        trial.frames + start for trial, start in zip(trials, frame_starts.tolist(), strict=False)
    ]
    lags = [trial.lags for trial in trials]
    return Neighbours(np.concatenate(before), np.concatenate(lags), np.concatenate(frames))


def estimate_colour(residual: Array, neighbours: Neighbours, parameters: int) -> Colour:
    """The noise that a residual looks like; outliers do not count.

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
    if len(linked) < LEAST_PAIRS:
        return Colour(max(stddev, LEAST_NOISE), 0.0)
    one, other = residual[linked], residual[neighbours.before[linked]]
    sums, differences = robust_scale(one + other) ** 2, robust_scale(one - other) ** 2
    correlation = (sums - differences) / (sums + differences)
    return Colour(max(stddev, LEAST_NOISE), float(np.clip(correlation, -LARGEST, LARGEST)))
