"""Recognises columns by commonly used names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from slosh_base.files.errors import SloshFileError
from slosh_motion.tables import units
from slosh_motion.tables.options import TableOptions

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
    ), units.ACCELERATION),
    ("{}", "xyz", (
        "", "p", "pos", "position", "poseposition", "tcp", "tcppos", "tcpposition", "translation",
    ), units.LENGTH),
    ("q{}", "xyzw", (
        "q", "quat", "quaternion", "orientation", "poseorientation", "rotation",
    ), units.NUMBER),
    ("w{}", "xyz", (
        "w", "omega", "gyro", "gyr", "gyroscope", "angularvelocity", "angvel", "angularrate",
    ), units.TURNING),
    ("f{}", "xyz", ("f", "force", "wrenchforce", "kraft"), units.FORCE),
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
_KINDS: Final[Mapping[str, Mapping[str, float]]] = {TIME: units.TIME} | {
    form.format(axis): kind for form, axes, _, kind in _GROUPS for axis in axes
}


@dataclass(frozen=True, slots=True)
class Column:
    """A column to read from a table: its name, position, unit and factor to the SI unit.

    Attributes:
        name: ours, such as 'ax'.
        given: the table's.
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
        heading: the names as they stand there.
        unit_row: units below them; empty: there are none.
        options: what the user says.
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
        unit = match["unit"] if units.is_unit(match["unit"]) else ""
    unit = unit or below.strip()
    name = wanted or name
    kind = _KINDS.get(name)
    if kind is None or (free and name != TIME):
        kind = {**units.ANGLE, **units.LENGTH} if free else units.LENGTH
        if not free and not _is_height(name):
            return Column(name, plain, place)  # an unknown column, which the caller refuses
    if not unit or (name == TIME and options.time_unit):
        return Column(name, plain, place)
    spelt = units.unit_of(unit)
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
        if name is not None and units.is_unit(unit):
            return name, unit
        if free and form is _BRACKETED and units.is_unit(unit):
            return match["name"].strip(), unit
        if _is_height(match["name"].strip()) and units.is_unit(unit):
            return match["name"].strip(), unit
    for base in _TIMES:
        ending = _key(plain).removeprefix(base)
        if ending and base + ending == _key(plain) and units.unit_of(ending) in units.TIME:
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
