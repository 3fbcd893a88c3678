"""Range checks of scalar quantities."""

from __future__ import annotations

import math

from slosh_model.errors import SloshModelError


def mistaken_unit(value: float, unit: str, lower: float, upper: float) -> str:
    """Returns `; did you mean 65 mm, 0.065?` if a length in m looks like mm, else ''.

    Args:
        value: that is outside the bounds, in `unit`.
        unit: the SI unit of the quantity.
        lower, upper: bounds of the quantity in `unit`.
    """
    in_mm = 1e-3 * value
    if unit != "m" or value <= upper or not lower <= in_mm <= upper:
        return ""
    return f"; did you mean {value:g} mm, {in_mm:g}?"


def within(name: str, value: float, unit: str, lower: float, upper: float) -> None:
    """Raises SloshModelError unless lower <= value <= upper; `name` is the key in model.yaml."""
    if not (math.isfinite(value) and lower <= value <= upper):
        meant = mistaken_unit(value, unit, lower, upper)
        unit = unit and f" {unit}"
        raise SloshModelError(
            f"{name} = {value!r}{unit} must lie in [{lower:g}, {upper:g}]{unit}{meant}",
            tuple(name.split(".")),
        )
