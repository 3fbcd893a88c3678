"""Tables of results: CSV files, each shown by a page."""

import csv
import re
from pathlib import Path

import pytest
from result_tables import fill

DOCS = Path(__file__).resolve().parent.parent / "docs"
TABLE = "| a | b |\n|---|--:|\n| 1, 2 | x\\|y |\n"


def test_a_page_shows_its_tables_as_files(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- table x -->\nold\n<!-- end x -->\nafter\n")
    for _ in range(2):
        fill(page, "x", f"Said.\n\n{TABLE}\n{TABLE}")
    tables = tmp_path / "results" / "tables"
    assert sorted(path.name for path in tables.iterdir()) == ["page_x.csv", "page_x_2.csv"]
    assert (tables / "page_x.csv").read_text() == 'a,b\n"1, 2",x|y\n'
    text = page.read_text()
    assert text.startswith("before\n<!-- table x -->\n\nSaid.\n\n```{csv-table}\n")
    assert text.endswith("```\n\n<!-- end x -->\nafter\n")
    assert "old" not in text
    with pytest.raises(ValueError, match="once each"):
        fill(page, "y", TABLE)


def test_each_file_is_shown_once_and_has_whole_rows():
    shown = []
    for page in DOCS.rglob("*.md"):
        names = re.findall(r"^:file: (.+)$", page.read_text(encoding="utf-8"), re.M)
        shown += [(page.parent / name).resolve() for name in names]
    assert sorted(shown) == sorted((DOCS / "results" / "tables").glob("*.csv"))
    for path in shown:
        with path.open(encoding="utf-8", newline="") as file:
            widths = {len(row) for row in csv.reader(file)}
        assert len(widths) == 1, path
