"""Detects the format of a table: comments, heading, separator."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import Final

from slosh_base.files.errors import SloshFileError
from slosh_motion.tables.columns import TableOptions, is_unit

COMMENTS: Final = ("#", "%", "//")
UNKNOWN: Final = frozenset({"", "nan", "na", "n/a", "#n/a", "#na", "null", "none", "<na>", "-nan"})
"""What spreadsheets and programs write where there is no value; compared in lower case."""
_SAMPLE = 48  # rows that tell what stands between columns
_BEFORE = 40  # lines that a logger writes before the heading, at most
_EXCEL = re.compile(r"sep=(.)\s*", re.IGNORECASE)
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eE][+-]?\d+)?|[+-]?inf|\d+(,\d{3})+(\.\d*)?")
_DATE = re.compile(r"\d{4}-\d\d-\d\d[ T]\d\d:\d\d.*")
_WORD = re.compile(r"""[^\s\[({]+(?:\s*[\[({][^\])}]*[\])}])?""")
_NAMES: Final = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "|", " ": "spaces"}


@dataclass(slots=True)
class Rows:
    """Heading, unit row and data rows of a text table, read one by one.

    Attributes:
        unit_row: units below them; empty: there are none.
        separator: between columns; ' ': any white space.
        before: lines before the heading that are no comments, and are passed over.
        dotted: whether a point stood in a row.
        comments: before the heading, without their marks.
    """

    path: Path
    heading: list[str]
    unit_row: list[str]
    separator: str
    first: list[tuple[int, str]] = field(default_factory=list)
    rest: Iterable[tuple[int, str]] = ()
    before: int = 0
    line: int = 0
    dotted: bool = False
    comments: tuple[str, ...] = ()

    def cells(self) -> Iterator[list[str]]:
        """Yields the rows' cells, without blank lines, comments and empty rows.

        Raises:
            SloshFileError: a row has more or fewer cells than the heading, or is no CSV.
        """
        width = len(self.heading)
        for cells in split(self._lines(), self.separator):
            if len(cells) != width:
                cells = self._fitted(cells, width)
            if cells and (cells[0] or any(cells)):
                yield cells

    def _lines(self) -> Iterator[str]:
        for number, text in chain(self.first, self.rest):
            self.line = number
            if not self.dotted and "." in text:
                self.dotted = True
            yield text

    def _fitted(self, cells: list[str], width: int) -> list[str]:
        if len(cells) > width and not any(cell.strip() for cell in cells[width:]):
            return cells[:width]
        if not any(cell.strip() for cell in cells):
            return []
        hint = ""
        if self.separator == "," and len(cells) > width:
            hint = "; decimal commas between commas? Save it with semicolons between the columns"
        raise SloshFileError(
            f"{self.path}: line {self.line}: has {len(cells)} columns, the heading has "
            f"{width}{hint}"
        )


def read_form(path: Path, text: Iterable[str], options: TableOptions) -> Rows:
    """Detects separator, heading and comments of a text table.

    Args:
        path: of the table; for what is said of it.

    Raises:
        SloshFileError: it is empty, or has no names of its columns.
    """
    said: list[tuple[int, str]] = []  # comments and Excel's own line before the heading
    numbered = enumerate(text, start=1)
    excel = None
    for number, line in numbered:
        plain = line.strip().lstrip("\ufeff")
        if match := _EXCEL.fullmatch(plain):
            excel = match[1]
        elif plain.startswith(COMMENTS):
            said.append((number, plain))
        elif plain:
            first = (number, line)
            break
    else:
        raise SloshFileError(f"{path}: is empty; a table starts with the names of its columns")
    kept = _rows_alone(numbered)
    sample = [first, *islice(kept, _SAMPLE)]
    separator, before = options.separator or excel, 0
    if separator is None:
        separator, before = _separator([line for _, line in sample])
        sample = sample[before:]
    heading, rows = _heading(path, sample, said, separator, options)
    unit_row: list[str] = []
    if rows:
        below = _one(rows[0][1], separator)
        if _is_unit_row(below):
            unit_row, rows = below, rows[1:]
    heading = _named_rows(heading, [_one(line, separator) for _, line in rows[:_SAMPLE]])
    comments = tuple(comment.lstrip("#%/").strip() for _, comment in said)
    return Rows(path, heading, unit_row, separator, rows, kept, before, comments=comments)


def name_of(separator: str) -> str:
    """Returns a separator's name for use in a sentence."""
    return _NAMES.get(separator, repr(separator))


