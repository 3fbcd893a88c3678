"""The package's exception."""

from __future__ import annotations


class SloshMetricsError(ValueError):
    """Series that cannot be compared; the text is one line."""
