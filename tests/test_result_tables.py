"""Tests that each CSV file of results is shown by one page."""

import csv
import re
from pathlib import Path

import pytest
from coverage_table import table
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


# The table of `make coverage` adds up files to packages, and packages to a last line.


def entry(lines, ran):
    return {"summary": {"num_statements": lines, "covered_lines": ran}}


def test_the_table_has_each_package_once_and_all_of_them_last():
    text = table(
        {
            "src/slosh_model/slosh_model/b.py": entry(30, 15),
            "src/slosh_bag/slosh_bag/a.py": entry(10, 10),
            "src/slosh_model/slosh_model/__init__.py": entry(0, 0),
            "src/slosh_model/slosh_model/c.py": entry(10, 5),
            "/tmp/poisoned/slosh_model/c.py": entry(10, 10),
        }
    )
    assert text.splitlines()[2:] == [
        "| slosh_bag | 10 | 10 | 100.0 % |",
        "| slosh_model | 40 | 20 | 50.0 % |",
        "| all | 50 | 30 | 60.0 % |",
    ]
