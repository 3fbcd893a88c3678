"""Detects the contact line on the front wall: the upper end of liquid on each scan line.

Colours become one axis from liquid to background; what is low on the wall is taken for liquid, and
the end of what looks like it is found on every line, then to a fraction of a row.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder import edge_search
from slosh_camera.cylinder.appearance import Tone, find_tone, percentile
from slosh_camera.cylinder.medians import median
from slosh_camera.cylinder.scan_grid import ScanGrid
from slosh_camera.cylinder.stationary_edges import moved_edges
from slosh_camera.cylinder.surface_evidence import Unrolled, WallPoints
from slosh_camera.cylinder.surroundings import Backdrop
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import WallGeometry
from slosh_camera.measurement import Flag
from slosh_camera.settings import DetectionSettings, LiquidContrast

Image = NDArray[np.uint8]
Single = NDArray[np.float32]

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
            body: rows of the liquid.
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
            body: rows of the liquid.
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
