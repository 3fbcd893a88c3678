"""A command's result as one document, which is shown as HTML, text, JSON and PDF."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

from slosh_base.types import Array
from slosh_report.page.frame import Frame
from slosh_report.page.series import time_ends
from slosh_report.page.svg import NARROW, WIDE
from slosh_report.texts import Mark, Text

ROWS = 100
"""Most rows of a table or list on a page; the JSON document holds them all."""
Size: TypeAlias = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A text of its own, if there is one; its kind is a class of the style sheet: "explain"."""

    text: Text
    kind: str = ""


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading below a section's own."""

    text: Text


@dataclass(frozen=True, slots=True)
class Facts:
    """Pairs of a label and a text."""

    rows: tuple[tuple[Text, Text], ...]


@dataclass(frozen=True, slots=True)
class Lines:
    """A list of one-line texts; if there are none, `none` is shown, or nothing."""

    lines: tuple[Text, ...]
    none: str = ""
    kind: str = "lines"


@dataclass(frozen=True, slots=True)
class Code:
    """Text of several lines in a fixed-width font."""

    text: Text


@dataclass(frozen=True, slots=True)
class Notice:
    """What must be read first: a verdict or problems.

    Attributes:
        kind: "passed", "failed", "open" or "warning".
        title: a few words.
        lines: sentences.
        listed: whether they are a list.
    """

    kind: str
    title: Text
    lines: tuple[Text, ...] = ()
    listed: bool = False


@dataclass(frozen=True, slots=True)
class KeyFigure:
    """A large number at the top: label, number, unit, and a few words below."""

    label: str
    value: Text
    unit: str = ""
    note: Text = ""


@dataclass(frozen=True, slots=True)
class KeyFigures:
    """The large numbers at the top."""

    figures: tuple[KeyFigure, ...]


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    Attributes:
        head: its heading, with the unit.
        cell: from a row's content to its cell.
        kind: "n": numbers; "name", "verdict", "bars", "code".
        group: heading over this and the neighbouring columns of the same group.
        width: share of the table's width on paper, relative to the other columns.
        only: "page" or "text", if it is shown there alone.
    """

    head: Text
    cell: Callable[[Any], Text]
    kind: str = ""
    group: str = ""
    width: float = 10.0
    only: str = ""


def numbers(
    head: Text, key: str, unit: str = "", digits: int | None = None, group: str = ""
) -> Column:
    """Returns a column of numbers of a key of rows that are places in the data."""
    return Column(head, lambda row: row.number(key, unit, digits), "n", group)


@dataclass(frozen=True, slots=True)
class Table:
    """A table.

    Attributes:
        caption: what it shows.
        columns: from left to right; the first one names the row, if it is no number.
        rows: cells, as many as columns in each.
        kind: classes of the style sheet; "tall": rows have room to write in by hand.
        marks: class of each row; empty: none has one.
        seen: whether the caption is shown; else it is for screen readers alone.
        most: rows that are shown at most.
        sorts: whether a reader can sort it by its headings.
    """

    caption: Text
    columns: tuple[Column, ...]
    rows: tuple[tuple[Text, ...], ...]
    kind: str = ""
    marks: tuple[str, ...] = ()
    seen: bool = True
    most: int = ROWS
    sorts: bool = False

    def shown(self, where: str) -> Table:
        """Returns the table with the columns that are shown on a "page" or in a "text"."""
        kept = [index for index, column in enumerate(self.columns) if column.only in ("", where)]
        rows = tuple(tuple(row[index] for index in kept) for row in self.rows)
        return replace(self, columns=tuple(self.columns[index] for index in kept), rows=rows)

    @property
    def heads(self) -> tuple[tuple[str, tuple[Column, ...]], ...]:
        """Headings of groups, each with its columns; of a column without a group, empty."""
        found: list[tuple[str, tuple[Column, ...]]] = []
        for column in self.columns:
            if found and column.group and found[-1][0] == column.group:
                found[-1] = (column.group, (*found[-1][1], column))
            else:
                found.append((column.group, (column,)))
        return tuple(found)


def table(caption: Text, columns: Iterable[Column], rows: Iterable[Any], **more: Any) -> Table:
    """Makes a table of the contents of its rows; `more` are further attributes."""
    columns = tuple(columns)
    cells = tuple(tuple(column.cell(row) for column in columns) for row in rows)
    return Table(caption, columns, cells, **more)


def plain_table(rows: Iterable[Sequence[Text]], sides: str, heads: Sequence[str] = ()) -> Table:
    """Makes a table of texts for a terminal: ">" is a column of numbers, "<" another one."""
    columns = tuple(
        Column(head, str, "n" if side == ">" else "")
        for head, side in zip(heads or [""] * len(sides), sides, strict=True)
    )
    return Table("", columns, tuple(map(tuple, rows)))


@dataclass(frozen=True, slots=True)
class Line:
    """A line of a chart: (N,) times [s] and values in SI units, NaN where there are none.

    Its kind is "measured", "thin", "linear", "nonlinear" or "plain", which gives colour and
    dashes; an empty name is not in the legend.
    """

    name: Text
    kind: str
    t: Array
    values: Array


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart over time, or whatever its function draws.

    Attributes:
        name: unique in the document.
        caption: what it shows, before the legend of its lines.
        seen: what it shows, for screen readers.
        lines: from back to front.
        label: of the vertical axis, with the unit.
        scale: SI → the axis' unit.
        draw: draws into the axes whatever else there is; of a chart that is not over time, all.
        keys: entries of the legend for that.
        ends: of the time axis [s]; None: of the first line.
        top: upper end of the vertical axis [axis' unit], which begins at 0; None: by the lines.
        sizes: one, or a wide and a narrow one [in].
        live: whether a pointer over it shows its values, and a closer look.
        limit: that a closer look shows [m]; None: none.
        projection: "polar", or empty.
    """

    name: str
    caption: Text
    seen: str
    lines: tuple[Line, ...] = ()
    label: str = "height [mm]"
    scale: float = 1e3
    draw: Callable[[Any], None] | None = None
    keys: tuple[Text, ...] = ()
    ends: tuple[float, float] | None = None
    top: float | None = None
    sizes: tuple[Size, ...] = (WIDE, NARROW)
    live: bool = False
    limit: float | None = None
    projection: str = ""

    @property
    def time_ends(self) -> tuple[float, float]:
        """Start and end of the time axis [s]."""
        return time_ends(self.lines[0].t) if self.ends is None else self.ends

    @property
    def legend(self) -> tuple[Text, ...]:
        """The named lines' entries and the further ones, after the caption."""
        own = (Mark(line.name, f"key {line.kind}") for line in self.lines if line.name)
        return (*((self.caption,) if self.caption else ()), *own, *self.keys)


