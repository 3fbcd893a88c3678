"""The root exception of the package slosh_metrics."""

from __future__ import annotations


class SloshMetricsError(ValueError):
    """An error whose one-line text says why two series cannot be compared."""
