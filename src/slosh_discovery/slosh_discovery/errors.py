"""The root exception of the package."""

from __future__ import annotations


class SloshDiscoveryError(ValueError):
    """The data do not allow the requested computation; the text is one line."""
