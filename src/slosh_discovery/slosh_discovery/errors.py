"""The package's root exception."""

from __future__ import annotations


class SloshDiscoveryError(ValueError):
    """Data from which the asked-for answer cannot be computed; the text is one line."""
