"""The package's root exception."""

from __future__ import annotations


class SloshBagError(ValueError):
    """A bag, table or record cannot be read or written; the text is one line naming the file."""
