"""Computes high-order differences, which remove smooth signals and leave the noise."""

from __future__ import annotations

import math

import numpy as np
from scipy import special

from slosh_base.types import Array
from slosh_discovery.discover.tuning import TUNING

ORDERS = (10, 6, 3)
"""Of the differences: by the tenth, 8 Hz sampled at 60 Hz is attenuated to 2e-4 of its amplitude;
the others are for records that are too short or full of gaps."""


def normalised_differences(
    t: Array, height: Array, order: int, *, squared: float | None = None
) -> Array:
    """Computes differences that have the same standard deviation as the measurement noise.

    Args:
        t: (M,) [s].
        height: (M,) [m]; NaN: no sample.
        order: of the differences.
        squared: where the heights stand clear of this noise [m], their squares are used.
    """
    kept = np.isfinite(height)
    t, height = t[kept], height[kept]
    capped = height >= height.max(initial=-math.inf)
    if np.count_nonzero(capped) > order:  # the top of the picture: no noise there
        t, height = t[~capped], height[~capped]
    if len(t) < order + TUNING.least_samples:
        return np.empty(0)
    windows = np.lib.stride_tricks.sliding_window_view
    times, values = windows(t, order + 1), windows(height, order + 1)
    spans = times[:, -1] - times[:, 0]
    dense = spans <= TUNING.longest_span * order * float(np.median(np.diff(t)))
    weights = _difference_weights(times[dense] / spans[dense, np.newaxis])
    values = values[dense]
    plain = np.asarray(np.sum(weights * values, axis=1))
    if squared is None:
        return plain
    # (s + n)² = s² + 2 s n + n², of the variance 4 s² σ² + 2 σ⁴, where (s + n)² is s² + σ² wide.
    size = np.sum((weights * values) ** 2, axis=1)
    clear = size > (TUNING.clear_height * squared) ** 2
    spread = np.sqrt(np.maximum(4.0 * size - 2.0 * squared**2, 1e-300))
    return np.asarray(np.where(clear, np.sum(weights * values**2, axis=1) / spread, plain))


def _difference_weights(times: Array) -> Array:
    """Returns weights (W, P) of the divided difference over P times, with unit sum of squares."""
    gaps = times[:, :, np.newaxis] - times[:, np.newaxis, :]
    gaps[:, range(times.shape[1]), range(times.shape[1])] = 1.0
    weights = 1.0 / np.prod(gaps, axis=2)
    return np.asarray(weights / np.linalg.norm(weights, axis=1, keepdims=True))


def robust_scale(values: Array, cut: float = 2.5) -> float:
    """Returns the standard deviation of the Gaussian core of values, ignoring any above `cut`."""
    scale = 1.4826 * float(np.median(np.abs(values)))
    inside = special.erf(cut / math.sqrt(2.0))
    # Variance of a Gaussian that is cut off at ±cut.
    factor = 1.0 - 2.0 * cut * math.exp(-0.5 * cut**2) / math.sqrt(2.0 * math.pi) / inside
    for _ in range(2):
        core = values[np.abs(values) <= cut * scale]
        if len(core) == 0 or scale <= 0.0:
            break
        scale = math.sqrt(float(np.mean(core**2)) / factor)
    return max(scale, TUNING.least_noise)
