"""Reads a table with standard column names and SI units, and notes assumptions."""

from __future__ import annotations

import csv
import math
import re
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal, InvalidOperation
from operator import itemgetter
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from slosh_base.files import bounded_text as bounds
from slosh_base.files.errors import SloshFileError
from slosh_base.files.file_kind import TEXT, foreign_kind
from slosh_base.types import Array
from slosh_motion.tables.columns import (
    EPOCH_FROM,
    FOUND_OUT,
    TIME,
    TIME_UNITS,
    Column,
    TableOptions,
    assumed_unit,
    check_step,
    columns_of,
    is_index,
)
from slosh_motion.tables.form import UNKNOWN, Rows, name_of, read_form

_THOUSANDS: Final = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
"""A number whose comma may be decimal, or part thousands."""


@dataclass(frozen=True, slots=True, eq=False)
class TextTable:
    """Columns of numbers read from a text table.

    Attributes:
        names: ours, or the table's own where we have none.
        data: (N, K) in SI units.
        lines: (N,) where in the file the rows stand, from 1.
        comments: before the heading.
    """

    path: Path
    names: list[str]
    data: Array
    lines: NDArray[np.int64]
    comments: tuple[str, ...] = ()

    def column(self, name: str) -> Array:
        """Returns the values (N,) of one column."""
        values: Array = self.data[:, self.names.index(name)]
        return values

    def group(self, names: Sequence[str]) -> Array | None:
        """Returns the values (N, len(names)) of several columns, or None if they are missing."""
        if names[0] not in self.names:
            return None
        return np.ascontiguousarray(self.data[:, [self.names.index(name) for name in names]])

    def check_finite(self, heights: Callable[[str], bool] = lambda name: False) -> None:
        """Raises an error if inputs are not finite or heights are infinite.

        Raises:
            SloshFileError: the text names the line and the column.
        """
        for place, name in enumerate(self.names):
            values, height = self.data[:, place], heights(name)
            bad = np.isinf(values) if height else ~np.isfinite(values)
            if bad.any():
                row = int(np.argmax(bad))
                rule = "heights may be NaN, not infinite" if height else "inputs must be finite"
                raise SloshFileError(
                    f"{self.path}: line {self.lines[row]}: column {name!r}: {values[row]} is not "
                    f"allowed; {rule}"
                )

    def check_time(self) -> None:
        """Raises an error if times do not increase.

        Raises:
            SloshFileError: the text names the line.
        """
        t = self.column(TIME)
        late = np.flatnonzero(np.diff(t) <= 0.0)
        if len(late):
            row = int(late[0]) + 1
            raise SloshFileError(
                f"{self.path}: line {self.lines[row]}: column 't': {t[row]:.9g} s does not come "
                f"after {t[row - 1]:.9g} s; time must increase"
            )


def read_table(
    path: Path,
    check: Callable[[Path, list[str]], None],
    options: TableOptions = FOUND_OUT,
    *,
    may_be_blank: Callable[[str], bool] = lambda name: False,
    free: bool = False,
    sampled: bool | Callable[[TextTable], float] = True,
    relative: bool = False,
) -> TextTable:
    """Reads a table of numbers from a file.

    Args:
        path: a text file; one whose name ends in .gz is unpacked.
        check: raises where the names of its columns are not as they should be.
        may_be_blank: whether a column may have cells without a value, which become NaN.
        free: whether names other than the time's are the user's own, such as those of joints.
        sampled: whether its rows sample a motion, or what tells `check_step` which share of its
            speed limits the motion uses; False: waypoints, at any times.
        relative: whether times in seconds since 1970 are counted from the first one, without
            loss, too; those in other units are.

    Raises:
        SloshFileError: the file is missing, empty or cut off, a value is no number, or something
            has two meanings; one line that names file, line and column, and the option that
            settles it.
    """
    _check_kind(path)
    with bounds.bounded_text(path, "a motion table is CSV") as text:
        form = read_form(path, text, options)
        try:
            columns = columns_of(path, form.heading, form.unit_row, options, free=free)
            indexes = [c for c in columns if is_index(c.given) and c.name not in options.columns]
            kept = [column for column in columns if column not in indexes]
            check(path, [column.name for column in kept])
            reader = _Numbers(form, [*kept, *indexes], options, may_be_blank, relative)
            reader.read()
        except csv.Error as error:
            raise SloshFileError(f"{path}: line {form.line}: is not CSV: {error}") from None
    notes = [note for note in (_separated(form, options), reader.finish()) if note]
    data = reader.data
    for place, column in enumerate(indexes, start=len(kept)):
        _check_index(path, column, data[:, place])
    scaled, unit = _scaled(kept, data, reader, options)
    notes += scaled
    passed = [name for k, name in enumerate(form.heading) if k not in {c.place for c in kept}]
    if passed:
        notes.append(f"not read: {', '.join(name or 'the index column' for name in passed)}")
    if notes:
        options.tell(f"{path}: read as: {'; '.join(notes)}")
    names = [column.name for column in kept]
    lines = np.frombuffer(reader.lines, np.int64)
    table = TextTable(path, names, data[:, : len(kept)], lines, form.comments)
    if sampled is not False and TIME in names:
        use = 0.0 if sampled is True else sampled(table)
        check_step(path, table.column(TIME), unit, kept[names.index(TIME)].given, use=use)
    return table


