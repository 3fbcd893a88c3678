"""Detects the contact line on the front wall: the upper end of liquid on each scan line.

Colours become one axis from liquid to background; what is low on the wall is taken for liquid, and
the end of what looks like it is found on every line, then to a fraction of a row. Edges that stand
in the image of the liquid at rest too, of a label or of what is behind, are none of the liquid's.

An uneven wall bends a line, and where front and rear line are one edge in the image, what is found
lies between them. A surface that is fitted to such a contact line alone leans towards the camera
or away from it. The liquid at rest is level, so that its image tells; once the line has risen or
fallen by some rows, it is seen through another place of the wall, and apart from the other line.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numba.types import float64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import GIVEN_1, entry_point
from slosh_camera.cylinder import edge_search
from slosh_camera.cylinder.appearance import Backdrop, Tone, find_tone, median, percentile
from slosh_camera.cylinder.edge_search import PICTURE, STEPS, fall_above, has_stood
from slosh_camera.cylinder.surface import SurfaceFit, Unrolled, WallPoints
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import ScanGrid, WallGeometry
from slosh_camera.measurement import Flag
from slosh_camera.settings import DetectionSettings, LiquidContrast

Image = NDArray[np.uint8]
Single = NDArray[np.float32]
FloatArray = NDArray[np.float64]


# Parts of the way from the still level to the lowest row between which there is mostly liquid:
# below the deepest trough, or higher up, where a transparent liquid does not show the floor.
_BODIES = (0.5, 1.0), (0.1, 0.5)
# Every so many rows and lines suffice to tell how light an image is.
_SPARSE = 4


class FrontLineFinder:
    """Detects the front contact line in unrolled images of one container wall.

    Attributes:
        bodies: the rows, below the deepest trough or higher up, that are mostly liquid.
    """

    def __init__(
        self,
        grid: ScanGrid,
        wall: WallGeometry,
        settings: DetectionSettings,
        size: tuple[int, int],
    ) -> None:
        self._grid, self._wall, self._settings = grid, wall, settings
        self._backdrop = Backdrop(grid.pixels, size)
        self._above = (int(np.min(wall.first_row)) + grid.still_row) // 2
        self.bodies = tuple(self._rows(body) for body in _BODIES)

    def tone(self, unrolled: Image, body: slice) -> Tone | None:
        """Determines the colour axis from liquid to background, or None if there is no liquid.

        Args:
            unrolled: (rows, lines, channels) the wall.
        """
        return find_tone(unrolled, self._grid.inside, body, self._above)

    def find(
        self,
        unrolled: Image,
        body: slice,
        stationary: Single,
        surface: float,
        beside: Image | None = None,
    ) -> tuple[Unrolled, WallPoints] | None:
        """Projects the wall's colours on an axis and detects the upper end of the liquid.

        Args:
            unrolled: (rows, lines, channels) the wall.
            stationary: edges that stand still, as `stationary_edges` gives them.
            surface: how the free surface looks on the axis; NaN: not known.
            beside: the image, where the still one was accepted: what is beside the container tells
                what is behind it, and lines may be hidden by a label; None: the background is as
                light everywhere, and no line is hidden.

        Returns:
            None where liquid and background do not differ as the settings ask for.
        """
        tone = self.tone(unrolled, body)
        if tone is None or not self._believable(tone):
            return None
        picture = tone.reduce(unrolled)
        first, last = self._wall.first_row, self._wall.last_row
        level = edge_search.liquid_levels(picture, body.start, body.stop, TUNING.level_reach)
        unknown = np.isnan(level)
        if unknown.all():
            return None
        if unknown.any():
            level = np.where(unknown, np.nanmedian(level), level)
        spread = edge_search.usual_deviation(picture, level, body.start, body.stop)
        tolerance = max(
            TUNING.tolerance, TUNING.tolerance_noise * tone.noise, TUNING.tolerance_spread * spread
        )
        row = edge_search.liquid_tops(picture, self._wall.inside, level, tolerance)
        place, width = edge_search.refine_edges(picture, row, first, last)
        known = width[np.isfinite(width)]
        softness = float(median(known)) if known.size else TUNING.sharp_rows
        clipped = bool(np.all(tone.background >= TUNING.white))
        if beside is None:
            behind, hidden = np.ones_like(picture), np.inf
        else:
            behind, hidden = self._backdrop.reduced(beside, tone), TUNING.hidden_line
        view = Unrolled(
            picture, behind, stationary, surface, hidden, tone.noise, softness, clipped
        )
        place = moved_edges(picture, stationary, place)
        return view, self._wall.wall_points(place, width, row <= first)

    def why_none(self, unrolled: Image) -> Flag:
        """Returns flags that explain why no liquid is visible, such as a dark image."""
        sparse = unrolled[::_SPARSE, ::_SPARSE]
        seen = sparse[self._grid.inside[::_SPARSE, ::_SPARSE]].reshape(-1, 1)
        dark, bright = percentile(seen, 2.0)[0], percentile(seen, 98.0)[0]
        if bright < self._settings.max_dark:
            return Flag.TOO_DARK | Flag.NOT_FOUND
        if dark > self._settings.min_bright:
            return Flag.TOO_BRIGHT | Flag.NOT_FOUND
        return Flag.NOT_FOUND

    def _rows(self, parts: tuple[float, float]) -> slice:
        """Returns the wall rows between two fractions of the depth below the level at rest."""
        below = self._grid.shape[0] - self._grid.still_row
        top, bottom = (self._grid.still_row + int(part * below) for part in parts)
        return slice(top, bottom)

    def _believable(self, tone: Tone) -> bool:
        """Whether liquid and background differ enough, and the expected one is the lighter."""
        bright = max(float(np.max(tone.liquid)), float(np.max(tone.background)))
        if tone.contrast < self._settings.min_contrast or bright < self._settings.max_dark:
            return False
        lighter = float(np.mean(tone.liquid)) > float(np.mean(tone.background))
        expected = self._settings.liquid
        return expected is LiquidContrast.ANY or (expected is LiquidContrast.LIGHTER) == lighter


@dataclass(frozen=True, slots=True, eq=False)
class FrontBias:
    """Systematic height error of the front contact line, measured on the liquid at rest.

    Attributes:
        zero: (SHAPES,) heights of the surface at rest [m].
        offset: (M,) of the line's points above it [m]; 0 where nothing is known.
        holds: standard deviation of the rise over which the offset changes [m].
    """

    zero: FloatArray
    offset: FloatArray
    holds: float

    @classmethod
    def unknown(cls, zero: FloatArray, lines: int) -> Self:
        """Returns a bias of zero for a number of scan lines, for an unknown surface at rest."""
        return cls(zero, np.zeros(lines), 1.0)

    @classmethod
    def at_rest(cls, fit: SurfaceFit, zero: FloatArray, footprint: float) -> Self:
        """Estimates the contact line's bias from a fit to the image of the liquid at rest.

        Args:
            fit: the points that agree with it count.
            zero: (SHAPES,) heights of the surface at rest [m].
            footprint: of a row on the wall [m].
        """
        points = fit.points
        known = (fit.front_weight > TUNING.inlier) & ~points.bound
        above = np.where(known, points.height - points.shapes @ zero, 0.0)
        window = np.ones(TUNING.bias_lines)
        count = np.convolve(known.astype(np.float64), window, "same")
        offset = np.convolve(above, window, "same") / np.maximum(count, 1.0)
        return cls(zero, np.where(known, offset, 0.0), TUNING.bias_rows * footprint)

    def removed(self, points: WallPoints) -> WallPoints:
        """Subtracts the bias from contact-line points (M,), fully at rest level, less above it."""
        rise = points.height - points.shapes @ self.zero - self.offset
        part = np.exp(-0.5 * np.square(rise / self.holds))
        return replace(points, height=points.height - part * self.offset)


def no_edges(shape: tuple[int, int]) -> Single:
    """Returns an empty map of edges, used without an image of the liquid at rest."""
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
