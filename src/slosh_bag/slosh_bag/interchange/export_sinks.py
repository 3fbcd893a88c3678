"""Writes exported rows to CSV and Parquet files, in batches."""

from __future__ import annotations

import csv
import gzip
import importlib
import io
import json
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.export_fields import TEXTS, ColumnField, ValueType, plain_list, unsigned
from slosh_bag.interchange.export_rows import Times, Values
from slosh_base.files import NewFile

LONGEST_BYTES: Final = 1024
"""Longest array of bytes that is written into a cell of a CSV file."""
ROW_GROUP_BYTES: Final = 8 << 20
"""Of messages, in a row group of a Parquet file."""
PARQUET_HINT: Final = "Parquet files need pyarrow: pip install pyarrow; or export to .csv"
_FORMULA: Final = ("=", "+", "-", "@")
_JSON: Final = json.JSONEncoder(ensure_ascii=False)
_ARROW: Final = {
    "bool": "bool_", "string": "string", "wstring": "string", "byte": "uint8", "char": "uint8",
    "octet": "uint8",
    **{name: name for name in (
        "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32",
        "float64",
    )},
}  # fmt: skip


class Sink(Protocol):
    """Interface of a table file that is being written."""

    notes: list[str]

    def write(self, times: Times, values: Values) -> None:
        """Appends rows to the table.

        Args:
            times: the columns of whole nanoseconds, (N,) each.
            values: by leaf the values of N messages: an array (N,), or (N, n) of arrays and lists
                that are equally long, or N values as they were decoded.
        """

    def close(self) -> None:
        """Writes the remaining rows to the file."""

    def keep(self) -> None:
        """Renames the temporary file to its final name, when the export is complete."""

    def discard(self) -> None:
        """Deletes the unfinished temporary file."""


class CsvSink:
    """Writes a CSV file: numbers at full precision, lists as JSON text.

    A text that a spreadsheet would take for a formula has an apostrophe before it.

    Args:
        path: `.csv` or `.csv.gz`.
        times: names of the columns of whole nanoseconds.
        fields: the leaves.
    """

    def __init__(self, path: Path, times: Sequence[str], fields: Sequence[ColumnField]) -> None:
        self.notes: list[str] = []
        self._file = NewFile(path)
        self._fields = fields
        self._too_long: dict[str, int] = {}
        self._marked: dict[str, int] = {}
        self._open = ExitStack()
        binary: Any = self._open.enter_context(self._file.open())
        if path.suffix == ".gz":
            binary = self._open.enter_context(
                gzip.GzipFile(filename="", mode="wb", fileobj=binary, mtime=0)
            )
        text = self._open.enter_context(io.TextIOWrapper(binary, "utf-8", newline=""))
        self._writer = csv.writer(text, lineterminator="\n")
        # Before Python 3.13 a carriage return alone is not quoted, and ends the row for readers.
        self._quoting = csv.writer(text, lineterminator="\n", quoting=csv.QUOTE_NONNUMERIC)
        self._writer.writerow([*times, *(name for leaf in fields for name in leaf.columns)])

    def write(self, times: Times, values: Values) -> None:
        """Appends rows to the CSV file."""
        columns: list[Any] = [column.tolist() for column in times]
        for leaf, column in zip(self._fields, values, strict=True):
            columns += self._cells(leaf, column)
        returns = any(
            "\r" in value
            for leaf, column in zip(self._fields, values, strict=True)
            if leaf.node.base in TEXTS and leaf.shape == "value"
            for value in column
        )
        # The csv module writes floats by repr, to the last bit, and NaN as nan.
        writer = self._quoting if returns else self._writer
        writer.writerows(zip(*columns, strict=True))

    def close(self) -> None:
        """Writes the remaining rows and adds notes about omitted or changed values."""
        self._open.close()
        for name, count in self._too_long.items():
            self.notes.append(
                f"{self._file.path}: {count} cells of {name} are empty: more than "
                f"{LONGEST_BYTES} bytes; a Parquet file can hold them"
            )
        for name, count in self._marked.items():
            self.notes.append(
                f"{self._file.path}: {count} texts of {name} start like a formula and were "
                "prefixed with '; Parquet files keep them unchanged"
            )

    def keep(self) -> None:
        """Renames the temporary file to its final name, when the export is complete."""
        self._file.finish()

    def discard(self) -> None:
        """Deletes the unfinished temporary file."""
        with suppress(OSError):  # where the disk is full, nor does the rest go to it
            self._open.close()
        self._file.discard()

    def _cells(self, leaf: ColumnField, values: Any) -> list[Sequence[Any]]:
        """Formats a field's values as CSV cells, by column."""
        if leaf.shape == "list":
            return [[self._list_cell(leaf, value) for value in values]]
        columns = [plain_list(leaf.node, column) for column in _columns(leaf, values)]
        if leaf.node.base in TEXTS:
            return [self._texts(leaf, column) for column in columns]
        if leaf.node.base == "bool":
            return [["true" if value else "false" for value in column] for column in columns]
        return list(columns)

    def _texts(self, leaf: ColumnField, column: Sequence[str]) -> Sequence[str]:
        """Marks strings that a spreadsheet would run as formulas."""
        marked = [f"'{text}" if _is_formula(text) else text for text in column]
        count = sum(map(str.__ne__, marked, column))
        if count:
            self._marked[leaf.name] = self._marked.get(leaf.name, 0) + count
        return marked

    def _list_cell(self, leaf: ColumnField, value: Any) -> str:
        if leaf.is_bytes and len(value) > LONGEST_BYTES:
            self._too_long[leaf.name] = self._too_long.get(leaf.name, 0) + 1
            return ""
        return _JSON.encode(plain_list(leaf.node, value))