def _check_kind(path: Path) -> None:
    """Raises an error if a file is not a table, such as a workbook or a Git LFS pointer.

    Raises:
        SloshFileError: the line says what it is.
    """
    if not path.is_file() or path.suffix == ".gz":
        return
    kind = foreign_kind(path)
    if kind is not None and kind != TEXT:
        remedy = "" if kind[0] in ("a Parquet file", "a picture", "a PDF file") else f" {kind[1]}"
        workbook = path.suffix.lower() in (".xlsx", ".ods", ".xls")
        remedy = " save the workbook as CSV" if workbook else remedy
        raise SloshFileError(
            f"{path}: is not a table, it is {kind[0]}; a table must be CSV;{remedy}".rstrip(";")
        )


def _separated(form: Rows, options: TableOptions) -> str:
    notes = []
    if form.before:
        notes.append(f"the heading follows {form.before} other lines")
    if form.separator not in (",", options.separator):
        notes.append(f"{name_of(form.separator)} between the columns")
    return "; ".join(notes)


def _scaled(
    columns: Sequence[Column], data: Array, reader: _Numbers, options: TableOptions
) -> tuple[list[str], str | None]:
    """Converts values to SI units in place; returns remarks, and the unit that times had.

    The unit is None where seconds were assumed.
    """
    notes: dict[str, list[str]] = {}
    told: str | None = None
    for place, column in enumerate(columns):
        unit, factor = column.unit, column.factor
        if column.name == TIME:
            found = options.time_unit or reader.clock.unit or column.unit
            if not found:
                found = assumed_unit(reader.clock.first, data[:, place])
            unit, factor, told = found or "s", TIME_UNITS[found or "s"], found or None
            if reader.clock.origin is not None:
                notes.setdefault(f"counted from {reader.clock.origin}", []).append(TIME)
        if factor != 1.0:
            data[:, place] *= factor
        if column.given != column.name or factor != 1.0:
            said = f" in {unit}" if factor != 1.0 else ""
            named = "" if column.given == column.name else f" from {column.given!r}"
            key = said if not named else f"{named}{said}"
            notes.setdefault(key, []).append(column.name)
    lines = [f"{', '.join(names)}{how if how[:1] == ' ' else f' {how}'}"
            for how, names in notes.items()]  # fmt: skip
    return lines, told


def _check_index(path: Path, column: Column, values: Array) -> None:
    if len(values) > 1 and not (np.diff(values) == 1.0).all():
        name = column.given or f"number {column.place + 1}"
        raise SloshFileError(
            f"{path}: column {name} has no known name and is not a row number; rename it, or "
            "choose the columns to read: --columns t=…,ax=…"
        )


class _Clock:
    """Reads the time column: numbers, large numbers without loss of digits, or dates.

    Args:
        large: numbers from here on are counted from the first.

    Attributes:
        first: the first number as it stands there; NaN: dates.
        unit: 's' for dates; empty: numbers.
        origin: what times are counted from; None: as they stand there.
    """

    def __init__(self, large: float) -> None:
        self._large = large
        self.first = math.nan
        self.unit = ""
        self.origin: str | None = None
        self._number: Decimal | None = None
        self._date: datetime | None = None
        self._started = False

    def read(self, cell: str) -> float:
        """Returns the time in a cell, in the column's unit, or in seconds for a date.

        Raises:
            ValueError: it is none.
        """
        if not self._started:
            self._start(cell)
        if self._number is not None:
            try:
                return float(Decimal(cell) - self._number)
            except InvalidOperation:
                raise ValueError(cell) from None
        if self._date is not None:
            return (_date(cell) - self._date).total_seconds()
        return float(cell)

    def _start(self, cell: str) -> None:
        try:
            self.first = float(cell)
        except ValueError:
            self._date = _date(cell)
            self.unit, self.origin = "s", cell.strip()
        else:
            # A double holds 1.7e18 ns in steps of 256: what is large is counted from the first.
            if abs(self.first) >= self._large and math.isfinite(self.first):
                self._number, self.origin = Decimal(cell), cell.strip()
        self._started = True


