"""Edges in the image of the liquid at rest that do not belong to the liquid.

They are of a label, or of what is behind the container; whatever the liquid does, they are not its
surface's.

Pictures are unrolled walls as in `edge_search`. A row names the edge between it and the one above.
"""

from __future__ import annotations

import numpy as np
from numba.types import float64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import GIVEN_1, entry_point
from slosh_camera.cylinder.edge_search import PICTURE, STEPS, fall_above, has_stood
from slosh_camera.cylinder.tuning import TUNING

FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]


def no_edges(shape: tuple[int, int]) -> Single:
    """Returns an empty edge map (2, J, M), used without an image of the liquid at rest."""
    return np.zeros((2, *shape), np.float32)


def stationary_edges(picture: Single, lines: FloatArray, reach: float) -> Single:
    """Returns the edges in the image of the liquid at rest that do not belong to the liquid.

    Args:
        picture: (J, M) the still image.
        lines: (N, M) rows of the liquid's lines where they are seen; NaN where they are not.
        reach: rows around these lines that belong to them.

    Returns:
        (2, J, M) size of the step at each row, less like background below than above, and the
        other way round; 0: none.
    """
    rows = np.arange(len(picture))[:, np.newaxis]
    step = np.zeros_like(picture)
    above, below = picture[:-3] + picture[1:-2], picture[2:-1] + picture[3:]
    step[2:-1] = 0.5 * (above - below)
    step[np.abs(step) < TUNING.faint] = 0.0
    for line in lines:
        step[np.abs(rows - 0.5 - line) <= reach] = 0.0
    known = np.maximum(np.stack((step, -step)), 0.0)
    shifted = [
        np.roll(known, by, axis=1)
        for by in range(-TUNING.stationary_shift, TUNING.stationary_shift + 1)
    ]
    return np.ascontiguousarray(TUNING.more_marked * np.max(shifted, axis=0), dtype=np.float32)


@entry_point(float64[::1](PICTURE, STEPS, GIVEN_1))
def moved_edges(picture, stationary, place):  # type: ignore[no-untyped-def]
    """Returns sub-row positions (M,) of edges; NaN if the liquid at rest shows the same edge."""
    moved = place.copy()
    for i in range(place.size):
        if np.isnan(place[i]):
            continue
        j = int(np.rint(place[i] + 0.5))
        if j < 2 or j + 1 >= picture.shape[0]:
            continue
        if has_stood(fall_above(picture, j, i), stationary, j, i):
            moved[i] = np.nan
    return moved
