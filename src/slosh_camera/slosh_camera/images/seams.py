"""Finds where an image is torn: a row at which its upper part is of another moment than the lower.

No lens draws an edge from one row to the next: it blurs it over two or three. Where two moments
meet, what has moved meanwhile ends at one and the same row, as sharply as the pixels allow.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Columns = NDArray[np.intp]

# A step over one row that is at least this part of the image's contrast, and this many times the
# steps above and below it, is no edge that a lens has drawn.
_LEAST, _SHARP = 0.14, 3.5
# So many such pixels in a row, with gaps of at most one, may be a seam's.
_RUN, _GAP = 5, 2
# A line of the liquid that comes so near to them [px] begins or ends the seam, unless it runs
# along with them, to this [px], or to this divided by their number.
_NEAR, _ALONG, _PARALLEL = 2.5, 1.2, 30.0
# Without such a line they are a seam's where there are so many and, in so many rows beside, so
# many times fewer; or where they are longer than this part of what is looked at.
_MANY, _ALONE, _FEWER, _LONG = 10, 8, 4, 0.15
# With such a line, so many, and so many times fewer beside, will do.
_SOME, _SOME_FEWER = 6, 2
# Of the image's contrast, so many percent of the pixels left out at either end; a step at least
# [grey levels].
_PERCENT, _STEP = (1.0, 99.0), 6.0
# Edges of a still image are told by this part of that, as noise may make them sharp or not.
_RATHER = 0.6


class Steps(NamedTuple):
    """Steps from a row to the next that no lens has drawn.

    Attributes:
        rows: (R,) from the window's top.
        sharp: (R, columns) where.
    """

    rows: Columns
    sharp: BoolArray


NO_STEPS = Steps(np.empty(0, np.intp), np.empty((0, 0), np.bool_))


class SeamFinder:
    """Looks for seams in the part of images that shows the container's wall.

    Args:
        window: left, top, right and bottom of that part [px].
        all_lines: whether the lines of the liquid that will be given are all that it has: then a
            seam is told where none of them is near, too.
    """

    def __init__(self, window: tuple[int, int, int, int], *, all_lines: bool = True) -> None:
        self._all_lines = all_lines
        self._left, self._top, right, bottom = window
        self._part = slice(self._top, bottom), slice(self._left, right)
        self._columns = np.arange(self._left, right)
        self._shape = bottom - self._top - 1, right - self._left
        self._known: BoolArray | None = None

    def learn(self, image: Image) -> None:
        """Sharp edges of a still image are none of a seam."""
        known = np.zeros(self._shape, np.uint8)
        known[self._sharp(image, _RATHER)] = 1
        self._known = cv2.dilate(known, np.ones((3, 3), np.uint8)).astype(np.bool_)

    def steps(self, image: Image) -> Steps:
        """Sharp steps of an image (height, width) or (height, width, 3) that may be a seam's.

        None without a still image: the container and what is around it may have edges as sharp.
        """
        if self._known is None:
            return NO_STEPS
        rows, columns = self._sharp(image)
        new = ~self._known[rows, columns]
        rows, columns = rows[new], columns[new]
        sharp = np.zeros(self._shape, np.bool_)
        sharp[rows, columns] = True
        many = np.flatnonzero(np.bincount(rows) >= _RUN)
        return Steps(many, sharp[many])

    def is_torn(self, steps: Steps, *lines: tuple[FloatArray, FloatArray]) -> bool:
        """Whether there is a seam beside the lines of the liquid, given by their places [px]."""
        found = [
            (row, run)
            for row, sharp in zip(steps.rows.tolist(), steps.sharp, strict=True)
            for run in _runs(np.flatnonzero(sharp))
        ]
        curves = [
            np.interp(self._columns, u, v, np.nan, np.nan) - self._top for u, v in lines if u.size
        ]
        return any(self._is_seam(row, run, steps, curves) for row, run in found)

    def _is_seam(self, row: int, run: Columns, steps: Steps, curves: list[FloatArray]) -> bool:
        """Whether a run of sharp steps below a row is a seam's."""
        touched = False
        for curve in curves:
            line = curve[run]
            line = line[np.isfinite(line)]
            if line.size and np.min(np.abs(line - row - 0.5)) < _NEAR:
                if np.ptp(line) < min(_ALONG, _PARALLEL / run.size):
                    return False
                touched = True
        away = np.abs(steps.rows - row)
        beside = np.count_nonzero(steps.sharp[(away > 0) & (away <= _ALONE)], axis=1)
        most = max(beside, default=0)
        least = max(_MANY, min(_FEWER * most, _LONG * self._columns.size))
        if not (touched or self._all_lines):
            return False
        return bool(run.size >= (max(_SOME, _SOME_FEWER * most) if touched else least))

    def _sharp(self, image: Image, rather: float = 1.0) -> tuple[Columns, Columns]:
        """Rows and columns of steps from a row to the next that no lens has drawn.

        Args:
            image: (height, width) or (height, width, 3).
            rather: part of what is asked of a step.
        """
        part = image[self._part]
        if part.ndim == 3:
            part = part[..., 1]
        low, high = _ends(part[::4, ::4])
        steps = cv2.absdiff(part[1:], part[:-1])
        least = math.ceil(rather * max(_LEAST * (high - low), _STEP))
        # Few are large: the rows beside are looked at for these alone.
        rows, columns = np.divmod(np.flatnonzero(steps >= least), steps.shape[1])
        above = np.where(rows > 0, steps[rows - 1, columns], 0)
        below = np.where(rows < len(steps) - 1, steps[(rows + 1) % len(steps), columns], 0)
        sharp = steps[rows, columns] >= rather * _SHARP * np.maximum(above, below)
        return rows[sharp], columns[sharp]


def _ends(levels: Image) -> tuple[float, float]:
    """Grey levels between which nearly all are; `np.percentile` by counting, which is faster."""
    counts = np.cumsum(np.bincount(levels.ravel(), minlength=256))
    place = 0.01 * np.array(_PERCENT) * (levels.size - 1)
    lower = np.floor(place)
    first, second = np.searchsorted(
        counts, (lower, np.minimum(lower + 1, levels.size - 1)), "right"
    )
    low, high = first + (place - lower) * (second - first)
    return float(low), float(high)


def _runs(columns: Columns) -> list[Columns]:
    """Runs of columns that are long enough for a seam."""
    runs = np.split(columns, np.flatnonzero(np.diff(columns) > _GAP) + 1)
    return [run for run in runs if run.size >= _RUN]
