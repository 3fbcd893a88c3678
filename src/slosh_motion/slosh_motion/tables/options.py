"""Options by which a user describes the format of a table."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from slosh_base.files.errors import SloshFileError
from slosh_motion.tables.units import TIME

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
        time_unit: of the time column: one of `units.TIME`; None: from the heading or the values.
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
        if self.time_unit is not None and self.time_unit not in TIME:
            raise SloshFileError(f"--time-unit {self.time_unit}: must be one of {', '.join(TIME)}")
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
