"""Chooses the free surface in an image among several candidates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba.types import Tuple, float64, int64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import GIVEN_1, compiled, entry_point, given
from slosh_camera.cylinder import edge_search, silhouette
from slosh_camera.cylinder.appearance import ROBUST
from slosh_camera.cylinder.surface import (
    USUAL_FADE,
    Prior,
    SurfaceFit,
    Unrolled,
    WallPoints,
    wall_shapes,
)
from slosh_camera.cylinder.surface_fit import SurfaceFitter
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import SKIP, WallGeometry

FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

# Levels at which liquid at rest is looked for [m].
_LEVELS = np.arange(-15e-3, 15.5e-3, 5e-4)
# Heights all around the wall.
_AROUND = wall_shapes(np.radians(np.arange(0.0, 360.0, 10.0)))


class SurfaceChooser:
    """Fits and rates free surfaces in the images of one camera."""

    def __init__(self, geometry: WallGeometry, rim: float = np.inf) -> None:
        """Chooses pairs of scan lines for the search for candidate surfaces.

        Args:
            rim: height of the container's rim above its origin [m]; inf: not known.
        """
        self._wall, self._highest = geometry, rim + TUNING.over_rim * geometry.radius
        self._fitter = SurfaceFitter(geometry)
        some = np.linspace(0, geometry.lines - 1, min(TUNING.pair_lines, geometry.lines))
        chosen = some.astype(np.int64)
        self._pairs = np.array([(i, j) for i in chosen for j in chosen if j > i])

    def fit_certain(self, view: Unrolled, points: WallPoints, prior: Prior) -> SurfaceFit | None:
        """Fits the surface if nearly all contact-line points agree with it, else returns None.

        Returns:
            The fit to the contact line and the upper edge; None where the points do not agree, or
            the fit is no likely surface.
        """
        starts, shares = self._candidates(points.azimuth, points.height, points.bound, prior)
        # Points that were always there are none of the surface, and leave the line unseen.
        if shares[0] * np.mean(~np.isnan(points.height)) < TUNING.certain:
            return None
        start = self._fitter.fit_front(points, prior, starts[0], TUNING.fine).heights
        fit = self._fitter.refined(view, points, start, prior, TUNING.fine)
        return fit if self.surprise(fit.heights, prior) < TUNING.unlikely else None

    def fit_several(
        self, view: Unrolled, points: WallPoints, prior: Prior
    ) -> list[tuple[SurfaceFit, float]]:
        """Fits all free surfaces that are possible in the image, and rates them.

        Returns:
            The fits, and how plausible each is, to be compared with that of other fits.
        """
        starts = np.vstack(
            (
                prior.centre,
                self._candidates(points.azimuth, points.height, points.bound, prior)[0],
                self._further_candidates(view, points, prior),
            )
        )
        return [
            found
            for start in self._most_likely(view, starts)
            for found in self.fit_near(view, points, prior, start)
        ]

    def fit_near(
        self, view: Unrolled, points: WallPoints, prior: Prior, start: FloatArray
    ) -> list[tuple[SurfaceFit, float]]:
        """Fits surfaces near given mode amplitudes (SHAPES,) [m] and rates their plausibility."""
        found = []
        for coarse in (TUNING.fine, TUNING.coarse):
            rough = self._fitter.refined(view, points, start, prior, coarse)
            fit = self._fitter.refined(view, points, rough.heights, prior, TUNING.fine)
            found.append((fit, self.plausible(view, fit, prior)))
        return found

    def fit_levels(
        self, view: Unrolled, points: WallPoints, at_rest: Prior, moving: Prior
    ) -> list[tuple[Prior, SurfaceFit, float]]:
        """Fits surfaces for a changed liquid level, starting from the best-matching level.

        Args:
            at_rest, moving: priors of the heights of liquid of changed level.

        Returns:
            The fits with their priors, and how plausible each is, as `fit_several` has them.
        """
        # An edge counts up to four rows beside it: every second level will do.
        start, _ = self._best_level(view, at_rest, _LEVELS[::2])
        fit = self._fitter.refined(view, points, start, at_rest, TUNING.fine)
        near = self.fit_near(view, points, moving, start)
        return [
            (at_rest, fit, self.plausible(view, fit, at_rest)),
            *((moving, *found) for found in near),
        ]

    def plausible(self, view: Unrolled, fit: SurfaceFit, prior: Prior) -> float:
        """Rates a fitted surface: agreement with the image minus improbability of its shape."""
        return self.plausible_heights(view, fit.heights, prior)

    def plausible_heights(self, view: Unrolled, heights: FloatArray, prior: Prior) -> float:
        """Rates a surface by its mode amplitudes (SHAPES,) [m]; -inf if liquid would spill."""
        if float(np.max(_AROUND @ heights)) > self._highest:
            return -np.inf
        return self._score(view, heights) - self.surprise(heights, prior)

    def surprise(self, heights: FloatArray, prior: Prior) -> float:
        """Returns how improbable mode amplitudes (SHAPES,) [m] are under the prior."""
        return prior.surprise(heights, self._wall.radius)

    def fit_still(
        self, view: Unrolled, points: WallPoints, prior: Prior
    ) -> tuple[SurfaceFit, float]:
        """Fits a level surface to the contact line of liquid at rest.

        Returns:
            The fit and how plausible it is.
        """
        start, plausible = self._best_level(view, prior, _LEVELS)
        near = points.near(self._wall.front_rows(start), TUNING.still_rows)
        both = self._fitter.refined(view, near, start, prior, TUNING.fine)
        both = self._without_strays(view, both, prior)
        if np.isfinite(self.surface_tone(view, both.heights)):
            return both, plausible
        return self._fitter.fit_front(both.points, prior, start, TUNING.fine), plausible

    def is_suspect(self, still: SurfaceFit) -> bool:
        """Whether a line detected at rest may be something other than the liquid's level.

        Liquid at rest is level. A surface that inclines itself towards its edges has one that is
        not its own - the far edge of a table, which is straight, so that both do not agree - or
        only one edge, which is on the front wall here and on the rear wall there.
        """
        inclined = float(np.hypot(*still.heights[1:3])) > TUNING.inclined * self._wall.radius
        agree = still.upper_weight > TUNING.inlier
        if not inclined or not np.any(agree):
            return inclined
        off = float(np.sqrt(np.mean(np.square(still.upper_error[agree]))))
        return off > TUNING.off_rows * self._wall.footprint

    def surface_tone(self, view: Unrolled, heights: FloatArray) -> float:
        """Returns the grey tone of the visible free surface, or NaN if it is not visible."""
        front, upper = (
            self._wall.front_rows(heights),
            self._wall.silhouette(heights, view.softness),
        )
        rows = np.arange(self._wall.rows)[:, np.newaxis]
        between = (
            (rows > upper + TUNING.edge_rows) & (rows < front - TUNING.edge_rows) & (upper > 0.0)
        )
        enough = np.count_nonzero(between) > 2 * self._wall.lines
        return float(np.median(view.picture[between])) if enough else float("nan")

    def _best_level(
        self, view: Unrolled, prior: Prior, among: FloatArray
    ) -> tuple[FloatArray, float]:
        """Returns the most plausible of several flat surfaces (SHAPES,), and its score."""
        levels = np.tile(prior.centre, (among.size, 1))
        levels[:, 0] += among
        likely = [self.plausible_heights(view, heights, prior) for heights in levels]
        best = int(np.argmax(likely))
        return levels[best], likely[best]

    def _without_strays(self, view: Unrolled, fit: SurfaceFit, prior: Prior) -> SurfaceFit:
        """Repeats the fit of a level surface without outliers, such as points on a label."""
        known = ~np.isnan(fit.front_error) & ~fit.points.bound
        if not np.any(known):
            return fit
        off = np.abs(fit.front_error - np.median(fit.front_error[known]))
        usual = ROBUST * float(np.median(off[known]))
        strays = known & (
            off > max(TUNING.stray * usual, TUNING.stray_rows * self._wall.footprint)
        )
        if not np.any(strays):
            return fit
        points = replace(
            fit.points,
            place=np.where(strays, np.nan, fit.points.place),
            height=np.where(strays, np.nan, fit.points.height),
        )
        return self._fitter.again(view, replace(fit, points=points), prior, USUAL_FADE)

    def _further_candidates(self, view: Unrolled, points: WallPoints, prior: Prior) -> FloatArray:
        """Returns more initial surfaces (N, SHAPES) for an ambiguous contact line.

        The ends of liquid and of what is far from liquid are tried, on the front and on the rear
        wall: where the free surface looks like the liquid, the liquid's end is the upper edge.
        """
        first = self._wall.first_row
        level = np.zeros(self._wall.lines)
        bright = edge_search.liquid_tops(
            view.picture, self._wall.inside, level, TUNING.far_from_liquid
        )
        starts = []
        for place in (points.place, bright.astype(np.float64)):
            for table in (self._wall.near, self._wall.far):
                found = edge_search.table_at(table, place)
                azimuth = np.arctan2(found[:, 1], found[:, 0])
                more, _ = self._candidates(azimuth, found[:, 2], place <= first + 1, prior)
                starts.append(more)
        return np.vstack(starts)

    def _most_likely(self, view: Unrolled, starts: FloatArray) -> FloatArray:
        """Returns those few clearly different initial surfaces that agree best with the image."""
        scores = np.array([self._score(view, heights) for heights in starts])
        chosen: list[FloatArray] = []
        for index in np.argsort(-scores):
            start = starts[index]
            if all(
                np.hypot(*(start - other)[1:3]) > TUNING.different_rows * self._wall.footprint
                for other in chosen
            ):
                chosen.append(start)
            if len(chosen) == TUNING.tried:
                break
        return np.array(chosen)

    def _score(self, view: Unrolled, heights: FloatArray) -> float:
        """Scores a surface's agreement with the image, using every fourth scan line."""
        upper = self._wall.silhouette(heights, view.softness, coarse=True)
        score = edge_search.surface_score(
            view.picture[:, ::SKIP],
            view.backdrop[:, ::SKIP],
            view.stationary[:, :, ::SKIP],
            view.surface,
            view.hidden,
            self._wall.front_rows(heights)[::SKIP],
            upper,
            self._wall.first_row[::SKIP],
            self._wall.last_row[::SKIP],
        )
        return float(score)

    def _candidates(
        self, azimuth: FloatArray, height: FloatArray, bound: BoolArray, prior: Prior
    ) -> tuple[FloatArray, FloatArray]:
        """Returns initial surfaces (N, SHAPES) through wall points, with their agreement."""
        offset = silhouette.wall_shapes_of(azimuth) @ prior.centre
        known = np.where(bound | np.isnan(azimuth), np.nan, height - offset)
        agree, highest = (
            TUNING.agree_rows * self._wall.footprint,
            TUNING.highest * self._wall.radius,
        )
        first, shares = first_mode_candidates(
            azimuth, known, agree, self._pairs, TUNING.candidates, highest
        )
        starts = np.tile(prior.centre, (len(first), 1))
        starts[:, 1:3] += first
        return starts, shares


