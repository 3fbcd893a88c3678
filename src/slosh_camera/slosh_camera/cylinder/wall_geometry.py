"""Tables of the wall points on all scan lines, where a surface lies on them, and their pixels.

Through a wall of glass the way from a point to its pixel is found step by step, which costs more
than all the rest of a measurement: it is done once for a net of points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder import edge_search, silhouette
from slosh_camera.cylinder.scan_grid import ScanGrid
from slosh_camera.cylinder.surface import WallPoints
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.optics.cup import CupView

FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


# Every fourth line is enough to compare surfaces.
SKIP = 4


class WallGeometry:
    """Tables of the wall points of all J samples on all M scan lines.

    Attributes:
        radius: of the container [m].
        footprint: height of one sample on the rear wall [m].
        inside: (J, M) 1 inside the image, 0 outside.
        first_row, last_row: (M,) rows inside the image.
        stretched: (M,) lines that are of no use for the upper edge.
        near, far: (J, M, 3) points of the front and of the rear wall, x and y in radii, z [m];
            NaN: none.
    """

    def __init__(self, grid: ScanGrid, radius: float) -> None:
        """Stores the scan lines' wall points in units of the radius.

        Args:
            radius: of the container [m].
        """
        rows, lines = grid.shape
        self.radius = radius
        self.rows = rows
        self.lines = lines
        self.near = grid.front / (radius, radius, 1.0)
        self.far = grid.rear / (radius, radius, 1.0)
        self.inside = np.ascontiguousarray(grid.inside, dtype=np.float32)
        self.first_row: IntArray = np.argmax(grid.inside, axis=0)
        self.last_row: IntArray = rows - 1 - np.argmax(grid.inside[::-1], axis=0)
        self._may_be_cut = bool(np.any(self.first_row > 0))
        self.footprint = _rear_footprint(grid)
        self.stretched = _stretched(grid)
        self._some = (
            np.ascontiguousarray(self.near[:, ::SKIP]),
            np.ascontiguousarray(self.far[:, ::SKIP]),
        )
        self._some_last = self.last_row[::SKIP].copy()
        self._front_height = np.ascontiguousarray(grid.front[..., 2])
        self._shapes = silhouette.shapes_of(self.near[grid.still_row])

    def wall_points(
        self, place: FloatArray, width: FloatArray, at_border: BoolArray
    ) -> WallPoints:
        """Converts rows of the contact line to points on the wall.

        Args:
            place: (M,) rows; NaN: none.
            width: (M,) of the edges [samples].
            at_border: (M,) whether the liquid reaches the image's border instead.
        """
        rows = np.where(at_border, self.first_row, place)
        points = edge_search.table_at(self.near, rows)
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        shapes = silhouette.shapes_of(points)
        scale = np.full(rows.size, np.hypot(TUNING.systematic, TUNING.front_rows * self.footprint))
        height = points[:, 2].copy()
        return WallPoints(rows, azimuth, height, shapes, at_border, width, scale)

    def fade(self, softness: float) -> float:
        """Returns the rear-wall height [m] over which a wave crest fades into the background."""
        least, most = TUNING.fade_limits
        return self.footprint * min(max(softness / TUNING.sharp_rows, least), most)

    def silhouette(
        self, heights: FloatArray, softness: float, *, coarse: bool = False
    ) -> FloatArray:
        """Returns the rows where a surface ends against the background; -1 above the image.

        Args:
            heights: (SHAPES,) of the surface [m].
            softness: width of the picture's edges [rows].
            coarse: for every `SKIP`th line only.

        Returns:
            (M,), between those of every `SKIP`th line.
        """
        rows = silhouette.silhouette_rows(
            *self._some, self._some_last, self.radius, self.fade(softness), heights
        )
        return rows if coarse else np.asarray(edge_search.between_lines(rows, SKIP, self.lines))

    def front_rows(self, heights: FloatArray) -> FloatArray:
        """Returns the rows (M,) of a surface's front contact line."""
        return np.asarray(edge_search.rows_of_heights(self._front_height, self._shapes @ heights))

    def covered_border(self, picture: Single) -> bool:
        """Whether the image border shows something other than background."""
        cut = np.flatnonzero(self.first_row > 0)
        return bool(
            np.count_nonzero(picture[self.first_row[cut], cut] < TUNING.covered)
            >= TUNING.border_lines
        )

    def beyond_border(self, heights: FloatArray) -> BoolArray:
        """Whether a surface lies beyond the image border, for every `SKIP`th scan line."""
        if not self._may_be_cut:
            return np.zeros(0, np.bool_)
        rows = self.first_row[::SKIP].astype(np.float64)
        near = edge_search.table_at(self._some[0], rows)
        far = edge_search.table_at(self._some[1], rows)
        far[self.stretched[::SKIP]] = np.nan
        above = silhouette.above_ray(near, far, self.radius, self.footprint, heights)
        front = silhouette.shapes_of(near) @ heights > near[:, 2]
        return np.asarray((above | front) & (self.first_row[::SKIP] > 0))


