"""The package's root exception."""

from __future__ import annotations


class SloshEstimatorError(ValueError):
    """A setting, a model file or a transform that cannot be used; the text is one line."""
