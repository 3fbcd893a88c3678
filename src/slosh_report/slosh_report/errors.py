"""The root exception of the package."""

from __future__ import annotations


class SloshReportError(ValueError):
    """Series cannot be compared or shown on a page; the text is one line."""
