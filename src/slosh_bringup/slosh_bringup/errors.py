"""The root exception of the package."""

from __future__ import annotations


class SloshBringupError(ValueError):
    """Error of a command, a configuration or a node process, with a one-line message."""
