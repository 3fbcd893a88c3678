"""Units in column headings, with their factors to SI units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from slosh_base.files.errors import SloshFileError
from slosh_base.types import Array

STANDARD_GRAVITY: Final = 9.80665
TIME: Final[Mapping[str, float]] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
ACCELERATION: Final[Mapping[str, float]] = {
    "m/s2": 1.0, "cm/s2": 1e-2, "mm/s2": 1e-3, "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
}  # fmt: skip
LENGTH: Final[Mapping[str, float]] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
TURNING: Final[Mapping[str, float]] = {
    "rad/s": 1.0, "deg/s": math.radians(1.0), "mrad/s": 1e-3, "1/min": math.tau / 60.0,
}  # fmt: skip
FORCE: Final[Mapping[str, float]] = {
    "n": 1.0, "mn": 1e-3, "kn": 1e3, "kgf": STANDARD_GRAVITY, "gf": 1e-3 * STANDARD_GRAVITY,
    "lbf": 4.4482216152605,
}  # fmt: skip
ANGLE: Final[Mapping[str, float]] = {"rad": 1.0, "deg": math.radians(1.0), "mrad": 1e-3}
NUMBER: Final[Mapping[str, float]] = {"": 1.0, "1": 1.0}
_KINDS: Final = (TIME, ACCELERATION, LENGTH, TURNING, FORCE, ANGLE, NUMBER)
_SPELLINGS: Final = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s",
    "msec": "ms", "millis": "ms", "milliseconds": "ms", "millisecond": "ms",
    "usec": "us", "micros": "us", "microseconds": "us", "microsecond": "us",
    "nsec": "ns", "nanos": "ns", "nanosec": "ns", "nanoseconds": "ns", "nanosecond": "ns",
    "minutes": "min", "minute": "min",
    "mps2": "m/s2", "ms2": "m/s2", "ms-2": "m/s2", "m/s/s": "m/s2", "m/sec2": "m/s2",
    "meter/s2": "m/s2", "mm/s/s": "mm/s2", "mms-2": "mm/s2", "mmps2": "mm/s2", "gn": "g",
    "g0": "g", "gal": "cm/s2", "milli-g": "mg",
    "newton": "n", "newtons": "n", "lbs": "lbf",
    "meter": "m", "metre": "m", "meters": "m", "metres": "m", "millimeter": "mm",
    "millimetre": "mm",
    "rads": "rad/s", "rads-1": "rad/s", "rad/sec": "rad/s", "radps": "rad/s",
    "°/s": "deg/s", "deg/sec": "deg/s", "degs": "deg/s", "dps": "deg/s", "degps": "deg/s",
    "rpm": "1/min", "rev/min": "1/min", "u/min": "1/min",
    "°": "deg", "degree": "deg", "degrees": "deg", "grad": "grad", "radian": "rad",
    "radians": "rad", "-": "1", "none": "1", "unitless": "1", "quaternion": "1",
}  # fmt: skip
_CHANGED = str.maketrans({"²": "2", "µ": "u", "μ": "u", "⁻": "-", "¹": "1", "−": "-"})
_DROPPED = re.compile(r"[\s^*·.]|\\")


_FROM, _TO = 9.4e8, 4.1e9  # s since 1970: the years 2000 to 2100
EPOCH_FROM: Final[Mapping[str, float]] = {
    unit: _FROM / TIME[unit] for unit in ("s", "ms", "us", "ns")
}
"""Numbers from here on (the year 2000) may be times since 1970 in this unit."""
SLOW = 1.0
"""No motion that moves a liquid is sampled so seldom [s]: the unit is another one,"""
SLOW_ROWS = 10
"""where there are more rows than a person writes."""
SLOWEST = 10.0
"""With few rows, too [s]."""
USUAL_RATES = (10.0, 20_000.0)
"""Rates at which motions are sampled [Hz]."""
LONGEST_MOTION = 86_400.0
"""A day [s]: it takes half a minute to simulate; more is a time in another unit."""


def unit_of(text: str) -> str:
    """Normalises the name of a unit: 'm/s²', 'm/s^2' and 'm s-2' become 'm/s2'."""
    plain = text.strip()
    for brackets in ("[]", "()", "{}", "<>"):
        if plain.startswith(brackets[0]) and plain.endswith(brackets[1]):
            plain = plain[1:-1]
    plain = _DROPPED.sub("", plain.translate(_CHANGED))
    lower = plain if plain in ("g", "mg") else plain.lower()
    return _SPELLINGS.get(lower, lower)


def is_unit(text: str) -> bool:
    """Returns whether a text is a known unit."""
    found = unit_of(text)
    return any(found in kind for kind in _KINDS)


def assumed_unit(first: float, t: Array) -> str:
    """Returns the unit of times since 1970; empty if the times count from another origin.

    Args:
        first: the first time as it stands in the table.
        t: (N,) times from some origin, in the same unit.
    """
    if not np.isfinite(t).all():
        return ""
    step = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    for unit, start in EPOCH_FROM.items():
        usual = 1e-5 <= step * TIME[unit] <= 10.0
        if start <= first <= _TO / TIME[unit] and (usual or len(t) < 2):
            return unit
    return ""


def likely_units(step: float) -> list[str]:
    """Returns the time units with which a row spacing gives a common sample rate."""
    low, high = USUAL_RATES
    return [u for u in ("ms", "us", "ns") if low <= 1.0 / (step * TIME[u]) <= high]


def check_step(path: Path, t: Array, unit: str | None, name: str, *, use: float = 0.0) -> None:
    """Raises an error if samples are so far apart that the time unit must be wrong.

    Args:
        path: of the table.
        t: (N,) [s].
        unit: that heading, values or user told; None: seconds were assumed.
        name: of the column.
        use: share of its speed limits that the motion uses with times in seconds; 0: unknown.
            In a unit in which it uses more than all of them the times are not.

    Raises:
        SloshFileError: the line names the likely unit and the option that tells it.
    """
    if unit is not None or len(t) < 2 or not np.isfinite(t).all():
        return
    step = float(np.median(np.diff(t)))
    if step < (SLOW if len(t) > SLOW_ROWS else SLOWEST):
        return
    usual = likely_units(step)
    units = [one for one in usual if use <= TIME[one]]
    if usual and not units:
        return
    likely = " or ".join(f"{one} ({1.0 / (step * TIME[one]):.4g} Hz)" for one in units)
    raise SloshFileError(
        f"{path}: column {name!r}: rows are {step:.6g} apart, too far for seconds; "
        + (f"probably {likely}: " if units else "")
        + f"give the unit: --time-unit {units[0] if units else 'ms'} (or s)"
    )


def check_span(path: Path, t: Array) -> None:
    """Raises an error if a motion is too long to simulate.

    Raises:
        SloshFileError: it is longer than LONGEST_MOTION.
    """
    span = float(t[-1] - t[0])
    if span > LONGEST_MOTION:
        raise SloshFileError(
            f"{path}: column 't': the motion lasts {span:.6g} s, more than {LONGEST_MOTION:g} "
            "s; is the time in another unit (--time-unit)? Otherwise split the table"
        )
