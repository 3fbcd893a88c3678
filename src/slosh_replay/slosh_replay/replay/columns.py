"""Tables whose columns are the arrays of a named tuple."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Table = TypeVar("Table", bound=tuple[Any, ...])


def chosen(table: Table, rows: NDArray[Any]) -> Table:
    """Some rows of a table.

    Args:
        table: named tuple of arrays of one length; a column may be None.
        rows: indices or a mask.
    """
    make: Any = type(table)
    found: Table = make(*(None if column is None else column[rows] for column in table))
    return found


def joined(tables: Sequence[Table]) -> Table:
    """Tables one below the other, at least one; a column may be None in all of them."""
    make: Any = type(tables[0])
    found: Table = make(
        *(
            None if columns[0] is None else np.concatenate(columns)
            for columns in zip(*tables, strict=True)
        )
    )
    return found
