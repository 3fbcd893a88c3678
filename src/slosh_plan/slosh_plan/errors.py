"""The package's root exception."""

from __future__ import annotations


class SloshPlanError(ValueError):
    """A motion or a limit that cannot be used; the text is one line."""
