"""Parses option values with units: `0.01`, `10mm`, `1e-2 m`, `5deg`, `300ms`."""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

_FAR = 100.0
_VALUE = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")


@dataclass(frozen=True, slots=True, eq=False)
class Quantity:
    """An argparse type for a number with an optional unit.

    Attributes:
        unit: of a bare number, and of what is returned.
        units: units that may follow the number, in the option's unit.
        mistaken: the unit in which people give such values by mistake.
        least, most: between which a bare number can be meant in the option's unit; one that is
            outside, and inside in the unit `mistaken`, is asked back. A number with its unit may
            be larger, up to _FAR times.
    """

    unit: str
    units: Mapping[str, float]
    mistaken: str = ""
    least: float = -math.inf
    most: float = math.inf

    def __call__(self, text: str) -> float:
        """Parses a number with an optional unit and converts it to this type's unit.

        Raises:
            argparse.ArgumentTypeError: no number, an unknown unit, or a number out of range.
        """
        match = _VALUE.fullmatch(text)
        if match is None:
            return self._special(text)
        value, unit = float(match[1]), match[2]
        if not unit:
            self._check(value)
            return value
        factor = self.units.get(unit)
        if factor is None:
            known = ", ".join(self.units)
            raise argparse.ArgumentTypeError(f"{text!r:.60}: unknown unit {unit!r:.20} ({known})")
        # 10mm is 0.01, to the last digit, where 10 * 0.001 may not be.
        value = value / round(1.0 / factor) if _whole(1.0 / factor) else value * factor
        self._check(value, _FAR)
        return value

    def meaning(self, unit: str) -> str:
        """Describes how another unit converts to this type's unit."""
        return f"1 {unit} = {self.units[unit]:.6g} {self.unit}"

    def _special(self, text: str) -> float:
        """Parses infinity and NaN, whose validity the command itself checks."""
        try:
            value = float(text)
        except ValueError:
            value = 0.0
        if math.isfinite(value):
            raise argparse.ArgumentTypeError(
                f"{text!r:.60} is not a number with or without a unit ({', '.join(self.units)})"
            )
        return value

    def _check(self, value: float, far: float = 1.0) -> None:
        least = self.least / far if self.least > 0.0 else far * self.least
        most = far * self.most
        if least <= value <= most:
            return
        unit = self.mistaken
        told = f"{value:g} {self.unit}".rstrip()
        meant = value * self.units.get(unit, math.nan)
        if far == 1.0 and least <= meant <= most:
            remedy = f"did you mean {value:g} {unit}, {meant:.4g}?"
        else:
            remedy = f"must be {_between(least, most)} {self.unit}".rstrip()
        raise argparse.ArgumentTypeError(f"{told} is out of range; {remedy}")


def _between(least: float, most: float) -> str:
    if math.isinf(least):
        return f"at most {most:g}"
    return f"{least:g} to {most:g}" if math.isfinite(most) else f"at least {least:g}"


def _whole(number: float) -> bool:
    return number > 1.0 and abs(number - round(number)) < 1e-9 * number


LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "um": 1e-6, "µm": 1e-6}
TIMES = {"ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "s": 1.0, "min": 60.0, "h": 3600.0}
_DEGREE = 180.0 / math.pi
ANGLES = {"rad": _DEGREE, "mrad": 1e-3 * _DEGREE, "deg": 1.0, "°": 1.0}
_G = 9.80665


def length(most: float = math.inf) -> Quantity:
    """Creates an argparse type for lengths [m]; rejects values above `most` as a wrong unit."""
    return Quantity("m", LENGTHS, "mm", most=most)


def time(most: float = math.inf) -> Quantity:
    """Creates an argparse type for times [s]; rejects values above `most` as a wrong unit."""
    return Quantity("s", TIMES, "ms", most=most)


def angle(least: float = -math.inf, most: float = math.inf) -> Quantity:
    """Creates an argparse type for angles [deg]; rejects values out of range as a wrong unit."""
    return Quantity("deg", ANGLES, "rad", least, most)


RADIANS = Quantity(
    "rad", {name: size / _DEGREE for name, size in ANGLES.items()}, "deg", -6.3, 6.3
)
"""Of a mounting: bounds of the estimator's `sensor_rotation`."""
HEIGHT = length(1.0)
"""Of the liquid, as slosh_plan.limits.HIGHEST."""
ERROR = length(0.2)
"""Of a height that a model or a person tells."""
FRACTION = Quantity("", {"%": 1e-2}, "%", 0.0, 1.0)
PERCENT = Quantity("%", {"%": 1.0})
RATE = Quantity("Hz", {"Hz": 1.0, "kHz": 1e3, "/s": 1.0})
SPEED = Quantity("/min", {"/min": 1.0, "1/min": 1.0, "rpm": 1.0, "Hz": 60.0})
ACCELERATION = Quantity("m/s2",
    {"mm/s2": 1e-3, "mm/s²": 1e-3, "m/s2": 1.0, "m/s²": 1.0, "g": _G},
    "mm/s2", most=500.0,
)  # fmt: skip
JERK = Quantity("m/s3",
    {"mm/s3": 1e-3, "mm/s³": 1e-3, "m/s3": 1.0, "m/s³": 1.0}, "mm/s3", most=20_000.0,
)  # fmt: skip
DENSITY = Quantity("kg/m3", {"kg/m3": 1.0, "kg/m³": 1.0, "g/cm3": 1e3, "g/cm³": 1e3})
VISCOSITY = Quantity("m2/s",
    {"mm2/s": 1e-6, "mm²/s": 1e-6, "cSt": 1e-6, "cm2/s": 1e-4, "m2/s": 1.0, "m²/s": 1.0},
)  # fmt: skip
SIZE = Quantity("byte", {"byte": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12})
QUANTITIES = (
    length(), time(), angle(), RADIANS, RATE, SPEED, ACCELERATION, JERK, DENSITY, VISCOSITY, SIZE
)  # fmt: skip
"""One of each kind."""
