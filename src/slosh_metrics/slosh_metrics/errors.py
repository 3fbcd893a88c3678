"""The package's exception."""

from __future__ import annotations


class SloshMetricsError(ValueError):
    """The series cannot be compared; the text is one line."""
