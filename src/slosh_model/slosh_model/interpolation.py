"""Linear interpolation of several columns at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array

Times = NDArray[np.float64] | NDArray[np.int64]


def columns_at(moments: Times, t: Times, columns: Array) -> Array:
    """Interpolates columns of values at other times; beyond the ends the values are constant.

    Args:
        moments: (M,) in any unit.
        t: (N,) rising, in the same unit.
        columns: (N, K).

    Returns:
        (M, K).
    """
    return np.column_stack([np.interp(moments, t, column) for column in columns.T])
