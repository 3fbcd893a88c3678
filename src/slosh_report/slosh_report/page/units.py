"""Display of numbers with SI units: scale and number of digits."""

from __future__ import annotations

import math
from typing import NamedTuple

from slosh_report.errors import SloshReportError

DASH = "–"
"""What stands for a number that is not known."""
MOST_DIGITS = 17
"""More decimals tell no two doubles apart that are of a size met here."""


class UnitDisplay(NamedTuple):
    """Scale, number of decimals and sign for displaying values of a unit.

    Attributes:
        scale: SI → shown unit.
        digits: decimals.
        signed: with a plus where positive.
    """

    scale: float
    digits: int
    signed: bool = False


UNITS = {
    "mm": UnitDisplay(1e3, 2),  # of metres
    "%": UnitDisplay(1e2, 1, signed=True),  # of a fraction; a deviation, so with its sign
    "% of": UnitDisplay(1e2, 0),  # of a share of a whole
    "s": UnitDisplay(1.0, 2),
    "ms": UnitDisplay(1e3, 0),  # of seconds
    "°": UnitDisplay(180.0 / math.pi, 0),  # of radians
    "m": UnitDisplay(1.0, 3),
    "m/s": UnitDisplay(1.0, 2),
    "m/s²": UnitDisplay(1.0, 2),
    "m/s³": UnitDisplay(1.0, 1),
    "1/s": UnitDisplay(1.0, 1),
    "×": UnitDisplay(1.0, 1),
    "": UnitDisplay(1.0, 0),
}
"""Units of the page by name. The number itself is in SI units."""


def shown(value: float | None, unit: str, digits: int | None = None) -> str:
    """Formats a number for display, without its unit.

    Args:
        value: in SI units; None or not finite: unknown.
        unit: one of UNITS.
        digits: decimals; None: the unit's own.

    Returns:
        for example '12.35' for 0.012345 in 'mm', '−11.9' for -0.119 in '%'.

    Raises:
        SloshReportError: another unit.
    """
    style = unit_style(unit)
    if value is None or not math.isfinite(value):
        return DASH
    text = f"{style.scale * value:.{style.digits if digits is None else digits}f}"
    if float(text) == 0.0:
        return text.removeprefix("-")
    plus = "+" if style.signed and value > 0.0 else ""
    return plus + text.replace("-", "−")


def unit_style(unit: str) -> UnitDisplay:
    """Returns scale, decimals and sign for displaying values of a unit.

    Raises:
        SloshReportError: it is not one of UNITS.
    """
    try:
        return UNITS[unit]
    except KeyError:
        known = ", ".join(repr(name) for name in UNITS)
        raise SloshReportError(f"unit {unit!r} is not one of {known}") from None


def digits_that_differ(value: float | None, other: float | None, unit: str) -> int:
    """Returns the number of decimals at which two different numbers look different."""
    least = unit_style(unit).digits
    if value is None or other is None or value == other:
        return least
    for digits in range(least, MOST_DIGITS):
        if shown(value, unit, digits) != shown(other, unit, digits):
            return digits
    return MOST_DIGITS
