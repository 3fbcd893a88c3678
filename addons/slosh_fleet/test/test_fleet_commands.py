"""Tests `slosh ingest` and `slosh query`: unique rows, one-line errors, and the page."""

import importlib
import json
import os
import re
import sys
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import pytest

from slosh_bringup.cli.main import main
from slosh_bringup.many_files import KILLED, map_files
from slosh_fleet.motions.motion_row import COLUMNS, MotionRow
from slosh_fleet.motions.motions import motions_of
from slosh_fleet.motions.store import FleetStore
from slosh_testing.bags import copied

BAGS = Path(__file__).parents[3] / "bags"
DAY_NS = 86_400 * 10**9
needs_duckdb = pytest.mark.usefixtures("duckdb")


@pytest.fixture
def duckdb():
    return pytest.importorskip("duckdb", reason="DuckDB is not installed (requirements/fleet.txt)")


def test_bags_are_ingested_once_and_a_wrong_one_costs_no_other(tmp_path, capsys):
    line = ["ingest", str(BAGS / "l"), str(tmp_path / "absent"), str(BAGS / "l3")]
    line += ["--store", str(tmp_path / "store")]
    assert main(line) == 2
    told = capsys.readouterr()
    (error,) = (line for line in told.err.splitlines() if line.startswith("slosh ingest:"))
    assert error.endswith("absent: no such file or folder")
    assert told.out.splitlines()[-1] == f"2 motions of 2 bags in {tmp_path / 'store'}"
    before = sorted((tmp_path / "store").rglob("*"))
    assert main(line) == 2
    assert capsys.readouterr().out.count("stored before") == 2
    assert sorted((tmp_path / "store").rglob("*")) == before


@pytest.fixture(scope="module")
def months(tmp_path_factory):
    """A store with three months of motions: two containers, one with falling frequency."""
    place = tmp_path_factory.mktemp("fleet") / "store"
    begin = int(datetime(2026, 1, 10, 9, tzinfo=UTC).timestamp()) * 10**9
    numbers = {column.name: 0.01 for column in COLUMNS if column.type == "float"}
    whole = {column.name: 0 for column in COLUMNS if column.type == "int"}
    rows = []
    for number in range(90):
        own = {
            "cell": "line_1", "digest": f"{number:064x}", "opening": f"{number:x}",
            "bag": f"/bags/<{number}>",
            "container": "cylinder", "model_digest": "ab" if number % 3 else "cd",
            "begin_ns": begin + number * DAY_NS // 2, "natural_frequency": 19.0 - 0.01 * number,
            "measured_limit": 0.02, "estimated_limit": 0.005 if number == 20 else 0.02,
            "events": int(number == 7),
            "nonlinear_peak": 0.03 if number == 7 else 0.01,
        }  # fmt: skip
        rows.append(MotionRow(**{**numbers, **whole, **own}))
    FleetStore(str(place)).add(rows)
    return place