def _date(cell: str) -> datetime:
    return datetime.fromisoformat(cell.strip().removesuffix(" UTC"))


class _Numbers:
    """Reads rows as numbers with decimal points or commas."""

    def __init__(
        self,
        form: Rows,
        columns: Sequence[Column],
        options: TableOptions,
        may_be_blank: Callable[[str], bool],
        relative: bool,
    ) -> None:
        self._form = form
        self._columns = columns
        self._decimal = options.decimal
        self._blank = [may_be_blank(column.name) for column in columns]
        self._time = next((k for k, one in enumerate(columns) if one.name == TIME), None)
        self._values = array("d")
        self._grouped = ""  # a cell whose comma may part thousands, such as '1,234'
        self._commas = False
        self._surely = False
        self.lines = array("q")
        self.clock = _Clock(EPOCH_FROM["s" if relative else "ms"])

    @property
    def data(self) -> Array:
        """Returns the values that were read, one row per line of the table."""
        return np.frombuffer(self._values, np.float64).reshape(-1, len(self._columns))

    def read(self) -> None:
        """Reads all rows of the table as numbers.

        Raises:
            SloshFileError: a cell is no number, or there are no rows or too many.
        """
        form, values, most = self._form, self._values, bounds.MOST_CELLS
        places = [column.place for column in self._columns]
        pick = itemgetter(*places) if len(places) > 1 else lambda cells: (cells[places[0]],)
        for cells in form.cells():
            picked = pick(cells)
            try:
                values.extend(self._row(picked))
            except ValueError:
                values.extend(self._row(self._cleaned(picked)))
            self.lines.append(form.line)
            if len(values) > most:
                raise SloshFileError(
                    f"{form.path}: has more than {most} cells; cut it into several"
                )
        if not values:
            raise SloshFileError(f"{form.path}: contains a heading but no rows")

    def _row(self, cells: Sequence[str]) -> list[float]:
        if self._time is None:
            return list(map(float, cells))
        at = self._time
        time = self.clock.read(cells[at])
        return [*map(float, cells[:at]), time, *map(float, cells[at + 1 :])]

    def _cleaned(self, cells: Sequence[str]) -> list[str]:
        return [self._clean(k, cell.strip()) for k, cell in enumerate(cells)]

    def _clean(self, place: int, cell: str) -> str:
        """Converts a cell to a number in Python's format.

        Raises:
            SloshFileError: it is no number.
        """
        if cell.lower() in UNKNOWN and (cell or self._blank[place]):
            return "nan"
        if place == self._time and self.clock.unit:
            return self._checked_date(place, cell)
        cell = cell.replace("\u2212", "-")  # the minus sign of word processors
        if "," in cell and self._decimal != ".":
            whole, _, part = cell.partition(",")
            if "," not in part and "." not in cell:
                self._commas = True
                if _THOUSANDS.fullmatch(cell):
                    self._grouped = self._grouped or cell
                else:
                    self._surely = True
                cell = f"{whole}.{part}"
        try:
            float(cell)
        except ValueError:
            return self._checked_date(place, cell)
        return cell

    def _checked_date(self, place: int, cell: str) -> str:
        try:
            if place == self._time:
                _date(cell)
                return cell
        except ValueError:
            pass
        hint = ""
        if any(mark in cell for mark in ",'") and any(map(str.isdecimal, cell)):
            hint = "; thousands separators cannot be read, save it without"
        elif place == self._time:
            hint = "; a date is read as 2025-03-01 12:00:00.25"
        elif not cell:
            hint = "; fill the cell, or delete the row"
        raise SloshFileError(
            f"{self._form.path}: line {self._form.line}: column "
            f"{self._columns[place].given!r}: {cell!r:.60} is not a number{hint}"
        )

    def finish(self) -> str:
        """Returns the assumption made about decimal points or commas; empty if none was made.

        Raises:
            SloshFileError: their commas have two meanings.
        """
        if not self._commas or self._decimal == ",":
            return ""
        if self._form.dotted:
            raise SloshFileError(
                f"{self._form.path}: contains decimal points and commas: save it without "
                "thousands separators, or give --decimal ,"
            )
        if not self._surely:
            raise SloshFileError(
                f"{self._form.path}: the comma in {self._grouped!r} may be a decimal comma or "
                "a thousands separator: give --decimal , (or save the table without thousands "
                "separators)"
            )
        return "decimal commas"
