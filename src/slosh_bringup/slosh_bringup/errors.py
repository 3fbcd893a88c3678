"""The package's root exception."""

from __future__ import annotations


class SloshBringupError(ValueError):
    """A command, a configuration or a node process is not usable; the text is one line."""
