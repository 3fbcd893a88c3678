"""The root exception of the package slosh_discovery."""

from __future__ import annotations


class SloshDiscoveryError(ValueError):
    """An error whose one-line text says why the data do not allow the computation."""
