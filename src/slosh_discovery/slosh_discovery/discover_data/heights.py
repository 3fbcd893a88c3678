"""Processes measured heights: removes spikes, finds still level and noise."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_motion.signals.alignment import find_spikes, spike_limit

SPIKE_NOISES = 6.0
"""A sample that stands out by less than so many standard deviations of the noise is noise."""
_MAD = 1.4826
"""A normal deviation's standard deviation in units of its median absolute deviation."""
QUIET = 1.0
"""Length of the parts among which the quietest tells level and noise [s]."""
LEAST = 5
"""Samples that a part needs."""


class Still(NamedTuple):
    """Still level of the surface, and noise of the heights at rest [m]."""

    level: float
    noise: float


def without_spikes(height: Array) -> tuple[Array, int]:
    """Replaces single upward spikes by NaN; returns the heights and the number of spikes.

    Where the noise is large beside the sloshing, a replay's limit would take its upper half for
    spikes: what is within six standard deviations of the noise stays.

    Args:
        height: (N,) [m]; NaN: no sample.
    """
    noise = sample_noise(height)
    limit = max(spike_limit(height), SPIKE_NOISES * noise)
    spikes = find_spikes(height, limit)
    return np.where(spikes, np.nan, height), int(np.count_nonzero(spikes))


def sample_noise(height: Array) -> float:
    """Returns the standard deviation of white noise in heights [m]; 0 with too few samples.

    A sample's difference from the mean of its neighbours has 3/2 of the noise's variance.
    """
    bend = height[1:-1] - 0.5 * (height[:-2] + height[2:])
    bend = bend[np.isfinite(bend)]
    if not len(bend):
        return 0.0
    return _MAD * float(np.median(np.abs(bend - np.median(bend)))) / math.sqrt(1.5)


def find_still(t: Array, height: Array) -> Still:
    """Returns still level and noise [m] of the quietest second of the heights.

    Args:
        t: (N,) rising times [s].
        height: (N,) [m]; NaN: no sample.
    """
    known = np.isfinite(height)
    t, height = t[known], height[known]
    if not len(t):
        return Still(0.0, 0.0)
    parts = np.split(height, np.flatnonzero(np.diff(np.floor(t / QUIET))) + 1)
    large = [part for part in parts if len(part) >= LEAST] or [height]
    quietest = min(large, key=lambda part: float(np.std(part)))
    return Still(float(np.median(quietest)), float(np.std(quietest)))


def rms_about(height: Array, level: float) -> float:
    """Returns the rms of heights about a level [m]; NaN with fewer than LEAST samples."""
    known = height[np.isfinite(height)]
    if len(known) < LEAST:
        return float("nan")
    return float(np.sqrt(np.mean((known - level) ** 2)))
