"""The package's root exception."""

from __future__ import annotations


class SloshFileError(ValueError):
    """An output would destroy what is there; the text is one line with the path."""