@dataclass(frozen=True, slots=True)
class Figure:
    """One or several charts in a frame."""

    charts: tuple[Chart, ...]


@dataclass(frozen=True, slots=True)
class Picture:
    """A camera image with its caption, and a letter if charts mark its moment."""

    frame: Frame
    letter: str = ""


@dataclass(frozen=True, slots=True)
class Group:
    """Blocks beside each other, by a class of the style sheet; or folded below a summary."""

    blocks: tuple[Block, ...]
    kind: str = ""
    summary: str = ""


Block: TypeAlias = (
    "Paragraph | Heading | Facts | Lines | Code | Notice | KeyFigures | Table | Figure | Picture"
    " | Group"
)


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a document.

    Attributes:
        title: its heading.
        blocks: what it holds.
        name: its anchor; empty: its number.
        short: its name in the list of sections; empty: its title.
        kind: a class of the style sheet.
    """

    title: Text
    blocks: tuple[Block, ...]
    name: str = ""
    short: str = ""
    kind: str = ""


@dataclass(frozen=True, slots=True)
class Document:
    """A command's result.

    Attributes:
        title: its main statement.
        head: blocks below the title.
        sections: in order; those without blocks are left out.
        data: numbers and names in SI units, as JSON has them; each Number points into it.
        brief: blocks of the short text for the terminal.
        before: line above the title.
        contents: whether sections are listed at the top.
        numbered: whether sections are numbered.
        mark: element of the head by which the page is known again.
    """

    title: str
    head: tuple[Block, ...] = ()
    sections: tuple[Section, ...] = ()
    data: Mapping[str, Any] | list[Any] = field(default_factory=dict)
    brief: tuple[Block, ...] = ()
    before: str = ""
    contents: bool = False
    numbered: bool = False
    mark: str = ""

    @property
    def shown(self) -> tuple[Section, ...]:
        """The sections that hold something."""
        return tuple(section for section in self.sections if section.blocks)


def explain(*text: Text) -> Paragraph:
    """Returns a paragraph that explains what is above it."""
    return Paragraph(text, "explain")


def changed_lines(base: str, new: str) -> Code:
    """Returns the new text as code; lines that the base does not have are marked."""
    import difflib

    lines = [
        line for line in difflib.ndiff(base.splitlines(), new.splitlines()) if line[0] in "+ "
    ]
    return Code(
        tuple((Mark(line[2:], "ins") if line[0] == "+" else line[2:], "\n") for line in lines)
    )
