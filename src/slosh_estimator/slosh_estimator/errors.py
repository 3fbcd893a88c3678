"""The root exception of the package."""

from __future__ import annotations


class SloshEstimatorError(ValueError):
    """A setting, a file or a sample cannot be used; the text is one line."""
