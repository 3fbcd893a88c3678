"""Numbers of an identification as people read them."""

from __future__ import annotations

import math

from slosh_discovery.discovery_report.figures import ShownParameter
from slosh_report.page.units import DASH

UNITS = {"m": (1e3, "mm"), "rad": (180.0 / math.pi, "°"), "m/s": (1e3, "mm/s"), "1": (1.0, "")}
MOST_DIGITS = 9


def shown_value(name: str, unit: str, value: float, error: float) -> ShownParameter:
    """A value with its standard error, both rounded to two digits of the error.

    Args:
        name: of the parameter.
        unit: SI unit, "1" for none.
        value, error: in it.
    """
    scale, shown = UNITS.get(unit, (1.0, unit))
    value, error = scale * value, scale * error
    if not (math.isfinite(error) and error > 0.0):
        return ShownParameter(name, minus(f"{value:.4g}"), DASH, shown)
    digits = min(max(0, 1 - math.floor(math.log10(error))), MOST_DIGITS)
    return ShownParameter(name, minus(f"{value:.{digits}f}"), f"{error:.{digits}f}", shown)


def rounded(unit: str, value: float, error: float) -> str:
    """A number that goes with a value of that error, in the shown unit."""
    return shown_value("", unit, value, error).value


def minus(text: str) -> str:
    """With a true minus sign."""
    return text.replace("-", "−")
