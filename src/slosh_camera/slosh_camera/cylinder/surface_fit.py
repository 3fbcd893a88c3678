"""Detects edges near an assumed free surface and fits the surface to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder import edge_search, surface_solver
from slosh_camera.cylinder.surface import (
    SHAPES,
    USUAL_FADE,
    FadeShare,
    Prior,
    SurfaceFit,
    Unrolled,
    WallPoints,
)
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import WallGeometry

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class SurfaceFitter:
    """Fits free surfaces to edges along one camera's scan lines."""

    def __init__(self, geometry: WallGeometry) -> None:
        """Stores the scan lines' wall geometry for later fits."""
        self._wall = geometry

    def fit_front(
        self,
        points: WallPoints,
        prior: Prior,
        start: FloatArray | None = None,
        coarse: float = TUNING.coarse,
    ) -> SurfaceFit:
        """Fits a free surface to points of the front contact line alone.

        Args:
            start: (SHAPES,) a first guess of the heights [m]; None: at rest.
            coarse: deviations of a point up to which it counts at first.
        """
        guess = prior.centre if start is None else start
        about = prior.conditional(guess, self._wall.radius, front_alone=True)
        return self._solve(points, np.full(self._wall.lines, np.nan), guess, about, coarse)

    def refined(
        self,
        view: Unrolled,
        points: WallPoints,
        start: FloatArray,
        prior: Prior,
        coarse: float = TUNING.coarse,
    ) -> SurfaceFit:
        """Detects contact line and upper edge near a surface and fits the surface to both.

        Args:
            start: (SHAPES,) heights of the surface [m].
            coarse: deviations of an edge up to which it counts at first.
        """
        expected, upper = self._wall.front_rows(start), self._wall.silhouette(start, view.softness)
        correct = self._shade if view.scatters else self._corrected
        used = correct(view, points, expected, upper)
        edge = self._upper_edge(view, used, expected, upper, start)
        return self._solve(
            used, edge, start, prior.conditional(start, self._wall.radius), coarse, view.softness
        )

    def again(self, view: Unrolled, fit: SurfaceFit, prior: Prior, fade: FadeShare) -> SurfaceFit:
        """Repeats a fit to the same edges, with another degree of fading of wave crests.

        Args:
            fade: share of the fade that crests show.
        """
        about = prior.conditional(fit.heights, self._wall.radius)
        return self._solve(
            fit.points, fit.upper_place, fit.heights, about, TUNING.fine, view.softness, fade
        )

    def _corrected(
        self, view: Unrolled, points: WallPoints, expected: FloatArray, upper: FloatArray
    ) -> WallPoints:
        """Repeats the search for contact-line points that are far from the surface.

        Args:
            points: as found without a surface.
            expected, upper: (M,) rows of the surface's contact line and upper edge.
        """
        band = np.where(upper > 0.0, np.fmax(expected - upper, 0.0), np.inf)
        apart = max(TUNING.apart_rows, TUNING.apart_widths * view.softness)
        # Two edges so close together are seen as one, anywhere between them.
        merged = np.where(band < 1.3 * apart, 0.5 * band * self._wall.footprint, 0.0)
        scale = np.hypot(points.scale, merged)
        far = ~(np.abs(points.place - expected) < TUNING.far_rows) & ~points.bound
        if not np.any(far):
            return replace(points, scale=scale)
        found, again = self._looked_for(view, far, expected, upper)
        return WallPoints(
            np.where(found, again.place, points.place),
            np.where(found, again.azimuth, points.azimuth),
            np.where(found, again.height, points.height),
            np.where(found[:, np.newaxis], again.shapes, points.shapes),
            points.bound,
            np.where(found, again.width, points.width),
            np.where(found, 2.0 * scale, scale),
        )

    def _shade(
        self, view: Unrolled, points: WallPoints, expected: FloatArray, upper: FloatArray
    ) -> WallPoints:
        """Detects the points of a low-contrast contact line.

        Liquid and surface end together at the upper edge, and there the points were found: all of
        them are looked for again, below that edge.

        Args:
            points: as found without a surface.
            expected, upper: (M,) rows of the surface's contact line and upper edge.
        """
        apart = max(TUNING.apart_rows, TUNING.apart_widths * view.softness)
        found, again = self._looked_for(view, ~points.bound, expected, upper + apart)
        band = np.where(upper > 0.0, np.fmax(expected - upper, apart), np.inf)
        rows = TUNING.shade_rows * np.fmax(TUNING.shade_band / band, 1.0)
        known = np.where(points.bound, points.height, np.nan)
        return WallPoints(
            np.where(points.bound, points.place, again.place),
            np.where(found, again.azimuth, points.azimuth),
            np.where(found, again.height, known),
            np.where(found[:, np.newaxis], again.shapes, points.shapes),
            points.bound,
            np.where(found, again.width, points.width),
            np.hypot(TUNING.systematic, rows * self._wall.footprint),
        )

    def _looked_for(
        self, view: Unrolled, lines: BoolArray, expected: FloatArray, least: FloatArray
    ) -> tuple[BoolArray, WallPoints]:
        """Detects edges near expected rows of the contact line (M,) on the given scan lines.

        Args:
            lines: (M,) those that are looked at.
            expected, least: (M,) rows.
        """
        row, slope = edge_search.follow_edge(
            view.picture, view.stationary, np.where(lines, expected, np.nan), TUNING.again_rows,
            self._wall.last_row.astype(np.float64),
            np.fmax(self._wall.first_row, least).astype(np.int64), np.ones(expected.size),
        )  # fmt: skip
        place, width = edge_search.refine_edges(
            view.picture, np.maximum(row, 0), self._wall.first_row, self._wall.last_row
        )
        found = lines & (row > 0) & (slope > max(TUNING.least_slope, 3.0 * view.noise))
        place = np.where(found, place, np.nan)
        return found, self._wall.wall_points(place, width, np.zeros_like(found))

    def _upper_edge(
        self, view: Unrolled, points: WallPoints, expected: FloatArray, upper: FloatArray,
        heights: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """Returns rows (M,) of the surface's upper edge near expected rows; NaN without edge."""
        guess = np.where(self._wall.stretched | (upper < 0.0), np.nan, upper)
        size = float(np.hypot(heights[1], heights[2]))
        # The prior's doubt of the surface's shape, in rows.
        doubt = 0.3 * size**2 / self._wall.radius / self._wall.footprint
        reach = int(min(max(4.0 + doubt, 5.0), 24.0))
        agree = np.abs(points.place - expected) < 3.0
        floor = np.where(agree, points.place, expected)
        floor -= max(TUNING.apart_rows, TUNING.apart_widths * view.softness)
        if view.scatters:
            # The contact line is too faint to be taken for the upper edge, however near.
            floor = expected + reach
        row, slope = edge_search.follow_edge(
            view.picture,
            view.stationary,
            guess,
            reach,
            floor,
            self._wall.first_row,
            self._reversed(view, guess),
        )
        place, _ = edge_search.refine_edges(
            view.picture, np.maximum(row, 0), self._wall.first_row, self._wall.last_row
        )
        found = (row > 0) & (slope > max(TUNING.least_slope, 3.0 * view.noise)) & (place < floor)
        # A few edges here and there are those of reflections and dirt.
        if np.count_nonzero(found) < TUNING.least_upper * np.count_nonzero(guess < floor):
            return np.full(found.size, np.nan)
        return np.where(found, place, np.nan)

    def _reversed(self, view: Unrolled, upper: FloatArray) -> FloatArray:
        """Returns weights (M,) for upper edges that are darker above than below.

        So it is where a dark table is behind the container, and where the surface mirrors a lamp.
        """
        above = np.where(upper > TUNING.reversed_above, upper - TUNING.reversed_above, 0.0).astype(
            np.int64
        )
        behind = view.backdrop[above, np.arange(upper.size)]
        return np.where(behind < view.surface + TUNING.no_lighter, 1.0, TUNING.reversed_weight)

    def _solve(
        self,
        points: WallPoints,
        upper: FloatArray,
        start: FloatArray,
        about: tuple[FloatArray, FloatArray],
        coarse: float,
        softness: float = 0.0,
        fade: FadeShare = USUAL_FADE,
    ) -> SurfaceFit:
        wall = self._wall
        near, far = edge_search.table_at(wall.near, upper), edge_search.table_at(wall.far, upper)
        scale = float(np.hypot(TUNING.systematic, TUNING.upper_rows * wall.footprint))
        found, covariance, *result = surface_solver.solve(
            points.shapes, points.height, points.scale, points.bound, near, far,
            np.full(wall.lines, scale),
            wall.radius, wall.fade(softness), start, *about, fade.mean, fade.stddev, coarse,
        )  # fmt: skip
        azimuth = np.arctan2(far[:, 1], far[:, 0])
        heights = found[:SHAPES].copy()
        share = FadeShare(float(found[SHAPES]), float(np.sqrt(covariance[SHAPES, SHAPES])))
        by_fade = covariance[:SHAPES, SHAPES] / share.stddev
        given = covariance[:SHAPES, :SHAPES] - np.outer(by_fade, by_fade)
        front_error, front_weight, upper_error, upper_weight, part = result
        return SurfaceFit(
            points, heights, given, share, by_fade, front_error, front_weight,
            upper, azimuth, upper_error, upper_weight, scale, part,
        )  # fmt: skip
