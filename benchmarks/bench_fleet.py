"""Compares a query and the page of 10^6 stored motions with pandas, which reads all of them.

The motions are generated, a thousand to a bag, with copied parts of some. `slosh query` counts
motions, peaks and errors by month and cell; pandas reads the same columns of all files, drops what
is there twice and groups. They take turns in one process; the times are without its start.

    tools/run python benchmarks/bench_fleet.py [--motions 1000000] [--turns 3] [--store DIR]
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from fleet_motions import bags_of_motions
from measuring import need, parsed, timed

from slosh_fleet.motions.motions_page import fleet_document
from slosh_fleet.motions.query import query
from slosh_fleet.motions.store import FleetStore
from slosh_report.page.html import html_page

GOAL_SECONDS = 2.0
"""Longest time of the query and of the page [s]."""
GOAL_RATIO = 1.0
"""Least time of pandas, as a multiple of the query's."""
EACH = 1000
"""Motions in a bag."""
SQL = """SELECT month, cell, count(*), max(measured_peak), avg(sigma_nonlinear), sum(events)
FROM motions GROUP BY month, cell ORDER BY month, cell"""


def filled(place: Path, motions: int) -> FleetStore:
    """Returns the store at a place, filled if it is empty."""
    store = FleetStore(str(place))
    if not any(place.glob("cell=*")):
        for rows in bags_of_motions(motions, -(-motions // EACH)):
            store.add(rows)
    return store


def by_pandas(place: Path) -> Any:
    """Answers the query with pandas."""
    columns = ["digest", "month", "cell", "measured_peak", "sigma_nonlinear", "events"]
    files = sorted(map(str, place.glob("cell=*/month=*/*.parquet")))
    rows = pd.read_parquet(files, columns=columns, partitioning="hive")
    groups = rows.drop_duplicates("digest").groupby(["month", "cell"], observed=True)
    return groups.agg(
        count=("digest", "size"), peak=("measured_peak", "max"),
        error=("sigma_nonlinear", "mean"), events=("events", "sum"),
    )  # fmt: skip


def compare(store: FleetStore, turns: int) -> dict[str, Any]:
    """Returns the median times [s] of the query, the page and pandas.

    Raises:
        RuntimeError: the query and pandas do not agree.
    """
    own = query(store, SQL).rows
    other = by_pandas(Path(store.url))
    if [tuple(row[2:]) for row in own] != [
        (n, peak, row[4], events)
        for row, (n, peak, _, events) in zip(own, other.itertuples(index=False), strict=True)
    ]:
        raise RuntimeError("the query and pandas do not agree")
    ways: dict[str, Callable[[], object]] = {
        "query": lambda: query(store, SQL),
        "page": lambda: html_page(fleet_document(store)),
        "pandas": lambda: by_pandas(Path(store.url)),
    }
    html_page(fleet_document(store))  # loads what draws
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(turns):
        for name, way in ways.items():
            spent[name].append(timed(way))
    found = {f"{name}_s": round(statistics.median(own), 2) for name, own in spent.items()}
    count = sum(row[2] for row in own)
    return {"motions": count, **found, "load": round(os.getloadavg()[0], 1)}


def main() -> int:
    """Prints the result as JSON; returns 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--motions", type=int, default=1_000_000)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--store", type=Path, help="kept folder of the store")
    given = parsed(parser, motions=1000, turns=1)
    need("duckdb", "fleet.txt")
    with tempfile.TemporaryDirectory() as folder:
        store = filled(given.store or Path(folder), given.motions)
        found = compare(store, given.turns)
    ratio = found["pandas_s"] / found["query_s"]
    print(json.dumps({**found, "pandas_to_query": round(ratio, 2), "goal_s": GOAL_SECONDS}))
    met = max(found["query_s"], found["page_s"]) <= GOAL_SECONDS and ratio >= GOAL_RATIO
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