def _is_formula(text: str) -> bool:
    """Whether a spreadsheet might run a cell as a formula, such as =HYPERLINK(…) or @SUM(…)."""
    inner = text.lstrip("\t\r\n")  # which spreadsheets may strip
    if not inner.startswith(_FORMULA):
        return False
    try:
        float(text)
    except ValueError:
        return len(inner) > 1
    return False


def _columns(leaf: ColumnField, values: Any) -> list[Any]:
    """Returns a field's values by column, with one column per array element."""
    if leaf.shape != "spread":
        return [unsigned(leaf.node, values)]
    return list(np.ascontiguousarray(unsigned(leaf.node, np.asarray(values)).T))


class ParquetSink:
    """Writes a Parquet file, which keeps the types of values, lists and bytes.

    Args:
        path: `.parquet`.
        times: names of the columns of whole nanoseconds.
        fields: the leaves.
        facts: kept in the file's metadata.

    Raises:
        SloshBagError: pyarrow is not installed.
    """

    def __init__(
        self,
        path: Path,
        times: Sequence[str],
        fields: Sequence[ColumnField],
        facts: Mapping[str, str],
    ) -> None:
        self.notes: list[str] = []
        self._arrow, parquet = load_pyarrow()
        self._file = NewFile(path)
        self._stream = self._file.open()
        self._fields = fields
        entries = [(name, self._arrow.int64()) for name in times]
        for leaf in fields:
            entries += [(name, self._column_type(leaf)) for name in leaf.columns]
        self._schema = self._arrow.schema(entries, metadata=dict(facts))
        self._writer = parquet.ParquetWriter(self._stream, self._schema, compression="zstd")
        self._batches: list[Any] = []
        self._size = 0

    def write(self, times: Times, values: Values) -> None:
        """Appends rows to the Parquet file."""
        columns: list[Any] = list(times)
        for leaf, column in zip(self._fields, values, strict=True):
            columns += self._cells(leaf, column)
        arrays = [
            self._arrow.array(column, type=field.type)
            for column, field in zip(columns, self._schema, strict=True)
        ]
        batch = self._arrow.record_batch(arrays, schema=self._schema)
        self._batches.append(batch)
        self._size += batch.nbytes
        if self._size >= ROW_GROUP_BYTES:
            self._write_group()

    def close(self) -> None:
        """Writes the remaining rows and closes the file."""
        self._write_group()
        self._writer.close()
        self._stream.close()

    def keep(self) -> None:
        """Renames the temporary file to its final name, when the export is complete."""
        self._file.finish()

    def discard(self) -> None:
        """Deletes the unfinished temporary file."""
        with suppress(OSError, ValueError):  # a full disk, or a writer that is in disorder
            self._writer.close()
        with suppress(OSError):
            self._stream.close()
        self._file.discard()

    def _cells(self, leaf: ColumnField, values: Any) -> list[Any]:
        """Converts a field's values to columns that pyarrow accepts."""
        if leaf.is_bytes:
            return [[bytes(value) for value in values]]
        if leaf.shape != "list":
            return _columns(leaf, values)
        if leaf.is_flat:
            return [list(values)]
        return [[plain_list(leaf.node, value) for value in values]]

    def _write_group(self) -> None:
        if self._batches:
            table = self._arrow.Table.from_batches(self._batches)
            self._writer.write_table(table, row_group_size=max(1, len(table)))
        self._batches, self._size = [], 0

    def _column_type(self, leaf: ColumnField) -> Any:
        if leaf.is_bytes:
            return self._arrow.binary()
        kind = self._node_type(leaf.node)
        return self._arrow.list_(kind) if leaf.shape == "list" else kind

    def _node_type(self, node: ValueType) -> Any:
        if node.base:
            return getattr(self._arrow, _ARROW[node.base])()
        return self._arrow.struct(
            [
                (
                    name,
                    self._arrow.list_(self._node_type(inner))
                    if several
                    else self._node_type(inner),
                )
                for name, inner, several in node.fields
            ]
        )


def load_pyarrow() -> tuple[Any, Any]:
    """Imports pyarrow and pyarrow.parquet when they are first needed.

    Raises:
        SloshBagError: they are not installed.
    """
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise SloshBagError(PARQUET_HINT) from None


def make_sink(
    path: Path, times: Sequence[str], fields: Sequence[ColumnField], facts: Mapping[str, str]
) -> Sink:
    """Creates the table file writer for a path, chosen by the file suffix."""
    if path.suffix == ".parquet":
        return ParquetSink(path, times, fields, facts)
    return CsvSink(path, times, fields)
