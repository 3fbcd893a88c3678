"""The root exception of the package slosh_motion."""

from __future__ import annotations


class SloshMotionError(ValueError):
    """An error whose one-line text says what is wrong with an input or two series."""
