"""The package's root exception."""

from __future__ import annotations


class SloshModelError(ValueError):
    """A container, model or input is physically or formally impossible; the text is one line."""
