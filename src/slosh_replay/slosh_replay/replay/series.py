"""Stores the series of a replay on disk, one row for each image.

A day's recording needs no more memory than a minute's.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from slosh_base.files import naming

BLOCK = 65_536
"""Rows that are in memory at once."""

Table = TypeVar("Table", bound=tuple[Any, ...])


def row_type(models: int) -> np.dtype[np.void]:
    """Returns the NumPy data type of a row, which describes one image.

    Fields: stamp [ns]; measured height [m] and its azimuth [rad], NaN where there is none; flags
    of FreeSurface.msg; heights of the models at the image [m] and the azimuth of the last of them
    [rad], NaN where there is no estimate; usable: whether the estimates come from a known state;
    motion: number of the motion, -1 between two.
    """
    return np.dtype(
        [
            ("stamp", np.int64),
            ("measured", np.float64),
            ("azimuth", np.float64),
            ("flags", np.int64),
            ("heights", np.float64, (models,)),
            ("model_azimuth", np.float64),
            ("usable", np.bool_),
            ("motion", np.int32),
        ]
    )


class Series:
    """Rows on disk in order of arrival; a context manager that deletes its file.

    Args:
        models: number of models.
        block: rows that `blocks` gives at once.
    """

    def __init__(self, models: int, block: int = BLOCK) -> None:
        self.dtype = row_type(models)
        self._block = block
        self._file = tempfile.TemporaryFile(prefix="slosh-")  # noqa: SIM115 - closed by close()
        self._place = Path(tempfile.gettempdir())  # the file itself has no name
        self._count = 0

    def __enter__(self) -> Series:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return self._count

    def append(self, rows: NDArray[np.void]) -> None:
        """Appends rows (one per image) to the file."""
        with naming(self._place):
            self._file.seek(0, 2)
            self._file.write(rows.tobytes())
        self._count += len(rows)

    def blocks(self) -> Iterator[NDArray[np.void]]:
        """Yields all rows in blocks of limited size, in order."""
        for start in range(0, self._count, self._block):
            yield self.read(start, min(start + self._block, self._count))

    def read(self, start: int, end: int) -> NDArray[np.void]:
        """Returns the rows from `start` to `end` (exclusive)."""
        with naming(self._place):
            self._file.seek(start * self.dtype.itemsize)
            content = self._file.read((end - start) * self.dtype.itemsize)
        return np.frombuffer(content, dtype=self.dtype)

    def replace(self, start: int, rows: NDArray[np.void]) -> None:
        """Overwrites stored rows, beginning with the row number `start`."""
        with naming(self._place):
            self._file.seek(start * self.dtype.itemsize)
            self._file.write(rows.tobytes())

    def close(self) -> None:
        """Closes and deletes the temporary file of the series."""
        with suppress(OSError):  # what it has not written yet is not needed
            self._file.close()


def chosen(table: Table, rows: NDArray[Any]) -> Table:
    """Returns the selected rows of a table of arrays.

    Args:
        table: named tuple of arrays of one length; a column may be None.
        rows: indices or a mask.
    """
    make: Any = type(table)
    found: Table = make(*(None if column is None else column[rows] for column in table))
    return found


def joined(tables: Sequence[Table]) -> Table:
    """Concatenates tables column by column; a column is None in all of them or in none."""
    make: Any = type(tables[0])
    found: Table = make(
        *(
            None if columns[0] is None else np.concatenate(columns)
            for columns in zip(*tables, strict=True)
        )
    )
    return found
