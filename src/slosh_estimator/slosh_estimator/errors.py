"""The package's root exception."""

from __future__ import annotations


class SloshEstimatorError(ValueError):
    """A setting, a file or a sample cannot be used; the text is one line."""
