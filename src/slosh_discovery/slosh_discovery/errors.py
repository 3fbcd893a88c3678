"""The package's root exception."""

from __future__ import annotations


class SloshDiscoveryError(ValueError):
    """Data that cannot be compared, aligned or reported; the text is one line."""
