"""Recognises columns by commonly used names."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from slosh_base.files.errors import SloshFileError
from slosh_base.types import Array

Tell = Callable[[str], object]
SEPARATORS: Mapping[str, str] = {
    ",": ",", ";": ";", "|": "|", "tab": "\t", "\t": "\t", "\\t": "\t", "space": " ", " ": " ",
}  # fmt: skip


class TableWarning(UserWarning):
    """Warning that the reader made an assumption about a table."""


def warn(line: str) -> None:
    """Issues a Python warning about an assumption on a table's format."""
    warnings.warn(line, TableWarning, stacklevel=2)


@dataclass(frozen=True, slots=True)
class TableOptions:
    """Format of a table; options that are not given are detected from the file.

    Attributes:
        columns: by our name (such as 'ax') the table's own name, or number from 1. Columns that
            are neither known nor named are passed over then.
        time_unit: of the time column: one of `TIME_UNITS`; None: from the heading or the values.
        decimal: '.' or ','; None: from the numbers.
        separator: between columns: a value of SEPARATORS; None: from the table.
        tell: is told what was assumed, one line for each table.

    Raises:
        SloshFileError: an option has no such value.

    >>> options = TableOptions(columns={"ax": "acc_x"}, time_unit="ms")
    >>> options.words
    ['--columns', 'ax=acc_x', '--time-unit', 'ms']
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    time_unit: str | None = None
    decimal: str | None = None
    separator: str | None = None
    tell: Tell = warn

    def __post_init__(self) -> None:
        if self.time_unit is not None and self.time_unit not in TIME_UNITS:
            raise SloshFileError(
                f"--time-unit {self.time_unit}: must be one of {', '.join(TIME_UNITS)}"
            )
        if self.decimal not in (None, ".", ","):
            raise SloshFileError(f"--decimal {self.decimal}: must be . or ,")
        if self.separator is not None and self.separator not in SEPARATORS.values():
            raise SloshFileError(f"--separator {self.separator}: must be , ; | tab or space")
        if self.decimal == self.separator == ",":
            raise SloshFileError("--decimal and --separator cannot both be a comma")

    @property
    def words(self) -> list[str]:
        """Returns the table options as words of a command line."""
        pairs = ",".join(f"{name}={given}" for name, given in self.columns.items())
        names = {
            value: name for name, value in reversed(tuple(SEPARATORS.items())) if len(name) != 2
        }
        given = {
            "--columns": pairs,
            "--time-unit": self.time_unit,
            "--decimal": self.decimal,
            "--separator": None if self.separator is None else names[self.separator],
        }
        return [word for option, value in given.items() if value for word in (option, value)]


FOUND_OUT = TableOptions()
"""No option: all is found out."""


STANDARD_GRAVITY: Final = 9.80665
TIME_UNITS: Final[Mapping[str, float]] = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
}
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
_EVERY_UNIT: Final = (TIME_UNITS, ACCELERATION, LENGTH, TURNING, FORCE, ANGLE, NUMBER)
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
    unit: _FROM / TIME_UNITS[unit] for unit in ("s", "ms", "us", "ns")
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
    return any(found in kind for kind in _EVERY_UNIT)


def assumed_unit(first: float, t: Array) -> str:
    """Returns the unit of times since 1970; empty if the times count from another origin.

    Args:
        t: (N,) times from some origin, in the same unit.
    """
    if not np.isfinite(t).all():
        return ""
    step = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    for unit, start in EPOCH_FROM.items():
        usual = 1e-5 <= step * TIME_UNITS[unit] <= 10.0
        if start <= first <= _TO / TIME_UNITS[unit] and (usual or len(t) < 2):
            return unit
    return ""


def likely_units(step: float) -> list[str]:
    """Returns the time units with which a row spacing gives a common sample rate."""
    low, high = USUAL_RATES
    return [u for u in ("ms", "us", "ns") if low <= 1.0 / (step * TIME_UNITS[u]) <= high]


def check_step(path: Path, t: Array, unit: str | None, name: str, *, use: float = 0.0) -> None:
    """Raises an error if samples are so far apart that the time unit must be wrong.

    Args:
        t: (N,) [s].
        unit: that heading, values or user told; None: seconds were assumed.
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
    units = [one for one in usual if use <= TIME_UNITS[one]]
    if usual and not units:
        return
    likely = " or ".join(f"{one} ({1.0 / (step * TIME_UNITS[one]):.4g} Hz)" for one in units)
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


