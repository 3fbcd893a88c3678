"""Detects repeated images of a driver that hangs, and torn ones, whose parts differ in time.

No lens draws an edge from one row to the next: it blurs it over two or three. Where two moments
meet, what has moved meanwhile ends at one and the same row, as sharply as the pixels allow.
"""

from __future__ import annotations

import math
import zlib
from collections import deque
from itertools import pairwise
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


Digest = tuple[tuple[int, ...], tuple[int, ...]]


class RepeatedFrames:
    """Detects repeated images by comparing row checksums; stores no images.

    Noise makes every image of a camera that works differ from all others, in every part of it.
    """

    def __init__(self) -> None:
        self._last: deque[Digest] = deque(maxlen=TUNING.buffers)
        self._known = self._was_partly = False
        self._fresh = [0] * TUNING.bands
        self._stamp_ns: int | None = None

    def is_repeat(self, image: Image, stamp_ns: int | None = None) -> bool:
        """Whether an image has the same pixels as the previous one, or repeats earlier ones.

        A driver that hands out a few old images in turn is told from the second repeat on: a
        single one may be chance in a drawn picture. Of a camera with noise an image is told, too,
        whose upper or lower part is that of an old one.

        Args:
            image: (height, width) or (height, width, 3); may be a view, each the same kind.
            stamp_ns: its moment [ns]; one before the last begins a recording anew.
        """
        return self.repeats(digest(image), stamp_ns)

    def repeats(self, following: Digest, stamp_ns: int | None = None) -> bool:
        """Whether an image repeats earlier ones, judged by its row checksums."""
        if stamp_ns is not None:
            if self._stamp_ns is not None and stamp_ns < self._stamp_ns:
                while len(self._last) > 1:
                    self._last.popleft()
            self._stamp_ns = stamp_ns
        frozen = bool(self._last) and following == self._last[-1]
        known = following in self._last
        in_turn = known and self._known
        partly = self._repeats_partly(following)
        self._known = known
        self._last.append(following)
        return frozen or in_turn or partly

    def _repeats_partly(self, following: Digest) -> bool:
        """Whether noisy parts of an image equal an earlier image pixel by pixel."""
        shape, bands = following
        old = [
            any(shape == one[0] and band == one[1][at] for one in self._last)
            for at, band in enumerate(bands)
        ]
        noisy = [fresh >= TUNING.noisy for fresh in self._fresh]
        for at, is_old in enumerate(old):
            # A band that had noise and repeats is told as long as it does.
            if not noisy[at]:
                self._fresh[at] = 0 if is_old or not self._last else self._fresh[at] + 1
        stale = [at for at, is_old in enumerate(old) if is_old and noisy[at]]
        before, self._was_partly = self._was_partly, bool(stale)
        if not stale or sum(noisy) < TUNING.noisy_bands:
            return False
        # Noise that is drawn may come again all over what does not move; a part that is old lies
        # at one end of the image.
        return before or (0 in stale) != (TUNING.bands - 1 in stale)


def digest(image: Image) -> Digest:
    """Returns an image's shape and the CRC-32 checksums of its bands of rows.

    CRC-32 is the fastest checksum of the standard library that sees every change of one pixel;
    two images that differ are taken for one another once in 4e9.
    """
    rows = np.ascontiguousarray(_in_order_of_memory(image))
    edges = np.linspace(0, len(rows), TUNING.bands + 1).astype(int).tolist()
    return image.shape, tuple(zlib.crc32(rows[start:end].data) for start, end in pairwise(edges))


def _in_order_of_memory(image: Image) -> Image:
    """Returns the same pixels with axes in memory order, which is faster to read."""
    return image[..., ::-1] if image.strides[-1] < 0 else image
