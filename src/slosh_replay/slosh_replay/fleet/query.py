"""Queries the fleet store's table of motions with SQL."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_replay.fleet.store import FleetStore

TABLE: Final = "motions"
HOW_TO_GET: Final = "DuckDB is not installed (pip install -r requirements/fleet.txt)"
_PARTS: Final = {
    "once": "SELECT {columns} FROM {source}",
    # A motion that is in several bags counts once.
    "doubtful": """SELECT {columns} FROM {source}
QUALIFY row_number() OVER (PARTITION BY digest ORDER BY bag) = 1""",
}
"""Queries of the parts of a store, by their names in Parted."""
_FILES: Final = "read_parquet(?, hive_partitioning = true, hive_types_autocast = false)"


class Result(NamedTuple):
    """Result of a query: names of the columns, and rows of Python values."""

    names: tuple[str, ...]
    rows: Sequence[tuple[Any, ...]]


class MotionTable:
    """The table `motions` of a store in DuckDB; use it as a context manager.

    Its queries read nothing else: no files, no network.

    Args:
        store: the store.
        loaded: columns that are loaded at once, for many queries; empty: all are read anew.

    Raises:
        SloshBagError: DuckDB is not installed, or the store is empty.
    """

    def __init__(self, store: FleetStore, *, loaded: Sequence[str] = ()) -> None:
        try:
            self._duckdb = importlib.import_module("duckdb")
        except ImportError:
            raise SloshBagError(HOW_TO_GET) from None
        parts = {name: part for name, part in store.parted()._asdict().items() if part}
        self._connection = self._duckdb.connect()
        values: list[Any] = []
        sources = {name: f"stored_{name}" for name in parts}
        if loaded and store.is_disk:
            # In half the time; a view could not do so, since later queries read no files.
            sources = dict.fromkeys(parts, _FILES)
            values = [part.files for part in parts.values()]
        else:
            for name, part in parts.items():
                self._connection.register(sources[name], part)
        kind, columns = ("TABLE", ", ".join(loaded)) if loaded else ("VIEW", "*")
        rows = " UNION ALL ".join(
            f"({_PARTS[name].format(columns=columns, source=sources[name])})" for name in parts
        )
        self.query(f"CREATE TEMP {kind} {TABLE} AS {rows}", values)
        self.query("SET enable_external_access = false")
        self.query("SET lock_configuration = true")

    def __enter__(self) -> MotionTable:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def query(self, sql: str, values: Sequence[Any] = ()) -> Result:
        """Runs a query in DuckDB's SQL dialect and returns its rows.

        Args:
            sql: the statement.
            values: of its parameters ?.

        Raises:
            SloshBagError: the query is wrong; one line.
        """
        try:
            found = self._connection.execute(sql, list(values))
            if found is None:
                raise SloshBagError("query: the statement is empty")
            names = tuple(column[0] for column in found.description or ())
            return Result(names, found.fetchall())
        except self._duckdb.Error as error:
            first = str(error).strip().splitlines()[0]
            raise SloshBagError(f"query: {first}") from None


def query(store: FleetStore, sql: str) -> Result:
    """Runs one SQL query on the table `motions` of a store.

    >>> query(FleetStore("store"), "SELECT cell, count(*) FROM motions GROUP BY cell").names
    ('cell', 'count_star()')

    Raises:
        SloshBagError: DuckDB is not installed, the store is empty, or the query is wrong.
    """
    with MotionTable(store) as table:
        return table.query(sql)