TIME: Final = "t"
INDEXES: Final = ("", "unnamed: 0", "index", "idx", "row", "no", "nr", "#")
"""Names of a column that only counts the rows, as pandas and R write."""
_TIMES = (
    "t", "time", "timestamp", "timestamps", "stamp", "zeit", "zeitstempel", "datetime", "elapsed",
    "elapsedtime", "relativetime", "reltime", "seconds", "sec", "headerstamp", "timefromstart",
    "epoch", "unixtime",
)  # fmt: skip
_GROUPS: Final[Sequence[tuple[str, str, tuple[str, ...], Mapping[str, float]]]] = (
    ("a{}", "xyz", (
        "a", "acc", "accel", "acceleration", "linearacceleration", "linearaccel", "linacc",
        "accellinear", "beschleunigung",
    ), ACCELERATION),
    ("{}", "xyz", (
        "", "p", "pos", "position", "poseposition", "tcp", "tcppos", "tcpposition", "translation",
    ), LENGTH),
    ("q{}", "xyzw", (
        "q", "quat", "quaternion", "orientation", "poseorientation", "rotation",
    ), NUMBER),
    ("w{}", "xyz", (
        "w", "omega", "gyro", "gyr", "gyroscope", "angularvelocity", "angvel", "angularrate",
    ), TURNING),
    ("f{}", "xyz", ("f", "force", "wrenchforce", "kraft"), FORCE),
)  # fmt: skip
_BRACKETED = re.compile(r"(?P<name>.*?)\s*[\[({<](?P<unit>[^\[\](){}<>]*)[\])}>]\s*")
_DIVIDED = re.compile(r"(?P<name>[^/]+?)\s*/\s*(?P<unit>[^/]+(?:/[^/]+)?)")
_ENDING = re.compile(r"(?P<name>.+?)_(?P<unit>[A-Za-z]+2?(?:_s2?)?)")
_IN = re.compile(r"(?P<name>.+?)\s+in\s+(?P<unit>\S+)", re.IGNORECASE)


def _aliases() -> dict[str, str]:
    found = dict.fromkeys(_TIMES, TIME)
    for form, axes, bases, _ in _GROUPS:
        for axis in axes:
            for base in bases:
                found[base + axis] = found[axis + base] = form.format(axis)
    return found


_ALIASES: Final = _aliases()
_KINDS: Final[Mapping[str, Mapping[str, float]]] = {TIME: TIME_UNITS} | {
    form.format(axis): kind for form, axes, _, kind in _GROUPS for axis in axes
}


@dataclass(frozen=True, slots=True)
class Column:
    """A column to read from a table: its name, position, unit and factor to the SI unit.

    Attributes:
        name: ours, such as 'ax'.
        place: from 0.
        unit: as the table names it; empty: it does not.
        factor: from it to SI units.
    """

    name: str
    given: str
    place: int
    unit: str = ""
    factor: float = 1.0


def is_index(name: str) -> bool:
    """Whether a column of this name may be a row counter."""
    return name.strip().strip("\"'").lower() in INDEXES


def columns_of(
    path: Path,
    heading: Sequence[str],
    unit_row: Sequence[str],
    options: TableOptions,
    *,
    free: bool,
) -> list[Column]:
    """Returns the recognised columns of a table in their order.

    Args:
        path: of the table; for what is said of it.
        unit_row: units below them; empty: there are none.
        free: whether names other than the time's are the user's own, such as those of joints.

    Raises:
        SloshFileError: an option names a column that is not there, two columns have one meaning,
            or a unit is unknown.
    """
    wanted = _wanted(path, heading, options)
    # The user's own names are known by the option alone, where it gives more than the time's.
    chosen = bool(options.columns.keys() - {TIME})
    found: list[Column] = []
    for place, given in enumerate(heading):
        below = unit_row[place] if place < len(unit_row) else ""
        column = _column(path, given, place, below, wanted.get(place), options, free=free)
        known = not chosen or column.name == TIME if free else column.name in _KINDS
        taken = place in wanted or known or not options.columns
        if place not in wanted and column.name in options.columns:
            continue  # another column was named for it
        if taken or _is_height(column.name):
            found.append(column)
    _check_single(path, found)
    return found


