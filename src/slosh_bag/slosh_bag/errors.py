"""The root exception of the package."""

from __future__ import annotations

from slosh_base.files.errors import SloshFileError


class SloshBagError(SloshFileError):
    """Error of a bag that cannot be used; the message is one line with the bag's path."""
