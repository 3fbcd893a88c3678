"""Estimates at the stamps of images."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_estimator.sight import UNSOUND

MAX_GAP_NS = 50_000_000
"""Widest pair of estimates between which is interpolated."""


class ModelHeights(NamedTuple):
    """Heights of every model at the input's stamps.

    Attributes:
        stamps: (M,) increasing [ns].
        heights: (M, K) [m].
        azimuth: (M,) of the last model [rad].
        flags: (M,) bits of EstimateFlag.
        readings: (M, K) what a sensor reads of the heights [m]; None: the heights.
        delays: (M,) by how much a measurement comes late [ns]; None: it does not.
        accelerations: (M, 3) that drove the models [m/s²]; None: not kept.
    """

    stamps: Integers
    heights: Array
    azimuth: Array
    flags: Integers
    readings: Array | None = None
    delays: Integers | None = None
    accelerations: Array | None = None

    @property
    def as_read(self) -> Array:
        """(M, K) what a sensor reads of the heights [m]."""
        return self.heights if self.readings is None else self.readings


class AtImages(NamedTuple):
    """The same at N images; NaN where there is no estimate.

    Attributes:
        heights: (N, K) as a sensor reads them, linear between the two estimates around what the
            image shows [m].
        azimuth: (N,) of the estimate before it [rad].
        usable: (N,) whether the estimates come from a known state.
    """

    heights: Array
    azimuth: Array
    usable: NDArray[np.bool_]


def at_images(estimates: ModelHeights, stamps: Integers) -> AtImages:
    """Estimates at the stamps of images; none outside the series and in gaps of it.

    Args:
        estimates: at least one.
        stamps: (N,) [ns].
    """
    last = len(estimates.stamps) - 1
    if estimates.delays is not None:
        origin = estimates.stamps[0]
        late = np.interp(
            (stamps - origin).astype(float),
            (estimates.stamps + estimates.delays - origin).astype(float),
            estimates.delays.astype(float),
        )
        stamps = stamps - np.rint(late).astype(np.int64)
    after = np.searchsorted(estimates.stamps, stamps)
    exact = (after <= last) & (estimates.stamps[np.minimum(after, last)] == stamps)
    before = np.clip(np.where(exact, after, after - 1), 0, last)
    after = np.clip(after, 0, last)
    width = estimates.stamps[after] - estimates.stamps[before]
    share = (stamps - estimates.stamps[before]) / np.maximum(width, 1)
    low, high = estimates.as_read[before], estimates.as_read[after]
    heights = low + np.where(width > 0, share, 0.0)[:, None] * (high - low)
    outside = (stamps < estimates.stamps[0]) | (stamps > estimates.stamps[-1])
    none = outside | (width > MAX_GAP_NS)
    heights[none] = np.nan
    flags = estimates.flags[before] | estimates.flags[after]
    azimuth = np.where(none, np.nan, estimates.azimuth[before])
    return AtImages(heights, azimuth, (flags & UNSOUND) == 0)