@compiled
def _agreement(cosine, sine, height, scale, x, y):  # type: ignore[no-untyped-def]
    """Counts the points that agree with an assumed first mode, using every third point."""
    total = 0.0
    for k in range(0, height.size, 3):
        if not np.isnan(height[k]):
            error = x * cosine[k] + y * sine[k] - height[k]
            total += 3.0 * max(0.0, 1.0 - abs(error) / scale)
    return total


@entry_point(
    Tuple((float64[:, ::1], float64[::1]))(
        GIVEN_1, GIVEN_1, float64, given(int64, 2), int64, float64
    )
)
def first_mode_candidates(azimuth, height, scale, pairs, count, highest):  # type: ignore[no-untyped-def]
    """Returns first-mode candidates that pass through pairs of points, best agreement first.

    Args:
        azimuth: (N,) [rad]. height: (N,) [m]; NaN where unknown.
        scale: deviation beyond which a point does not agree; candidates differ by more [m].
        pairs: (P, 2) indices of lines.
        highest: first mode that liquid can have [m].

    Returns:
        (count, 2) heights at +x and at +y [m], and (count,) shares of points that agree; rest is
        the one candidate where no pair gives another.
    """
    known = max(np.count_nonzero(~np.isnan(height)), 1)
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    tried = np.zeros((pairs.shape[0] + 1, 2))
    score = np.full(pairs.shape[0] + 1, -1.0)
    score[0] = _agreement(cosine, sine, height, scale, 0.0, 0.0)
    for p in range(pairs.shape[0]):
        i, j = pairs[p]
        if np.isnan(height[i]) or np.isnan(height[j]):
            continue
        ci, si, cj, sj = cosine[i], sine[i], cosine[j], sine[j]
        determinant = ci * sj - cj * si
        if abs(determinant) < 0.3:
            continue
        x = (height[i] * sj - height[j] * si) / determinant
        y = (ci * height[j] - cj * height[i]) / determinant
        if np.hypot(x, y) > highest:
            continue
        tried[p + 1] = x, y
        score[p + 1] = _agreement(cosine, sine, height, scale, x, y)
    best = np.zeros((count, 2))
    share = np.zeros(count)
    for c in range(count):
        top = int(np.argmax(score))
        if score[top] < 0.0:
            return best[:c], share[:c]
        best[c] = tried[top]
        share[c] = score[top] / known
        for p in range(score.size):
            if np.hypot(tried[p, 0] - best[c, 0], tried[p, 1] - best[c, 1]) < scale:
                score[p] = -1.0
    return best, share
