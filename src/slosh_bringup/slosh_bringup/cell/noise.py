"""Sensor noise of the simulated cell, reproducible."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def with_white_noise(values: Array, stddev: float, seed: int) -> Array:
    """The values with Gaussian noise of a standard deviation in their own unit."""
    if stddev == 0.0:
        return values
    return values + stddev * np.random.default_rng(seed).standard_normal(values.shape)
