"""The root exception of the package."""

from __future__ import annotations


class SloshBringupError(ValueError):
    """A command, a configuration or a node process cannot be used; the text is one line."""
