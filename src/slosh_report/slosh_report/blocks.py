"""Parts of a printed document, laid out by both the HTML page and the PDF file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from slosh_report.page.units import shown
from slosh_report.run_report.rows import Fact


@dataclass(frozen=True, slots=True)
class Number:
    """A number in a table, with unit, digits and prefix.

    Attributes:
        value: in SI units; NaN: unknown.
        unit: in which it is shown, one of UNITS; the table's head names it.
        digits: decimals; None: the unit's own.
        prefix: sign before the number, such as "≥ ".
    """

    value: float
    unit: str = ""
    digits: int | None = None
    prefix: str = ""

    @property
    def text(self) -> str:
        """The formatted number, with its prefix."""
        return self.prefix + shown(self.value, self.unit, self.digits)


Cell: TypeAlias = str | Number


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a printed table: heading, width and alignment.

    Attributes:
        head: its heading, with the unit.
        width: share of the table's width, relative to the other columns.
        right: whether its cells are aligned at their right ends.
        code: whether its cells are in a font of equal widths, broken anywhere.
    """

    head: str
    width: float
    right: bool = False
    code: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a document.

    Attributes:
        caption: what it shows.
        columns: from left to right.
        rows: cells, as many as columns in each.
        tall: whether rows have room to write in by hand.
    """

    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    tall: bool = False


@dataclass(frozen=True, slots=True)
class Facts:
    """Pairs of a label and a text in a printed document."""

    rows: tuple[Fact, ...]


@dataclass(frozen=True, slots=True)
class Lines:
    """A list of one-line texts of a document; `none` is shown if there are none."""

    lines: tuple[str, ...]
    none: str = ""


@dataclass(frozen=True, slots=True)
class Chart:
    """Chart of one recording's heights over time.

    Attributes:
        recording: number of the recording, from 0.
        caption: what it shows.
    """

    recording: int
    caption: str


@dataclass(frozen=True, slots=True)
class Code:
    """Text of several lines in a fixed-width font."""

    text: str


Block: TypeAlias = Table | Facts | Lines | Chart | Code


@dataclass(frozen=True, slots=True)
class Section:
    """A numbered section of a document."""

    title: str
    blocks: tuple[Block, ...]


def cell_text(cell: Cell) -> str:
    """Returns the text of a table cell."""
    return cell if isinstance(cell, str) else cell.text
