"""The package's root exception."""

from __future__ import annotations

from slosh_base.files.errors import SloshFileError


class SloshBagError(SloshFileError):
    """A bag is not usable; the text is one line with the path."""
