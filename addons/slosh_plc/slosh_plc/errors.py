"""The root exception of the package slosh_plc."""

from __future__ import annotations


class SloshPlcError(ValueError):
    """An error whose one-line text says why a cell's state cannot be served to a controller."""
