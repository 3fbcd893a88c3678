"""Queries the fleet store's table of motions with SQL."""

from __future__ import annotations

import importlib
import os
import threading
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_replay.fleet.store import FleetStore

TABLE: Final = "motions"
HOW_TO_GET: Final = "DuckDB is not installed (pip install -r requirements/fleet.txt)"
_PARTS: Final = {
    "once": "SELECT {columns} FROM {source}",
    # A motion that is in several bags counts once.
    # Of a bag that was cut off, and of the whole one, the longer motion counts.
    "doubtful": """SELECT {columns} FROM (SELECT * FROM {source}
QUALIFY row_number() OVER (PARTITION BY digest ORDER BY opening IS NULL, bag) = 1)
QUALIFY row_number() OVER
(PARTITION BY coalesce(opening, digest) ORDER BY duration DESC, images DESC, bag) = 1""",
}
"""Queries of the parts of a store, by their names in Parted."""
MOST_ROWS, MOST_BYTES = 1_000_000, 500_000_000
"""Rows of a result and the length of its texts, at most."""
LONGEST: Final = 300.0
"""How long a query may take [s]."""
_MEMORY: Final = 0.25
"""Share of this machine's memory that a query may take."""


class Result(NamedTuple):
    """Result of a query: names of the columns, and rows of Python values."""

    names: tuple[str, ...]
    rows: Sequence[tuple[Any, ...]]


class MotionTable:
    """The table `motions` of a store in DuckDB; use it as a context manager.

    Its queries read nothing else: no files, no network.

    Args:
        store: the store; what is damaged in it is left out, and named in its `warnings`.
        loaded: columns that are loaded at once, for many queries; empty: all are read anew.

    Raises:
        SloshBagError: DuckDB is not installed, or the store is empty.
    """

    def __init__(self, store: FleetStore, *, loaded: Sequence[str] = ()) -> None:
        try:
            self._duckdb = importlib.import_module("duckdb")
        except ImportError:
            raise SloshBagError(HOW_TO_GET) from None
        self._wrong = (
            self._duckdb.ParserException, self._duckdb.BinderException,
            self._duckdb.CatalogException, self._duckdb.PermissionException,
        )  # fmt: skip
        self._store, self._loaded = store, tuple(loaded)
        self._connection: Any = None
        self.query("SELECT 1")

    def _open(self) -> Any:
        """Makes the table of the store's files, without those that are known to be damaged."""
        connection = self._duckdb.connect()
        parts = {name: part for name, part in self._store.parted()._asdict().items() if part}
        for name, part in parts.items():
            connection.register(f"stored_{name}", part)
        columns = ", ".join(self._loaded) or "*"
        rows = " UNION ALL ".join(
            f"({_PARTS[name].format(columns=columns, source=f'stored_{name}')})" for name in parts
        )
        connection.execute(f"SET memory_limit = '{_memory() >> 20}MB'")
        connection.execute("SET temp_directory = ''")  # nor may it fill the disk
        connection.execute(f"CREATE TEMP {'TABLE' if self._loaded else 'VIEW'} {TABLE} AS {rows}")
        connection.execute("SET enable_external_access = false")
        connection.execute("SET lock_configuration = true")
        return connection

    def __enter__(self) -> MotionTable:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def _close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def query(self, sql: str, values: Sequence[Any] = ()) -> Result:
        """Runs a query in DuckDB's SQL dialect and returns its rows.

        Args:
            sql: the statement.
            values: of its parameters ?.

        Raises:
            SloshBagError: the query is wrong; one line.
        """
        while True:
            try:
                self._connection = self._connection or self._open()
                timer = threading.Timer(LONGEST, self._connection.interrupt)
                timer.daemon = True
                timer.start()
                try:
                    return self._result(sql, values)
                finally:
                    timer.cancel()
            except (MemoryError, self._duckdb.OutOfMemoryException):
                raise SloshBagError(
                    f"query: takes more than {_memory() / 1e9:.1f} GB of memory; ask for fewer "
                    "rows or groups, or add LIMIT"
                ) from None
            except self._duckdb.InterruptException:
                raise SloshBagError(
                    f"query: takes longer than {LONGEST:g} s; ask for fewer rows, or join the "
                    "table by a condition"
                ) from None
            except self._wrong as error:
                raise _named(error) from None
            except (self._duckdb.Error, OSError, ValueError) as error:
                if isinstance(error, SloshBagError):
                    raise
                if not self._store.leave_out_damaged():
                    raise _named(error) from None
                self._close()  # and open what is left

    def _result(self, sql: str, values: Sequence[Any]) -> Result:
        found = self._connection.execute(sql, list(values))
        if found is None:
            raise SloshBagError("query: the statement is empty")
        names = tuple(column[0] for column in found.description or ())
        rows: list[tuple[Any, ...]] = []
        left = MOST_BYTES
        # One by one: a single row may be as large as all that a query may take.
        while names and (row := found.fetchone()) is not None:
            rows.append(row)
            left -= sum(map(_size, row))
            if len(rows) > MOST_ROWS:
                raise SloshBagError(
                    f"query: the result has more than {MOST_ROWS} rows; ask for fewer, or add "
                    "LIMIT"
                )
            if left < 0:
                raise SloshBagError(
                    f"query: the result has more than {MOST_BYTES // 10**6} MB; ask for fewer "
                    "rows, or add LIMIT"
                )
        return Result(names, rows)


def _named(error: Exception) -> SloshBagError:
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return SloshBagError(f"query: {lines[0]}")


def _size(value: Any) -> int:
    """Returns about how much memory a value takes [bytes]."""
    if isinstance(value, str | bytes):
        return len(value)
    return 8 * len(value) if isinstance(value, list | tuple | dict) else 8


def _memory() -> int:
    """Returns how much memory a query may take [bytes]."""
    return round(_MEMORY * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def query(store: FleetStore, sql: str) -> Result:
    """Runs one SQL query on the table `motions` of a store.

    >>> query(FleetStore("store"), "SELECT cell, count(*) FROM motions GROUP BY cell").names
    ('cell', 'count_star()')

    Raises:
        SloshBagError: DuckDB is not installed, the store is empty, or the query is wrong.
    """
    with MotionTable(store) as table:
        return table.query(sql)
