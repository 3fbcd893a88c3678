"""Stores result tables as CSV files that the documentation pages include."""

from __future__ import annotations

import csv
import io
import re
from itertools import groupby
from pathlib import Path

from slosh_base.files import write_text

_BAR = re.compile(r"(?<!\\)\|")


def fill(page: Path, name: str, text: str) -> None:
    """Replaces a page's text between `<!-- table NAME -->` and `<!-- end NAME -->` by a result.

    Args:
        page: the page.
        name: of the result.
        text: Markdown; its tables are written to CSV files.

    Raises:
        OSError: the page cannot be read or written.
        ValueError: the page has no such place.
    """
    start, end = f"<!-- table {name} -->\n", f"<!-- end {name} -->"
    old = page.read_text(encoding="utf-8")
    if old.count(start) != 1 or old.count(end) != 1:
        raise ValueError(f"{page}: needs {start.strip()!r} and {end!r} once each")
    head, rest = old.split(start)
    shown = with_files(page, name, text.strip("\n"))
    write_text(page, f"{head}{start}\n{shown}\n\n{end}{rest.split(end)[1]}")


def with_files(page: Path, name: str, text: str) -> str:
    """Moves each Markdown table of a text to a CSV file, and includes that file instead.

    Args:
        page: the page that shows the text.
        name: of the tables.
        text: Markdown.

    Returns:
        The text for the page.
    """
    folder = page.parent if page.parent.name == "results" else page.parent / "results"
    stem = re.sub(r"\W+", "_", f"{page.stem} {name}".lower()).strip("_")
    parts: list[str] = []
    count = 0
    for is_table, lines in groupby(text.splitlines(), lambda line: line.startswith("|")):
        if not is_table:
            parts += lines
            continue
        count += 1
        path = folder / "tables" / f"{stem}{f'_{count}' if count > 1 else ''}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, as_csv(list(lines)))
        shown = path.relative_to(page.parent).as_posix()
        parts += ["```{csv-table}", f":file: {shown}", ":header-rows: 1", "```"]
    return "\n".join(parts) + ("\n" if text.endswith("\n") else "")


def as_csv(lines: list[str]) -> str:
    """Converts the rows of a Markdown table to CSV."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    for number, line in enumerate(lines):
        if number != 1:  # the line between head and rows
            cells = _BAR.split(line.strip().removeprefix("|").removesuffix("|"))
            writer.writerow([cell.strip().replace("\\|", "|") for cell in cells])
    return table.getvalue()
