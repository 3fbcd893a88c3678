"""The package's root exception."""

from __future__ import annotations


class SloshReportError(ValueError):
    """Series that cannot be compared, or what no page can show; the text is one line."""
