"""Evaluates a fitted surface: highest points, height profile, uncertainty and flags."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder import silhouette, surface_solver
from slosh_camera.cylinder.appearance import median
from slosh_camera.cylinder.surface import SHAPES, Shape, SurfaceFit, Unrolled, wall_shapes
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import WallGeometry
from slosh_camera.measurement import Flag

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


_BINS = 180
_STEP = 2.0 * np.pi / _BINS


@dataclass(frozen=True, slots=True)
class HighestPoint:
    """Highest point of the free surface on the wall.

    Attributes:
        height: above the still level [m].
        azimuth: [rad] in (-pi, pi].
        stddev: of the height [m].
    """

    height: float
    azimuth: float
    stddev: float


class SurfaceReading:
    """Heights on the wall, from the fitted surface and from contact-line points."""

    def __init__(
        self, fit: SurfaceFit, zero: FloatArray, footprint: float,
        *, cut_off: bool = False, shaded: bool = False,
    ) -> None:  # fmt: skip
        """Averages the contact-line points' residuals by azimuth.

        `contradiction` is how much less than claimed the edges tell, see `errors_together`.

        Args:
            zero: (SHAPES,) heights of the surface at rest [m].
            footprint: of a sample on the wall [m].
            cut_off: the surface reaches the image's border; nothing is told of what is beyond.
            shaded: the contact line is a mere shade, whose points hardly speak for themselves.
        """
        self._fit, points = fit, fit.points
        self._heights = fit.heights - zero
        # Where liquid reaches the image's border its height is at least the border's.
        front = (fit.front_weight > TUNING.inlier) | points.bound
        rear = (fit.upper_weight > TUNING.inlier) & (fit.upper_part > TUNING.at_rear)
        self.front, self.rear = front, rear
        self.azimuth = np.concatenate((points.azimuth[front], fit.upper_azimuth[rear][::-1]))
        self._residual = np.concatenate((-fit.front_error[front], -fit.upper_error[rear][::-1]))
        # A point that hardly agrees hardly counts.
        weight = np.concatenate((fit.front_weight[front], fit.upper_weight[rear][::-1]))
        told = np.full(np.count_nonzero(front), TUNING.shade_weight if shaded else 1.0)
        self._told = np.concatenate((told, np.ones(np.count_nonzero(rear))))
        self._trust = weight * self._told * _ordinary(self._residual)
        self._footprint, self._cut_off = footprint, cut_off
        width = points.width[front & ~points.bound]
        self.edge_width = float(median(width)) if width.size else np.nan
        self._local, self._seen = self._around_the_wall(1 if cut_off else _NEAR)
        self._scatter = self._consistency()
        # A shade is off as a whole, which the fit knows.
        line = front & ~points.bound & (not shaded)
        self.contradiction = max(
            errors_together(fit.front_error / points.scale, line),
            errors_together(fit.upper_error / fit.upper_scale, fit.upper_weight > TUNING.inlier),
        )

    @property
    def height(self) -> FloatArray:
        """Returns the contact-line points' heights above the level at rest (N,) [m]."""
        at_points = silhouette.wall_shapes_of(self.azimuth)
        return np.asarray(at_points @ self._heights + self._residual)

    def fitted(self) -> HighestPoint:
        """Returns the highest point of the fitted surface on the whole wall."""
        height, azimuth = _highest(_WALL @ self._heights)
        return HighestPoint(height, azimuth, self._stddev(height, _WALL[_bin(azimuth)]))

    def seen(self) -> HighestPoint:
        """Returns the highest point of the visible contact line; NaN if no part is visible."""
        if not np.any(self._seen):
            return HighestPoint(np.nan, np.nan, np.nan)
        if self._cut_off and self.azimuth.size:
            # Beyond the border the surface is higher: the points alone are sure.
            best = int(np.argmax(self.height))
            height, azimuth = float(self.height[best]), float(self.azimuth[best])
        else:
            around = _WALL @ self._heights + self._local
            height, azimuth = _highest(np.where(self._seen, around, -np.inf))
        return HighestPoint(height, azimuth, self._stddev(height, _WALL[_bin(azimuth)]))

    def highest(self, fitted: HighestPoint, seen: HighestPoint) -> HighestPoint:
        """Returns the wall's highest point: the measured one, or the fitted one if it is hidden.

        What is seen is off by what it misses; where the fit is surer than that, it tells.

        Args:
            fitted, seen: as the methods of these names give them.
        """
        missing = max(fitted.height - seen.height, 0.0)
        stddev = float(np.hypot(seen.stddev, missing))
        hidden = missing > 0.0 and not (self._cut_off or self._seen[_bin(fitted.azimuth)])
        if hidden and fitted.stddev < stddev:
            return fitted
        return HighestPoint(seen.height, seen.azimuth, stddev)

    def level(self) -> tuple[float, float]:
        """Returns the mean level relative to the level at rest, and its standard deviation [m]."""
        height = float(self._heights[Shape.LEVEL])
        return height, self._stddev(height, np.eye(SHAPES)[Shape.LEVEL])

    def at(self, azimuth: float) -> float:
        """Returns the measured height at an azimuth [m], NaN where the contact line is hidden."""
        index = _bin(azimuth)
        if not self._seen[index]:
            return float("nan")
        return float(_WALL[index] @ self._heights + self._local[index])

    def _around_the_wall(self, near: int) -> tuple[FloatArray, BoolArray]:
        """Returns mean residuals by azimuth [m], and where the contact line is visible."""
        index = np.rint(self.azimuth / _STEP).astype(np.int64) % _BINS
        total, count, seen = surface_solver.around_the_wall(
            index, self._residual, self._trust, _BINS, _KERNEL, near
        )
        return total / (count + TUNING.fit_weight), seen

    def _consistency(self) -> float:
        """Returns the standard deviation of contact-line points from the fitted surface [m]."""
        if not self._residual.size:
            return 0.0
        return float(np.sqrt(np.average(np.square(self._residual), weights=self._told)))

    def _stddev(self, height: float, shapes: FloatArray) -> float:
        """Returns the standard deviation of a height [m] at a place with given mode shapes."""
        width = self.edge_width if np.isfinite(self.edge_width) else TUNING.wide_rows
        variance = float(shapes @ self._fit.covariance @ shapes)
        parts = (
            np.sqrt(max(self.contradiction, 1.0) * variance),
            float(shapes @ self._fit.by_fade),
            TUNING.of_scatter * self._scatter,
            TUNING.of_width * width * self._footprint,
            TUNING.of_height * height,
            TUNING.of_rest,
        )
        return float(np.linalg.norm(parts))