def split(lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    """Splits lines of a table into cells at the separator."""
    if separator == " ":
        return (line.replace('"', "").split() for line in lines)
    return csv.reader(lines, delimiter=separator)


def _rows_alone(numbered: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Yields lines that are neither blank nor comments."""
    for number, line in numbered:
        start = line[:1]
        if start in "#%/" or start.isspace():  # few rows begin so: others are not looked into
            plain = line.strip()
            if not plain or (plain.startswith(COMMENTS) and plain.lower()[:4] != "#n/a"):
                continue
        yield number, line


def _heading(
    path: Path,
    sample: list[tuple[int, str]],
    said: list[tuple[int, str]],
    separator: str,
    options: TableOptions,
) -> tuple[list[str], list[tuple[int, str]]]:
    """Finds column names and rows of a table; the heading may be a comment."""
    first = _one(sample[0][1], separator)
    width = len(first)
    for _, comment in reversed(said):
        plain = comment.lstrip("#%/").strip()
        for names in (_one(plain, separator), _words(plain), _one(plain, ",")):
            named = len(names) == width > 1 and not any(_is_value(name) for name in names)
            if named and any(_NUMBER.fullmatch(cell.strip()) for cell in first):
                return [name.strip() for name in names], sample
    if not all(_is_value(cell) for cell in first):
        if separator == " ":
            first = _words(sample[0][1])
        return [name.strip() for name in first], sample[1:]
    if options.columns and all(given.isdecimal() for given in options.columns.values()):
        return [str(number) for number in range(1, width + 1)], sample
    if not any(cell.strip() for cell in first):
        raise SloshFileError(f"{path}: is empty; a table starts with the names of its columns")
    raise SloshFileError(
        f"{path}: line {sample[0][0]}: holds numbers where the names of the columns are expected; "
        "add a first line such as t,ax,ay,az, or name them by number: --columns t=1,ax=2,ay=3,az=4"
    )


def _words(line: str) -> list[str]:
    """Splits a line into column names with their units in brackets."""
    return _WORD.findall(line.replace('"', ""))


def _separator(sample: Sequence[str]) -> tuple[str, int]:
    """Detects the column separator and the number of lines before the heading.

    It makes rows of numbers as long as the heading; loggers write some lines about themselves
    before that.
    """
    for before in range(min(len(sample) - 1, _BEFORE) + 1):
        found = _parts(sample[before:])
        # A line with a number is a row, and one with a text among numbers is a mistake in a row.
        cells = _one(sample[before], found or ",")
        if found and not (before and any(_NUMBER.fullmatch(cell.strip()) for cell in cells)):
            return found, before
    most = max(("\t", ";", "|", ","), key=lambda one: sample[0].count(one))
    if sample[0].count(most) == 0 and len(sample[0].split()) > 1:
        return " ", 0
    return (most if sample[0].count(most) else ","), 0


def _parts(sample: Sequence[str]) -> str:
    """Returns the separator that gives all rows equal length; empty if none does."""
    for separator in ("\t", ";", "|", ",", " "):
        heading = _words(sample[0]) if separator == " " else _one(sample[0], separator)
        width = len(_without_end(heading))
        if (
            sample[1:]
            and width > 1
            and all(_fits(_one(line, separator), width) for line in sample[1:])
        ):
            return separator
    return ""


def _fits(row: Sequence[str], width: int) -> bool:
    short = len(_without_end(row))
    values = all(_is_value(cell) or is_unit(cell) for cell in row)
    return values and (short <= width <= len(row) or len(row) == width + 1)


def _without_end(row: Sequence[str]) -> list[str]:
    """Returns a row without empty cells at its end."""
    cells = list(row)
    while cells and not cells[-1].strip():
        cells.pop()
    return cells


def _named_rows(heading: list[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Removes empty names at the heading's end; adds a name for R's row names."""
    names = _without_end(heading)
    long = [row for row in rows if len(_without_end(row)) == len(names) + 1]
    if rows and len(long) == len(rows) and len(heading) == len(names):
        counts = [row[0].strip() for row in rows]
        if all(cell.isdecimal() for cell in counts) and _counts([int(cell) for cell in counts]):
            return ["", *names]
    return names


def _counts(values: Sequence[int]) -> bool:
    return all(b - a == 1 for a, b in pairwise(values))


def _is_unit_row(cells: Sequence[str]) -> bool:
    given = [cell for cell in cells if cell.strip()]
    numbers = any(_NUMBER.fullmatch(cell.strip()) for cell in given)
    return (
        bool(given)
        and not numbers
        and all(is_unit(cell) for cell in given)
        and any(cell.strip().lower() not in UNKNOWN for cell in given)
    )


def _is_value(cell: str) -> bool:
    plain = cell.strip()
    return (
        plain.lower() in UNKNOWN
        or _NUMBER.fullmatch(plain) is not None
        or _DATE.fullmatch(plain) is not None
    )


def _one(line: str, separator: str) -> list[str]:
    try:
        return next(split([line], separator), [])
    except csv.Error:
        return [line]