def _wanted(path: Path, heading: Sequence[str], options: TableOptions) -> dict[int, str]:
    plain = [name.strip() for name in heading]
    wanted: dict[int, str] = {}
    for name, given in options.columns.items():
        if plain.count(given) == 1:
            place = plain.index(given)
        elif given.isdecimal() and 1 <= int(given) <= len(heading):
            place = int(given) - 1
        else:
            raise SloshFileError(
                f"{path}: --columns {name}={given}: the table has no column {given!r}; it has "
                f"{', '.join(repr(one) for one in plain)[:300]}"
            )
        if place in wanted:
            raise SloshFileError(f"{path}: --columns: column {given!r} is used twice")
        wanted[place] = name
    return wanted


def _column(
    path: Path,
    given: str,
    place: int,
    below: str,
    wanted: str | None,
    options: TableOptions,
    *,
    free: bool,
) -> Column:
    plain = given.strip().strip("\"'").strip()
    name, unit = (plain, "") if plain in _KINDS or _is_height(plain) else _parted(plain, free)
    if wanted and not unit and (match := _BRACKETED.fullmatch(plain)):
        unit = match["unit"] if is_unit(match["unit"]) else ""
    unit = unit or below.strip()
    name = wanted or name
    kind = _KINDS.get(name)
    if kind is None or (free and name != TIME):
        kind = {**ANGLE, **LENGTH} if free else LENGTH
        if not free and not _is_height(name):
            return Column(name, plain, place)  # an unknown column, which the caller refuses
    if not unit or (name == TIME and options.time_unit):
        return Column(name, plain, place)
    spelt = unit_of(unit)
    if spelt not in kind:
        known = ", ".join(one for one in kind if one)
        raise SloshFileError(
            f"{path}: column {plain!r}: the unit {unit!r} is unknown for {name}; known are "
            f"{known}; convert it"
            + (", or give its unit: --time-unit" if name == TIME else ", or rename the column")
        )
    return Column(name, plain, place, spelt, kind[spelt])


def _parted(plain: str, free: bool) -> tuple[str, str]:
    """Splits a heading such as 'Time (ms)' or 'a_x / (m/s²)' into name and unit."""
    bracketed = _BRACKETED.fullmatch(plain)
    if bracketed and (named := _ours(bracketed["name"], free=free)) is not None:
        return named, bracketed["unit"]  # whatever it is: one that is unknown is refused
    own = _ours(plain, free=free)
    if own is not None:
        return own, ""
    for form in (_BRACKETED, _IN, _DIVIDED, _ENDING):
        match = form.fullmatch(plain)
        if match is None:
            continue
        unit = match["unit"].replace("_", "/", 1) if form is _ENDING else match["unit"]
        name = _ours(match["name"], free=free)
        if name is not None and is_unit(unit):
            return name, unit
        if free and form is _BRACKETED and is_unit(unit):
            return match["name"].strip(), unit
        if _is_height(match["name"].strip()) and is_unit(unit):
            return match["name"].strip(), unit
    for base in _TIMES:
        ending = _key(plain).removeprefix(base)
        if ending and base + ending == _key(plain) and unit_of(ending) in TIME_UNITS:
            return TIME, ending
    return plain, ""


def _ours(text: str, *, free: bool) -> str | None:
    found = _ALIASES.get(_key(text))
    return None if free and found != TIME else found


def _key(text: str) -> str:
    return re.sub(r"[\W_]", "", text.lower())


def _is_height(name: str) -> bool:
    return name == "msh" or name.startswith(("eta_", "profile_"))


def _check_single(path: Path, columns: Sequence[Column]) -> None:
    for name in _KINDS:
        same = [column.given for column in columns if column.name == name]
        if len(set(same)) > 1:
            raise SloshFileError(
                f"{path}: columns {' and '.join(map(repr, same))} may all be {name}; choose "
                f"one: --columns {name}={same[0]}"
            )
