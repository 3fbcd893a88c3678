"""Root of the exceptions that slosh_bag raises."""

from __future__ import annotations

from slosh_base.files.errors import SloshFileError


class SloshBagError(SloshFileError):
    """Error of a bag that cannot be used; the message is one line with the bag's path."""