def _rear_footprint(grid: ScanGrid) -> float:
    middle = grid.rear[:, grid.shape[1] // 2, 2]
    steps = np.abs(np.diff(middle))
    known = steps[np.isfinite(steps)]
    if not known.size:
        known = np.abs(np.diff(grid.front[:, grid.shape[1] // 2, 2]))
    return float(np.median(known))


def _stretched(grid: ScanGrid) -> BoolArray:
    """Returns a mask of scan lines (M,) where refraction stretches the rear wall too much."""
    row = grid.rear[grid.still_row]
    step = np.full(len(row), np.nan)
    step[1:-1] = 0.5 * np.linalg.norm(row[2:] - row[:-2], axis=1)
    usual = float(np.nanmedian(step)) if np.any(np.isfinite(step)) else np.nan
    return np.asarray(~(step < TUNING.stretch * usual))


_AZIMUTHS = 180
_STEP = 2.0 * np.pi / _AZIMUTHS
_HEIGHTS = 25


class WallPixels:
    """Table of the image positions of a container's wall points by azimuth and height."""

    def __init__(self, view: CupView) -> None:
        """Projects a grid of wall points into the image, as a look-up table."""
        self._view = view
        level = view.cup.rim_level
        top = TUNING.unknown_rim * view.cup.radius if level is None else level
        self._low = -view.cup.fill_height
        self._spacing = (top - self._low) / (_HEIGHTS - 1)
        heights = self._low + self._spacing * np.arange(_HEIGHTS)
        azimuth, height = np.meshgrid(_STEP * np.arange(_AZIMUTHS), heights, indexing="ij")
        pixels = view.project_wall(azimuth.ravel(), height.ravel())
        self._table: FloatArray = pixels.reshape(_AZIMUTHS, _HEIGHTS, 2)
        # Next to the container's sides the net is too wide.
        sides = np.asarray(view.tangent_azimuths())
        self._exact = {int(side // _STEP + k) % _AZIMUTHS for side in sides for k in range(-4, 5)}

    def __call__(self, azimuth: float, height: float) -> tuple[float, float]:
        """Returns image column and row of a wall point [px], or NaN if it is not visible.

        Args:
            azimuth: [rad].
            height: above the still level [m].
        """
        if not (np.isfinite(azimuth) and np.isfinite(height)):
            return float("nan"), float("nan")
        across = (azimuth / _STEP) % _AZIMUTHS
        up = (height - self._low) / self._spacing
        i, j = int(across) % _AZIMUTHS, int(up)
        if i in self._exact or not 0 <= j < _HEIGHTS - 1:
            u, v = self._view.project_wall(azimuth, height)[0]
            return float(u), float(v)
        a, b = across - int(across), up - j
        here, beside = self._table[i], self._table[(i + 1) % _AZIMUTHS]
        low = (1.0 - a) * here[j] + a * beside[j]
        high = (1.0 - a) * here[j + 1] + a * beside[j + 1]
        u, v = (1.0 - b) * low + b * high
        return float(u), float(v)
