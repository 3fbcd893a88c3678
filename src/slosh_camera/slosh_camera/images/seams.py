"""Detects torn images, whose upper and lower parts were taken at different times.

No lens draws an edge from one row to the next: it blurs it over two or three. Where two moments
meet, what has moved meanwhile ends at one and the same row, as sharply as the pixels allow.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from slosh_camera.images.tuning import TUNING

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Columns = NDArray[np.intp]

# Between these percentiles of its levels is an image's contrast.
_PERCENT = (1.0, 99.0)


class Steps(NamedTuple):
    """Places in an image where adjacent rows differ more sharply than a lens allows.

    Attributes:
        rows: (R,) from the window's top.
        sharp: (R, columns) where.
    """

    rows: Columns
    sharp: BoolArray


NO_STEPS = Steps(np.empty(0, np.intp), np.empty((0, 0), np.bool_))


class SeamFinder:
    """Detects torn images by sharp horizontal steps in the region of the container's wall.

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
        """Excludes the sharp edges of the liquid at rest from the search for tears."""
        known = np.zeros(self._shape, np.uint8)
        known[self._sharp(image, TUNING.still_seam)] = 1
        self._known = cv2.dilate(known, np.ones((3, 3), np.uint8)).astype(np.bool_)

    def steps(self, image: Image) -> Steps:
        """Returns brightness steps between rows, too sharp for a lens, as in torn images.

        None without a still image: the container and what is around it may have edges as sharp.
        """
        if self._known is None:
            return NO_STEPS
        rows, columns = self._sharp(image)
        new = ~self._known[rows, columns]
        rows, columns = rows[new], columns[new]
        sharp = np.zeros(self._shape, np.bool_)
        sharp[rows, columns] = True
        many = np.flatnonzero(np.bincount(rows) >= TUNING.seam_run)
        return Steps(many, sharp[many])

    def is_torn(self, steps: Steps, *lines: tuple[FloatArray, FloatArray]) -> bool:
        """Whether the image has a tear, a sharp step that is none of the liquid's lines."""
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
        """Whether sharp steps in adjacent columns below an image row are a tear in the image."""
        touched = False
        for curve in curves:
            line = curve[run]
            line = line[np.isfinite(line)]
            if line.size and np.min(np.abs(line - row - 0.5)) < TUNING.seam_near:
                if np.ptp(line) < min(TUNING.seam_along, TUNING.seam_parallel / run.size):
                    return False
                touched = True
        away = np.abs(steps.rows - row)
        beside = np.count_nonzero(steps.sharp[(away > 0) & (away <= TUNING.seam_beside)], axis=1)
        most = max(beside, default=0)
        least = max(
            TUNING.seam_many, min(TUNING.seam_fewer * most, TUNING.seam_long * self._columns.size)
        )
        if not (touched or self._all_lines):
            return False
        return bool(
            run.size
            >= (max(TUNING.seam_some, TUNING.seam_some_fewer * most) if touched else least)
        )

    def _sharp(self, image: Image, rather: float = 1.0) -> tuple[Columns, Columns]:
        """Returns rows and columns of steps between image rows that are too sharp for a lens.

        Args:
            image: (height, width) or (height, width, 3).
            rather: part of what is asked of a step.
        """
        part = image[self._part]
        if part.ndim == 3:
            part = part[..., 1]
        low, high = _ends(part[::4, ::4])
        steps = cv2.absdiff(part[1:], part[:-1])
        least = math.ceil(rather * max(TUNING.least_seam * (high - low), TUNING.seam_step))
        # Few are large: the rows beside are looked at for these alone.
        rows, columns = np.divmod(np.flatnonzero(steps >= least), steps.shape[1])
        above = np.where(rows > 0, steps[rows - 1, columns], 0)
        below = np.where(rows < len(steps) - 1, steps[(rows + 1) % len(steps), columns], 0)
        sharp = steps[rows, columns] >= rather * TUNING.sharp_seam * np.maximum(above, below)
        return rows[sharp], columns[sharp]


def _ends(levels: Image) -> tuple[float, float]:
    """Returns a low and a high percentile of an image's grey levels, by counting."""
    counts = np.cumsum(np.bincount(levels.ravel(), minlength=256))
    place = 0.01 * np.array(_PERCENT) * (levels.size - 1)
    lower = np.floor(place)
    first, second = np.searchsorted(
        counts, (lower, np.minimum(lower + 1, levels.size - 1)), "right"
    )
    low, high = first + (place - lower) * (second - first)
    return float(low), float(high)


def _runs(columns: Columns) -> list[Columns]:
    """Returns the runs of adjacent columns that are long enough for a tear."""
    runs = np.split(columns, np.flatnonzero(np.diff(columns) > TUNING.seam_gap) + 1)
    return [run for run in runs if run.size >= TUNING.seam_run]
