"""Checks of scalar quantities, shared by every value that has bounds."""

from __future__ import annotations

import math

from slosh_model.errors import SloshModelError


def positive(name: str, value: float, unit: str, upper: float) -> None:
    """Raises SloshModelError unless 0 < value <= upper."""
    if not (math.isfinite(value) and 0.0 < value <= upper):
        raise SloshModelError(
            f"{name} = {value!r} {unit} must lie in (0, {upper:g}] {unit}".rstrip()
        )