@needs_duckdb
def test_a_query_prints_a_table_or_json(months, capsys):
    sql = (
        "SELECT month, count(*) AS n, sum(events) AS e FROM motions GROUP BY month ORDER BY month"
    )
    line = ["query", sql, "--store", str(months)]
    assert main(line) == 0
    assert capsys.readouterr().out.splitlines() == [
        "month    n   e", "2026-01  44  1", "2026-02  46  0"
    ]  # fmt: skip
    assert main([*line, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)[0] == {"month": "2026-01", "n": 44, "e": 1}


@needs_duckdb
def test_values_of_all_kinds_are_printed(months, capsys):
    sql = "SELECT min(begin) AS b, NULL AS n, 0.1 + 0.2 AS f, 'nan'::DOUBLE AS x FROM motions"
    assert main(["query", sql, "--store", str(months)]) == 0
    assert capsys.readouterr().out.split()[4:] == [
        "2026-01-10",
        "09:00:00+00:00",
        "-",
        "0.3",
        "nan",
    ]
    assert main(["query", sql, "--store", str(months), "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)
    assert (found["b"], found["n"], found["x"]) == ("2026-01-10T09:00:00+00:00", None, None)


@needs_duckdb
@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["SELEC 1"], "query: Parser Error: syntax error"),
        ([], "give an SQL statement, --page FILE.html or --list"),
        (["SELECT 1", "--store", "nowhere://a"], "nowhere://a: Protocol not known"),
    ],
)
def test_what_is_wrong_is_one_line(months, capsys, given, told):
    assert main(["query", "--store", str(months), *given]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert told in said.err


def test_the_columns_are_listed_with_units(capsys):
    assert main(["query", "--list", "--json"]) == 0
    told = {row["column"]: row["unit"] for row in json.loads(capsys.readouterr().out)}
    assert told["measured_peak"] == "m"
    assert told["natural_frequency"] == "rad/s"
    assert {"month", "begin"} <= told.keys()


@needs_duckdb
def test_the_page_shows_trends_shifts_and_the_worst_motions(months, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert main(["query", "--store", str(months), "--page", str(page)]) == 0
    text = page.read_text()
    assert "90 motions of 1 cells" in text
    assert text.count("<svg") == 6
    assert not re.search(r"(?:src|href)=\"http", text)
    worst = text[text.index('id="worst"') :]
    assert re.search(r"2026-01-13 21:00:00.*?10\.00.*?30\.00.*?20\.00", worst, re.S)
    assert worst.index("/bags/&lt;20&gt;") < worst.index("/bags/&lt;7&gt;")
    assert worst.index("/bags/&lt;7&gt;") < worst.index("/bags/&lt;0&gt;")
    assert 'href="file:///bags/%3C7%3E"' in worst
    assert "<7>" not in text
    containers = text[text.index('id="containers"') : text.index('id="months"')]
    # The frequency falls by 0.01 rad/s a motion: from the 2nd of one model to the 90th.
    assert re.findall(r"(ab|cd)</code>.*?([+-]\d\.\d{3})<", containers, re.S) == [
        ("ab", "-0.880"), ("cd", "-0.870")
    ]  # fmt: skip
    trends = text[text.index('id="trends"') : text.index('id="containers"')]
    assert "line_1, cylinder, model cd" in trends
    months_table = text[text.index('id="months"') : text.index('id="shifts"')]
    assert months_table.count("<tr>") == 5  # heading, and two containers in each of two months
    shifts = text[text.index('id="shifts"') : text.index('id="worst"')]
    assert re.findall(r">(\d+) to (\d+)<", shifts) == [("8", "16"), ("16", "24")]


@needs_duckdb
def test_a_page_without_an_observer_says_so(tmp_path):
    store, page = tmp_path / "store", tmp_path / "page.html"
    bag = copied(BAGS / "l", tmp_path / "bag", lambda m: not m.topic.endswith("/fused_estimate"))
    main(["ingest", str(bag), "--store", str(store)])
    assert main(["query", "--store", str(store), "--page", str(page)]) == 0
    assert "natural frequency [rad/s]: not known of any motion" in page.read_text()


FIVE = ("l", "l3", "c", "c3", "e")
WORK = """
import os
import signal
from pathlib import Path

from slosh_fleet.ingest_command import ingest_task


def ingest_or_die(store, bag):
    if bag.name == "c":
        os.kill(os.getpid(), signal.SIGKILL)
    return ingest_task(store, bag)
"""


def told_of(capsys):
    """What a run has printed of each bag, by the bag's name."""
    lines = capsys.readouterr().out.splitlines()[:-1]
    return {line.partition(":")[0].rpartition("/")[2]: line.rpartition(", ")[2] for line in lines}


def test_an_interrupted_ingest_goes_on_with_the_rest(tmp_path, capsys, monkeypatch):
    line = [
        "ingest",
        *(str(BAGS / name) for name in FIVE),
        "--store",
        str(tmp_path),
        "--jobs",
        "1",
    ]
    read = []

    def reads(path):
        if len(read) == 2:
            raise KeyboardInterrupt
        read.append(path.name)
        return motions_of(path)

    monkeypatch.setattr("slosh_fleet.ingest_command.motions_of", reads)
    assert main(line) not in (0, 2)
    assert read == ["l", "l3"]
    capsys.readouterr()
    read.clear()
    monkeypatch.setattr(
        "slosh_fleet.ingest_command.motions_of",
        lambda path: read.append(path.name) or motions_of(path),
    )
    assert main(line) == 0
    assert read == ["c", "c3", "e"]
    assert told_of(capsys) == dict.fromkeys(FIVE, "stored") | dict.fromkeys(
        ("l", "l3"), "stored before"
    )


@pytest.mark.long
def test_a_killed_worker_costs_its_own_bag(tmp_path, monkeypatch, capsys):
    (tmp_path / "fleet_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(tmp_path))
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    monkeypatch.setenv("PYTHONPATH", path.rstrip(os.pathsep))
    work = importlib.import_module("fleet_work")
    store = str(tmp_path / "store")
    bags = [BAGS / name for name in FIVE]
    found = list(map_files(partial(work.ingest_or_die, store), bags, jobs=2))
    del sys.modules["fleet_work"]
    assert {one.item.name: one.error for one in found if one.error} == {"c": KILLED}
    assert len(FleetStore(store).dataset().to_table()) == len(FIVE) - 1
    assert main(["ingest", *map(str, bags), "--store", store, "--jobs", "2"]) == 0
    assert told_of(capsys) == dict.fromkeys(FIVE, "stored before") | {"c": "stored"}
    assert len(FleetStore(store).dataset().to_table()) == len(FIVE)
