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
_NAME = re.compile(r"[\s\"'#]*([a-z]+)", re.IGNORECASE)
_BACKWARDS = (
    ["z", "r"], ["z", "x"], ["y", "x"], ["y", "r"],
    ["z", "radius"], ["height", "radius"], ["height", "r"], ["h", "r"], ["z", "y"],
)  # fmt: skip


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
        lines = _cells(read_text(path, _LONGEST))
    except (TextFileError, csv.Error) as error:
        raise SloshModelError(f"{dotted(keys)}: {error}", keys) from None
    found: list[tuple[float, ...]] = []
    exchanged = False
    for number, cells in enumerate(lines, start=1):
        if not any(cells) or cells[0].startswith("#"):
            continue
        try:
            found.append(tuple(float(cell) for cell in cells))
        except ValueError:
            if not found and not any(map(_is_number, cells)):  # a heading
                exchanged = _exchanged(cells)
                continue
            raise SloshModelError(
                f"{path}:{number}: {','.join(cells)!r:.60} must be two numbers [m]", keys
            ) from None
        if len(found) > MOST_POINTS:
            raise SloshModelError(f"{path}: more than {MOST_POINTS} points", keys)
    return tuple(pair[::-1] for pair in found) if exchanged else tuple(found)


def _exchanged(heading: Sequence[str]) -> bool:
    """Whether a heading such as `z,r` or `y [m],x [m]` says that the second column is first."""
    names = [_NAME.match(cell) for cell in heading]
    return [found and found[1].lower() for found in names] in _BACKWARDS


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
