"""The root exception of the package."""

from __future__ import annotations

from slosh_base.files.errors import SloshFileError


class SloshBagError(SloshFileError):
    """A bag cannot be used; the text is one line with the path."""
