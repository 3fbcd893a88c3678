"""Reads and writes contours and computed modes of a model file."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError
from slosh_base.files.yaml_document import KeyPath, dotted, shown
from slosh_model.containers import Container
from slosh_model.errors import SloshModelError
from slosh_model.shapes.contour import MOST_POINTS
from slosh_model.shapes.mode_numbers import MOST, NAMES, ModeNumbers
from slosh_model.shapes.solved import ModeTable, SolvedContainer

MODES, OWNER, IN_USE = "modes", "modes_of", "modes_in_use"
TURN = "turn"
_AXES = ("x", "y")
_LONGEST = 64_000
_HEADING = re.compile(
    r"[\s\"'#]*(?P<name>[^\W\d_]+)[\s\"']*(?:[\[(/_]\s*(?:in\s+)?(?P<unit>[^\])\s\"']+)[\])]?)?[\s\"']*"
)
_ACROSS = {"r": 1.0, "radius": 1.0, "x": 1.0, "d": 0.5, "diameter": 0.5}
"""Names of the first coordinate, with the share of a value that is it."""
_UPWARDS = ("z", "y", "h", "height")
_ANGLES = ("phi", "theta", "angle", "azimuth")
_UNITS = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "in": 0.0254,
    "inch": 0.0254, "inches": 0.0254, "ft": 0.3048,
}  # fmt: skip


def points_of(value: Any, path: KeyPath, folder: Path) -> Any:
    """Parses a list of coordinate pairs, or reads them from a .csv file.

    Args:
        value: of the model file.
        path: where it stands there.
        folder: to which the name of a file is relative.

    Raises:
        SloshModelError: neither, or no such file.
    """
    if isinstance(value, str):
        return _csv_points(folder / value, path)
    if not isinstance(value, list):
        raise SloshModelError(
            f"{dotted(path)} = {shown(value)} must be a list of pairs [m], or the name of a .csv "
            "file of them",
            path,
        )
    return tuple(tuple(pair) if isinstance(pair, list) else pair for pair in value)


def _csv_points(path: Path, keys: KeyPath) -> tuple[tuple[float, ...], ...]:
    try:
        lines = _cells(read_text(path, _LONGEST, guess=True))
    except (TextFileError, csv.Error) as error:
        raise SloshModelError(f"{dotted(keys)}: {error}", keys) from None
    found: list[tuple[float, ...]] = []
    factors, exchanged = (1.0, 1.0), False
    for number, cells in enumerate(lines, start=1):
        if not any(cells) or cells[0].startswith("#"):
            continue
        try:
            values = tuple(float(cell) for cell in cells)
        except ValueError:
            if not found and not any(map(_is_number, cells)):  # a heading
                factors, exchanged = _heading(path, cells, keys)
                continue
            raise SloshModelError(
                f"{path}:{number}: {','.join(cells)!r:.60} must be two numbers [m]", keys
            ) from None
        if len(values) == 2:
            values = (values[0] * factors[0], values[1] * factors[1])
        found.append(values[::-1] if exchanged else values)
        if len(found) > MOST_POINTS:
            raise SloshModelError(
                f"{path}: more than {MOST_POINTS} points; keep every second or third one", keys
            )
    return tuple(found)


def _heading(path: Path, cells: Sequence[str], keys: KeyPath) -> tuple[tuple[float, float], bool]:
    """Returns what a heading such as `r [mm],z [mm]` or `height,diameter` says of two columns.

    Returns:
        factors to metres and to the radius, and whether the second column comes first.

    Raises:
        SloshModelError: one column, an unknown unit, or angles.
    """
    if len(cells) < 2:
        raise SloshModelError(
            f"{path}: {cells[0]!r:.60} is no line of two columns, such as 'r,z' or '0.03,0.1'",
            keys,
        )
    names, factors = [], []
    for cell in cells[:2]:
        match = _HEADING.fullmatch(cell)
        name, unit = (match["name"].lower(), match["unit"]) if match else ("", None)
        if name in _ANGLES:
            raise SloshModelError(
                f"{path}: column {cell!r} holds angles: give the points as x and y", keys
            )
        if unit is not None and unit.lower() not in _UNITS:
            raise SloshModelError(
                f"{path}: column {cell!r}: the unit {unit!r} is unknown; known are "
                f"{', '.join(_UNITS)}",
                keys,
            )
        names.append(name)
        factors.append(_UNITS[unit.lower()] if unit else 1.0)
    first, second = (*names, "", "")[:2]
    # A trough's profile goes along y, an outline's second coordinate is y.
    exchanged = first in _UPWARDS and (second in _ACROSS or (second == "y" and first != "y"))
    across = second if exchanged else first
    factors[exchanged] *= _ACROSS.get(across, 1.0)
    return (factors[0], factors[1]), exchanged


def _cells(text: str) -> list[list[str]]:
    """Splits lines into cells; detects separator (, ; tab or space) and decimal mark."""
    separator = next((one for one in (";", "\t") if one in text), "," if "," in text else None)
    lines = [line.strip("\ufeff ") for line in text.splitlines()]
    if separator is None:
        return [line.split() for line in lines]
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator)]
    if separator == ",":
        return rows
    return [[cell.replace(",", ".") for cell in row] for row in rows]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def solved_section(container: Container, count: int) -> dict[str, Any]:
    """Returns the entries of a model file that hold at least `count` computed modes."""
    table = cast(SolvedContainer, container).with_table(count).table
    assert table is not None
    rows = [
        {name: _AXES[row.axis] if name == "axis" else getattr(row, name) for name in NAMES
         if name != TURN or row.turn}
        for row in table.rows
    ]  # fmt: skip
    return {MODES: rows, OWNER: table.digest}


def with_solved(
    container: Container, document: Mapping[str, Any]
) -> tuple[Container, tuple[Any, KeyPath]]:
    """Returns a container with the modes that its model file contains.

    Raises:
        SloshModelError: modes of another container, of one that needs none, or impossible ones.
    """
    rows = document.get(MODES, 1)
    if not isinstance(rows, list):
        for key in (OWNER, IN_USE):
            if key in document:
                raise SloshModelError(f"{key} belongs to a list of modes; here is none", (key,))
        return container, (rows, (MODES,))
    if not container.digest:
        raise SloshModelError(
            f"modes must be a number: those of a {container.shape} have closed forms", (MODES,)
        )
    owner = document.get(OWNER, container.digest)
    if owner != container.digest:
        raise SloshModelError(
            f"{OWNER} = {shown(owner)}: the modes belong to other dimensions than the "
            f"container's; delete {MODES} and {OWNER} to compute them again",
            (OWNER,),
        )
    if not 1 <= len(rows) <= 2 * MOST:
        raise SloshModelError(f"modes must list 1 … {MOST} modes along each axis", (MODES,))
    numbers = tuple(_row(row, (MODES, index)) for index, row in enumerate(rows))
    along = sum(row.axis == 0 for row in numbers)
    if along == 0:
        raise SloshModelError("modes lists none along x", (MODES,))
    made = replace(cast(Any, container), table=ModeTable(container.digest, numbers))
    return made, (document.get(IN_USE, along), (IN_USE,))


def _row(row: Any, path: KeyPath) -> ModeNumbers:
    if not isinstance(row, dict):
        raise SloshModelError(f"{dotted(path)} = {shown(row)} must be a mapping", path)
    for key in row:
        if key not in NAMES:
            raise SloshModelError(
                f"unknown key '{dotted((*path, key))}' (known: {', '.join(NAMES)})", (*path, key)
            )
    row = {TURN: 0.0, **row}  # left out: along x or y itself
    values: dict[str, Any] = {}
    for name in NAMES:
        if name not in row:
            raise SloshModelError(f"key '{dotted((*path, name))}' is missing", path)
        value = row[name]
        if name == "axis":
            if value not in _AXES:
                raise SloshModelError(
                    f"{dotted((*path, name))} = {shown(value)} must be x or y", (*path, name)
                )
            values[name] = _AXES.index(value)
        elif (
            isinstance(value, bool)
            or not isinstance(value, (int, float))
            or not math.isfinite(value)
        ):
            raise SloshModelError(
                f"{dotted((*path, name))} = {shown(value)} must be a finite number", (*path, name)
            )
        else:
            values[name] = float(value)
    try:
        return ModeNumbers(**values)
    except SloshModelError as error:
        raise SloshModelError(str(error), (*path, *error.keys)) from None
