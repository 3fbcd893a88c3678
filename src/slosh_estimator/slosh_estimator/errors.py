"""The root exception of the package slosh_estimator."""

from __future__ import annotations

from slosh_motion.errors import SloshMotionError


class SloshEstimatorError(SloshMotionError):
    """An error whose one-line text says why a setting, a file or a sample cannot be used."""