def errors_together(ratio: FloatArray, edges: BoolArray) -> float:
    """Returns the ratio of actual to assumed variance of edges whose errors are correlated.

    Edges of the surface err by themselves. Those of something else beside it, or of a surface that
    is seen through a wall of uneven thickness, are off together, and then many of them tell no
    more than one: χ² per edge, times the number of neighbours whose errors go together.

    Args:
        ratio: (M,) errors by line, in what is claimed for each.
        edges: (M,) lines that have an edge.

    Returns:
        0 where there are few edges.
    """
    count = int(np.count_nonzero(edges))
    if count < TUNING.together_edges:
        return 0.0
    errors = np.where(edges, ratio, 0.0)
    sums = np.correlate(errors, errors, "full")[errors.size - 1 :][: TUNING.together_lines + 1]
    alone = sums[1:] < TUNING.correlated * sums[0]
    longest = int(np.argmax(alone)) if alone.any() else alone.size
    return float(sums[0] + 2.0 * np.sum(sums[1 : 1 + longest])) / count


def _ordinary(residual: FloatArray) -> FloatArray:
    """Returns the robust weight of each residual, from 0 to 1."""
    if not residual.size:
        return residual
    ratio = residual / max(TUNING.ordinary * float(median(np.abs(residual))), TUNING.stands_out)
    return np.asarray(np.square(1.0 - np.minimum(np.square(ratio), 1.0)))


def _highest(around: FloatArray) -> tuple[float, float]:
    """Returns interpolated height [m] and azimuth [rad] of a closed curve's maximum."""
    best = int(np.argmax(around))
    left, top, right = around[best - 1], around[best], around[(best + 1) % _BINS]
    bend = left - 2.0 * top + right
    shift = 0.5 * (left - right) / bend if np.isfinite(bend) and bend < 0.0 else 0.0
    height = float(top - 0.25 * (left - right) * shift) if shift else float(top)
    azimuth = (best + shift) * _STEP
    return height, float(np.arctan2(np.sin(azimuth), np.cos(azimuth)))


def _bin(azimuth: float) -> int:
    return round(azimuth / _STEP) % _BINS


def _bell(width: float) -> FloatArray:
    half = int(3.0 * width / _STEP)
    return np.asarray(np.exp(-0.5 * (_STEP * np.arange(-half, half + 1) / width) ** 2))


_WALL = wall_shapes(_STEP * np.arange(_BINS))
_KERNEL = _bell(TUNING.kernel_width)
_NEAR = 2 * int(TUNING.stands_for / _STEP) + 1


def surface_flags(wall: WallGeometry, view: Unrolled, fit: SurfaceFit) -> Flag:
    """Returns the flags of a fitted surface; NOT_FOUND if too few edges agree with it."""
    flags = Flag.TOO_BRIGHT if view.clipped else Flag.NONE
    points = fit.points
    front = (fit.front_weight > TUNING.inlier) & ~points.bound
    upper = fit.upper_weight > TUNING.inlier
    if _is_cut_off(wall, fit):
        flags |= Flag.SATURATED
    looked_at = np.count_nonzero(~points.bound)
    read = np.count_nonzero(front | (upper & ~points.bound))
    impossible = float(np.hypot(*fit.heights[1:3])) > TUNING.highest * wall.radius
    if impossible or read < max(TUNING.least_read * looked_at, TUNING.least_samples):
        return flags | Flag.NOT_FOUND
    if read < (1.0 - TUNING.hidden_share) * looked_at:
        flags |= Flag.OCCLUDED
    return flags


def _is_cut_off(wall: WallGeometry, fit: SurfaceFit) -> bool:
    """Whether the liquid or its surface reaches the border of the image."""
    cut = fit.points.bound & (wall.first_row > 0)
    if np.count_nonzero(cut) >= TUNING.cut_lines:
        return True
    return bool(np.any(wall.beyond_border(fit.heights)))
