"""Stores results as lines of JSON, so that finished cases are not run again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

Row = dict[str, Any]


def read(path: Path) -> dict[str, Row]:
    """Reads the results of a file by test case; ignores an incomplete last line."""
    rows: dict[str, Row] = {}
    if not path.exists():
        return rows
    for line in path.read_text().splitlines():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        rows[row["case"]] = row
    return rows


def add(path: Path, row: Row) -> None:
    """Appends one result to a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(json.dumps(row) + "\n")
