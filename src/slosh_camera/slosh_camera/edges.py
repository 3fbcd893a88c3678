"""Rows of grey-level edges to a fraction of a pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GrayImage = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

_HALF = 4
_MIN_STEP = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class EdgeRows:
    """Edges by column.

    Attributes:
        row: (columns,) row of the edge, the centre of the first row is 0.
        width: (columns,) height of the grey step over its steepest slope [px].
    """

    row: FloatArray
    width: FloatArray


def refine(gray: GrayImage, rows: IntArray) -> EdgeRows:
    """Rows at which the grey level crosses the middle of a step.

    The levels on either side are taken beside the edge itself, so that neither the threshold
    that found it nor uneven light moves it; the crossing is interpolated linearly.

    Args:
        gray: (rows, columns), darker below the edge.
        rows: (columns,) first row below the edge.

    Returns:
        The edges; where there is no clear step the edge stays half a row above `rows`.
    """
    offsets = np.arange(-_HALF, _HALF + 1)[:, np.newaxis]
    index = np.clip(rows + offsets, 0, gray.shape[0] - 1)
    samples = np.take_along_axis(gray, index, axis=0).astype(np.float64)
    high = 0.5 * (samples[0] + samples[1])
    low = 0.5 * (samples[-1] + samples[-2])
    level = 0.5 * (high + low)
    crosses = (samples[:-1] >= level) & (samples[1:] < level)
    # Of several crossings take the one nearest to where the edge was found.
    distance = np.abs(np.arange(-_HALF, _HALF)[:, np.newaxis] + 0.5)
    nearest = np.argmin(np.where(crosses, distance, np.inf), axis=0)
    column = np.arange(rows.size)
    above, below = samples[nearest, column], samples[nearest + 1, column]
    clear = crosses[nearest, column] & (high - low >= _MIN_STEP)
    fraction = (above - level) / np.where(clear, above - below, 1.0)
    row = np.where(clear, rows - _HALF + nearest + fraction, rows - 0.5)
    slope = np.max(samples[:-1] - samples[1:], axis=0)
    width = np.where(clear, (high - low) / np.where(clear, slope, 1.0), 2.0 * _HALF)
    # At the image's edge the step is cut off: the line may be anywhere above.
    row = np.where(rows == 0, 0.0, row)
    return EdgeRows(np.maximum(row, 0.0), np.maximum(width, 1.0))
