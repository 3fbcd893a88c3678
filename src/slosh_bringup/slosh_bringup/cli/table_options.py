"""Options that describe the format of tables, for all commands that read them."""

from __future__ import annotations

import argparse
import sys

from slosh_base.files.plain_text import plain_line
from slosh_bringup.errors import SloshBringupError
from slosh_motion.tables.columns import SEPARATORS, TIME_UNITS, TableOptions


def add_table_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options --columns, --time-unit, --decimal and --separator."""
    group = parser.add_argument_group("format of the tables (default: detected)")
    group.add_argument(
        "--columns", action="append", default=[], metavar="NAME=COLUMN,…",
        help="columns to read, by their names or numbers in the table, e.g. t=Time,ax=acc_x; "
        "other columns are ignored (default: detected)",
    )  # fmt: skip
    group.add_argument(
        "--time-unit",
        choices=list(TIME_UNITS),
        help="unit of the table's time column (default: detected)",
    )
    group.add_argument(
        "--decimal", choices=[".", ","], metavar="CHARACTER",
        help="decimal separator of the table: . or , (default: detected)",
    )  # fmt: skip
    group.add_argument(
        "--separator", choices=[",", ";", "|", "tab", "space"], metavar="CHARACTER",
        help="column separator of the table: , ; | tab or space (default: detected)",
    )  # fmt: skip


def table_options(arguments: argparse.Namespace) -> TableOptions:
    """Returns the table format set by the options; prints assumptions about it on standard error.

    Raises:
        SloshBringupError: --columns is no NAME=COLUMN.
        SloshBagError: options that exclude each other.
    """
    columns: dict[str, str] = {}
    for pair in ",".join(arguments.columns).split(",") if arguments.columns else []:
        name, equals, given = (part.strip() for part in pair.partition("="))
        if not (name and equals and given) or name in columns:
            raise SloshBringupError(
                f"--columns {pair}: must be NAME=COLUMN, such as t=Time,ax=acc_x; each NAME once"
            )
        columns[name] = given
    separator = None if arguments.separator is None else SEPARATORS[arguments.separator]

    def note(line: str) -> None:
        print(plain_line(f"slosh {arguments.command}: note: {line}"), file=sys.stderr)

    return TableOptions(columns, arguments.time_unit, arguments.decimal, separator, note)
