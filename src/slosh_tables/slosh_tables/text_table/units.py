"""Units that headings name, as factors to SI units."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Final

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
ANGLE: Final[Mapping[str, float]] = {"rad": 1.0, "deg": math.radians(1.0), "mrad": 1e-3}
NUMBER: Final[Mapping[str, float]] = {"": 1.0, "1": 1.0}
_SPELLINGS: Final = {
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sek": "s",
    "msec": "ms", "millis": "ms", "milliseconds": "ms", "millisecond": "ms",
    "usec": "us", "micros": "us", "microseconds": "us", "microsecond": "us",
    "nsec": "ns", "nanos": "ns", "nanosec": "ns", "nanoseconds": "ns", "nanosecond": "ns",
    "minutes": "min", "minute": "min",
    "mps2": "m/s2", "ms2": "m/s2", "ms-2": "m/s2", "m/s/s": "m/s2", "m/sec2": "m/s2",
    "meter/s2": "m/s2", "mm/s/s": "mm/s2", "mms-2": "mm/s2", "mmps2": "mm/s2", "gn": "g",
    "g0": "g", "gal": "cm/s2", "milli-g": "mg",
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


def unit_of(text: str) -> str:
    """A unit in its usual spelling: 'm/s²', 'm/s^2' and 'm s-2' are all 'm/s2'."""
    plain = text.strip()
    for brackets in ("[]", "()", "{}", "<>"):
        if plain.startswith(brackets[0]) and plain.endswith(brackets[1]):
            plain = plain[1:-1]
    plain = _DROPPED.sub("", plain.translate(_CHANGED))
    lower = plain if plain in ("g", "mg") else plain.lower()
    return _SPELLINGS.get(lower, lower)


def is_unit(text: str) -> bool:
    """Whether a text is a unit of any kind."""
    found = unit_of(text)
    return any(found in kind for kind in (TIME, ACCELERATION, LENGTH, TURNING, ANGLE, NUMBER))
