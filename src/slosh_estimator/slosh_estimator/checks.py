"""Checks of settings."""

from __future__ import annotations

import math

from slosh_estimator.errors import SloshEstimatorError


def in_range(name: str, value: float, low: float, high: float, unit: str) -> None:
    """Refuses a setting outside its range.

    Raises:
        SloshEstimatorError: value is not finite or not in [low, high].
    """
    if not (math.isfinite(value) and low <= value <= high):
        raise SloshEstimatorError(f"{name} = {value!r} {unit} must lie in [{low:g}, {high:g}]")


def optional_limit(name: str, value: float) -> None:
    """Refuses a limit that is neither NaN (off) nor positive.

    Raises:
        SloshEstimatorError: value is infinite, zero or negative.
    """
    if not (math.isnan(value) or (math.isfinite(value) and value > 0.0)):
        raise SloshEstimatorError(f"{name} = {value!r} m must be positive, or NaN for no limit")
