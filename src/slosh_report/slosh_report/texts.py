"""Texts of a document, with numbers that know their place in its data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

from slosh_report.page.units import DASH, shown


@dataclass(frozen=True, slots=True)
class Number:
    """A number that is shown rounded.

    Attributes:
        value: in SI units; None or NaN: unknown.
        unit: in which it is shown, one of UNITS; the text around it names it.
        digits: decimals; None: the unit's own.
        prefix: sign before the number, such as "≥ ".
        path: JSON pointer of it in the document's data; empty: it is not there.
        said: its text, if it is not rounded by its unit.
    """

    value: float | None
    unit: str = ""
    digits: int | None = None
    prefix: str = ""
    path: str = ""
    said: str = ""

    @property
    def text(self) -> str:
        """The number as it is shown, with its prefix."""
        return self.said or self.prefix + shown(self.value, self.unit, self.digits)


@dataclass(frozen=True, slots=True)
class Mark:
    """A part of a text that looks different.

    Attributes:
        text: the part.
        kind: "b", "code", "ins" and classes of the style sheet, parted by blanks.
        title: what a pointer over it shows.
        link: where it leads; empty: nowhere.
    """

    text: Text
    kind: str = ""
    title: str = ""
    link: str = ""


@dataclass(frozen=True, slots=True)
class Bars:
    """Horizontal bars in a cell of a table: value, full length and class of each."""

    bars: tuple[tuple[float | None, float, str], ...]


Text: TypeAlias = "str | Number | Mark | Bars | tuple[Text, ...]"


def words(text: Text) -> str:
    """Returns a text without its marks."""
    if isinstance(text, str):
        return text
    if isinstance(text, Number):
        return text.text
    if isinstance(text, Mark):
        return words(text.text)
    return "".join(map(words, text)) if isinstance(text, tuple) else ""


def joined(parts: Iterable[Text], between: str) -> Text:
    """Joins texts by a text between them."""
    found: list[Text] = []
    for part in parts:
        found += [between, part] if found else [part]
    return tuple(found)


@dataclass(frozen=True, slots=True)
class Place:
    """A place in a document's data, which knows its JSON pointer (RFC 6901)."""

    data: Any
    path: str = ""

    def __getitem__(self, key: str | int) -> Place:
        step = str(key).replace("~", "~0").replace("/", "~1")
        return Place(self.data[key], f"{self.path}/{step}")

    def __iter__(self) -> Iterator[Place]:
        return (self[index] for index in range(len(self.data)))

    @property
    def index(self) -> int:
        """Its index in the list that it is in."""
        return int(self.path.rpartition("/")[2])

    def number(self, key: str | int, unit: str = "", digits: int | None = None) -> Number:
        """Returns the number of a key, in the unit in which it is shown."""
        there = self[key]
        return Number(there.data, unit, digits, path=there.path)

    def exact(self, key: str | int, digits: int | None = None) -> Number:
        """Returns a number of unknown unit, with all or some of its digits."""
        value = self.data[key]
        text = DASH if value is None else repr(value) if digits is None else f"{value:.{digits}g}"
        return self.said(key, text.replace("-", "−"))

    def said(self, key: str | int, text: str) -> Number:
        """Returns the number of a key with a text of its own."""
        there = self[key]
        return Number(there.data, path=there.path, said=text)
