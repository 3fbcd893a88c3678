"""Checks whether the container is where it was in the image of the liquid at rest.

The still image teaches what the picture looks like across the container's sides, below all
waves, and across its floor and rim. A picture that is upside down, of another camera, shifted or
of another size has none of that in these places, and a surface found in it means nothing. Light,
noise, blur and what stands behind the container leave enough of it, and something that hides one
side, or the rim, leaves the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numba.types import float32, float64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import entry_point, given
from slosh_camera.images.colour import Image, to_gray
from slosh_camera.images.tuning import TUNING

FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]

# Samples beside an edge, and so many of them by which it is looked for.
_REACH, _LOOKED = 16, 8
PLACES = 24
"""Places along an edge at which it is looked for."""


class Edge(NamedTuple):
    """A visible container edge: its pixels (N, 2), and whether it is the left or right side."""

    pixels: FloatArray
    is_side: bool


class _EdgeStrips(NamedTuple):
    """Sample strips across one container edge, and whether it is the left or right side."""

    rows: slice
    is_side: bool


class _Seen(NamedTuple):
    """Grey levels of an image across one container edge, and their differences."""

    grey: Image
    steps: Single

    @property
    def clipped(self) -> bool:
        """Whether too many of the grey levels are clipped."""
        return bool(
            ((self.grey <= TUNING.edge_black) | (self.grey >= TUNING.edge_white)).mean()
            > TUNING.edge_clipped
        )

    @property
    def edges(self) -> Single:
        """Returns edge strengths across the container edge, with their mean removed."""
        sizes = np.abs(self.steps)
        edges = sizes / (sizes + np.float32(TUNING.edge_half))
        return np.asarray(edges - edges.mean(axis=1, keepdims=True), np.float32)


class StillEdges:
    """Stores a container's edges from one image and detects them in other images."""

    def __init__(self, edges: Sequence[Edge], size: tuple[int, int]) -> None:
        """Places sample strips across the edges that lie inside the image.

        Args:
            edges: of the container; the two sides first, from below upwards.
            size: width and height of the image [px].
        """
        width = float(np.abs(edges[1].pixels[-1, 0] - edges[0].pixels[-1, 0]))
        step = max(1.0, width / TUNING.edge_width) if np.isfinite(width) else 1.0
        along = step * np.arange(-_REACH - _LOOKED, _REACH + _LOOKED + 1.0)
        margin = along[-1] + 1.0
        self._strips: list[_EdgeStrips] = []
        across: list[FloatArray] = [np.empty((0, along.size, 2))]
        rows = 0
        for points, is_side in edges:
            with np.errstate(invalid="ignore"):
                inside = np.all((points > margin) & (points < np.array(size) - margin), axis=1)
            if np.count_nonzero(inside) >= TUNING.least_places:
                away = np.array([1.0, 0.0] if is_side else [0.0, 1.0])
                across.append(points[inside, np.newaxis] + along[:, np.newaxis] * away)
                self._strips.append(_EdgeStrips(slice(rows, rows + len(across[-1])), is_side))
                rows += len(across[-1])
        places = np.vstack(across).astype(np.float32)
        self._map = np.ascontiguousarray(places[..., 0]), np.ascontiguousarray(places[..., 1])
        self._learnt: dict[int, _Seen] = {}

    def learn(self, image: Image) -> None:
        """Stores the edges that are clearly visible in an image of the liquid at rest."""
        seen = enumerate(self._look(image))
        self._learnt = {number: one for number, one in seen if _is_marked(one)}

    def missing(self, image: Image) -> bool:
        """Whether both sides of the container, or its floor and rim, are missing in an image."""
        if not self._learnt:
            return False
        seen = self._look(image)
        found: dict[bool, bool] = {}
        for number, learnt in self._learnt.items():
            kind, now = self._strips[number].is_side, seen[number]
            found[kind] = found.get(kind, False) or now.clipped or _agree(now, learnt)
        return not all(found.values())

    def _look(self, image: Image) -> list[_Seen]:
        if not self._strips:
            return []
        grey = to_gray(np.asarray(cv2.remap(image, *self._map, cv2.INTER_LINEAR), dtype=np.uint8))
        # Along the strips alone: neighbours may lie anywhere.
        levels = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), TUNING.edge_blur, sigmaY=1e-3)
        steps = np.diff(np.asarray(levels, np.float32), axis=1)
        return [_Seen(grey[rows], steps[rows]) for rows, _ in self._strips]


def along_side(fill_height: float) -> FloatArray:
    """Returns the heights (PLACES,) above the liquid level of samples along a side [m]."""
    return fill_height * np.linspace(TUNING.edge_lowest, TUNING.edge_highest, PLACES)


def along_end(half: float) -> FloatArray:
    """Returns positions (PLACES,) from the middle of samples along the floor or the rim.

    Args:
        half: of the way from side to side, in whatever unit.
    """
    return np.linspace(-TUNING.edge_middle * half, TUNING.edge_middle * half, PLACES)


def _is_marked(seen: _Seen) -> bool:
    return bool(np.abs(seen.steps).max(axis=1).mean() >= TUNING.edge_marked) and not seen.clipped


def _agree(now: _Seen, learnt: _Seen) -> bool:
    """Whether a container edge is where it was stored, by its grey levels or their differences."""
    return _agree_in_place(_correlations(now.steps, learnt.steps)) or _agree_in_place(
        _correlations(now.edges, learnt.edges)
    )


def _agree_in_place(correlations: FloatArray) -> bool:
    near = np.abs(np.arange(correlations.size) - _LOOKED) <= TUNING.edge_moved
    best = float(correlations[near].max())
    return best >= max(TUNING.edge_agrees, float(correlations[~near].max()) / TUNING.edge_better)


@entry_point(float64[::1](given(float32, 2, "A"), given(float32, 2, "A")))
def _correlations(now, learnt):  # type: ignore[no-untyped-def]
    """Returns the correlation with the stored edge strips for each shift in pixels."""
    shifts = 2 * _LOOKED + 1
    rows, width = learnt.shape[0], learnt.shape[1] - 2 * _LOOKED
    size, together, squares = 0.0, np.zeros(shifts), np.zeros(shifts)
    line = np.empty(now.shape[1])
    for n in range(rows):
        line[:] = now[n]
        for k in range(width):
            part = np.float64(learnt[n, _LOOKED + k])
            size += part * part
            for shift in range(shifts):
                together[shift] += line[k + shift] * part
                squares[shift] += line[k + shift] * line[k + shift]
    correlations = np.zeros(shifts)
    for shift in range(shifts):
        if size * squares[shift] > 0.0:
            correlations[shift] = together[shift] / np.sqrt(size * squares[shift])
    return correlations
