"""The root exception of the package."""

from __future__ import annotations


class SloshMessageError(ValueError):
    """A message or a parameter has an invalid value; the text is one line."""
