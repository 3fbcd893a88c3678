"""The package's root exception."""

from __future__ import annotations


class SloshMessageError(ValueError):
    """A message or a parameter holds what it must not; the text is one line."""
