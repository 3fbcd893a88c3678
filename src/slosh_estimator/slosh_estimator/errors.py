"""The package's root exception."""

from __future__ import annotations


class SloshEstimatorError(ValueError):
    """A setting, a file or a sample is not usable; the text is one line."""
