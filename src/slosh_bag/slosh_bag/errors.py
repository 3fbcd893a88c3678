"""The package's root exception."""

from __future__ import annotations


class SloshBagError(ValueError):
    """A bag or a table is not usable; the text is one line with the path."""
