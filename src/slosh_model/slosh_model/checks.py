"""Checks of scalar quantities, shared by every value that has bounds."""

from __future__ import annotations

import math

from slosh_model.errors import SloshModelError


def within(name: str, value: float, unit: str, lower: float, upper: float) -> None:
    """Raises SloshModelError unless lower <= value <= upper; the name is that in model.yaml."""
    if not (math.isfinite(value) and lower <= value <= upper):
        unit = unit and f" {unit}"
        raise SloshModelError(
            f"{name} = {value!r}{unit} must lie in [{lower:g}, {upper:g}]{unit}",
            tuple(name.split(".")),
        )
