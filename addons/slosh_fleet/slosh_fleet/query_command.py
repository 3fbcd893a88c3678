"""`slosh query`: SQL over the stored motions of many recordings, or a page about them."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from datetime import date, datetime
from pathlib import Path
from typing import Any

from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.output_names import PAGE, check_ending
from slosh_bringup.errors import SloshBringupError
from slosh_fleet.ingest_command import add_store

EPILOG = """The table is called motions; --list prints its columns. For example
  slosh query "SELECT month, cell, count(*), max(measured_peak) FROM motions GROUP BY ALL"
Needs: pip install -r requirements/fleet.txt"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh query` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument(
        "sql", nargs="?", metavar="SQL", help="SELECT statement on the table motions"
    )
    add_store(parser)
    parser.add_argument(
        "--page", type=Path, metavar="FILE.html",
        help="HTML page to write about all months: frequency, damping and level, events by shift, "
        "worst motions",
    )  # fmt: skip
    parser.add_argument("--list", action="store_true", help="list the columns of the table")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Prints the result of a query, or writes the page about all stored motions."""
    from slosh_fleet.motions.query import query
    from slosh_fleet.motions.store import FleetStore

    if arguments.list:
        _print(*_columns(), as_json=arguments.json)
        return 0
    if arguments.sql is None and arguments.page is None:
        raise SloshBringupError("give an SQL statement, --page FILE.html or --list")
    store = FleetStore(arguments.store)
    check_ending(arguments.page, "a page", PAGE)
    if arguments.page is not None:
        from slosh_fleet.motions.motions_page import fleet_document
        from slosh_report.text import write_document

        write_document(arguments.page, fleet_document(store))
    if arguments.sql is not None:
        _print(*query(store, arguments.sql), as_json=arguments.json)
    for line in store.warnings:
        print(plain_line(f"slosh query: warning: {line}"), file=sys.stderr)
    return 0


def _columns() -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    from slosh_fleet.motions.motion_row import COLUMNS
    from slosh_fleet.motions.store import ADDED

    return ("column", "type", "unit", "meaning"), [*COLUMNS, *ADDED]


def _print(names: Sequence[str], rows: Sequence[Sequence[Any]], *, as_json: bool) -> None:
    if as_json:
        told = [dict(zip(names, map(_plain, row), strict=True)) for row in rows]
        print(json.dumps(told, indent=1, allow_nan=False))
        return
    from slosh_report.text_table import aligned

    for line in aligned([names, *(tuple(map(_text, row)) for row in rows)], "<"):
        print(line)


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    return value.isoformat(" ") if isinstance(value, datetime) else str(value)


def _plain(value: Any) -> Any:
    """Converts a DuckDB value to a JSON value: dates and other types to text, infinity to null."""
    if isinstance(value, float):
        return value if abs(value) < float("inf") else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return value.isoformat() if isinstance(value, date) else str(value)
