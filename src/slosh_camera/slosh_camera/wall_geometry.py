"""Where scan lines meet the container's walls, as tables, and the lines of a surface on them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_camera import edge_search, surface_solver
from slosh_camera.scan_grid import ScanGrid
from slosh_camera.surface_evidence import WallPoints
from slosh_camera.surface_modes import RADIAL, wall_shapes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

# Standard deviation of a point of the front line: what calibration and refraction leave [m], and a
# part of a row.
SYSTEMATIC = 1.5e-4
_FRONT_ROWS = 0.5
# Lines on which a line of the image covers so many times as much of the rear wall as in the middle
# are of no use for the upper edge.
_STRETCH = 4.0
# Every fourth line is enough to compare surfaces.
SKIP = 4


class WallGeometry:
    """Tables over the samples of all scan lines, (J, M).

    Attributes:
        radius: of the container [m].
        footprint: height of one sample on the rear wall [m].
        first_row, last_row: (M,) rows inside the image.
        stretched: (M,) lines that are of no use for the upper edge.
        front, rear: (J, M, 3) points of the walls [m]; NaN: none.
        near, far: the same with x and y in radii.
    """

    def __init__(self, grid: ScanGrid, radius: float) -> None:
        """Put the scan lines' places on the wall in units of the radius.

        Args:
            grid: the scan lines.
            radius: of the container [m].
        """
        rows, lines = grid.shape
        self.radius = radius
        self.rows = rows
        self.lines = lines
        self.front, self.rear = grid.front, grid.rear
        self.near = grid.front / (radius, radius, 1.0)
        self.far = grid.rear / (radius, radius, 1.0)
        self.first_row: IntArray = np.argmax(grid.inside, axis=0)
        self.last_row: IntArray = rows - 1 - np.argmax(grid.inside[::-1], axis=0)
        self.footprint = _rear_footprint(grid)
        self.stretched = _stretched(grid)
        self._lines = np.arange(lines)

    def at(self, table: FloatArray, rows: FloatArray) -> FloatArray:
        """Values (M, 3) of a table (J, M, 3) at rows between samples; NaN where there is none."""
        whole = np.clip(np.nan_to_num(rows, nan=0.0).astype(np.int64), 0, self.rows - 2)
        part = (rows - whole)[:, np.newaxis]
        upper, lower = table[whole, self._lines], table[whole + 1, self._lines]
        return np.asarray(upper + (lower - upper) * part)

    def wall_points(
        self, place: FloatArray, width: FloatArray, at_border: BoolArray
    ) -> WallPoints:
        """Put rows of the front line on the wall.

        Args:
            place: (M,) rows; NaN: none.
            width: (M,) of the edges [samples].
            at_border: (M,) whether the liquid reaches the image's border instead.
        """
        rows = np.where(at_border, self.first_row, place)
        points = self.at(self.front, rows)
        azimuth = np.arctan2(points[:, 1], points[:, 0])
        scale = np.full(rows.size, np.hypot(SYSTEMATIC, _FRONT_ROWS * self.footprint))
        return WallPoints(rows, azimuth, points[:, 2], at_border, width, scale)

    def silhouette(self, heights: FloatArray) -> FloatArray:
        """Rows (M,) at which a surface ends against the background; -1: above the image."""
        return np.asarray(
            surface_solver.silhouette_rows(
                self.near,
                self.far,
                self.last_row,
                self.radius,
                self.footprint,
                heights,
                RADIAL,
            )
        )

    def front_rows(self, heights: FloatArray) -> FloatArray:
        """Rows (M,) of the front line of a surface."""
        level = wall_shapes(np.arctan2(self.front[0, :, 1], self.front[0, :, 0])) @ heights
        return np.asarray(edge_search.rows_of_heights(self.front[..., 2], level))


def _rear_footprint(grid: ScanGrid) -> float:
    middle = grid.rear[:, grid.shape[1] // 2, 2]
    steps = np.abs(np.diff(middle))
    known = steps[np.isfinite(steps)]
    if not known.size:
        known = np.abs(np.diff(grid.front[:, grid.shape[1] // 2, 2]))
    return float(np.median(known))


def _stretched(grid: ScanGrid) -> BoolArray:
    """Lines (M,) on which refraction and grazing spread the rear wall too far."""
    row = grid.rear[grid.still_row]
    step = np.full(len(row), np.nan)
    step[1:-1] = 0.5 * np.linalg.norm(row[2:] - row[:-2], axis=1)
    usual = float(np.nanmedian(step)) if np.any(np.isfinite(step)) else np.nan
    return np.asarray(~(step < _STRETCH * usual))
