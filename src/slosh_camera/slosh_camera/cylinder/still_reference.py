"""Computes the detector's reference data from an image of the liquid at rest.

A clear liquid shows what is behind it. Then an edge of the background may end what is taken for
liquid more clearly than the surface does, in the still image as in those to come. So the still
image is measured like any other: what does not find the liquid at rest there, without being told,
finds no wave either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.appearance import looks_like_surroundings
from slosh_camera.cylinder.container_edges import ContainerEdges
from slosh_camera.cylinder.front_line import FrontBias, FrontLineFinder, no_edges, stationary_edges
from slosh_camera.cylinder.surface import SHAPES, Prior, SurfaceFit, Unrolled, WallPoints
from slosh_camera.cylinder.surface_choice import SurfaceChooser
from slosh_camera.cylinder.surface_comparison import SurfaceComparison
from slosh_camera.cylinder.surface_reading import surface_flags
from slosh_camera.cylinder.tuning import TUNING
from slosh_camera.cylinder.wall_geometry import ScanGrid, WallGeometry
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag
from slosh_camera.optics.cup import CupView

Image = NDArray[np.uint8]
FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]


# Flags of a line of which too little is seen to be a zero.
_NOT_WHOLE = Flag.NOT_FOUND | Flag.SATURATED


@dataclass(frozen=True, slots=True, eq=False)
class StillReference:
    """Reference data of the detector, from an image of the liquid at rest.

    Attributes:
        zero: (SHAPES,) heights of the surface at rest [m].
        comparison: of the surfaces that an image may show, with that zero.
        bodies: rows that show liquid, one after the other to be tried.
        surface: what the free surface looks like, see `Unrolled`; NaN: not known.
        stationary: edges that are not the liquid's, see `stationary_edges`.
        bias: what the contact line is off.
        surrounded: whether what is beside the container tells what is behind it.
        sure: whether it is known which of the edges is the liquid's.
        turn: of the container's sides against the calibration [rad].
    """

    zero: FloatArray
    comparison: SurfaceComparison
    bodies: tuple[slice, ...]
    surface: float
    stationary: Single
    bias: FrontBias
    surrounded: bool
    sure: bool
    turn: float


class StillReferenceFinder:
    """Computes the detector's reference data from images of the liquid at rest."""

    def __init__(
        self,
        view: CupView,
        grid: ScanGrid,
        wall: WallGeometry,
        chooser: SurfaceChooser,
        front: FrontLineFinder,
        edges: ContainerEdges,
    ) -> None:
        """Stores the detector's parts that are needed to compute the reference data."""
        self._view, self._grid, self._wall = view, grid, wall
        self._chooser, self._front, self._edges = chooser, front, edges
        radius, zero = view.cup.radius, np.zeros(SHAPES)
        self._moving = Prior(zero, first=TUNING.first_mode * radius)
        self._at_rest = Prior(
            zero,
            first=TUNING.still_tilt * radius,
            level=TUNING.level_stddev,
            higher=TUNING.at_rest,
        )
        azimuth = view.camera_azimuth
        self._nearest = radius * np.array((np.cos(azimuth), np.sin(azimuth)))

    def nothing(self) -> StillReference:
        """Returns the default reference data, used without an image of the liquid at rest."""
        zero = np.zeros(SHAPES)
        return StillReference(
            zero=zero,
            comparison=self._compared(self._moving),
            bodies=self._front.bodies,
            surface=float("nan"),
            stationary=no_edges(self._grid.shape),
            bias=FrontBias.unknown(zero, self._wall.lines),
            surrounded=False,
            sure=True,
            turn=0.0,
        )

    def learn(self, image: Image, unrolled: Image) -> StillReference:
        """Computes the reference data from an image of the liquid at rest.

        Args:
            image: (height, width) or (height, width, 3).
            unrolled: the same, along the scan lines.

        Raises:
            SloshCameraError: it shows no liquid at rest, or one that would be measured as
                something else.
        """
        turn = self._edges.turn(image)
        if self._edges.turned(image, 0.0):
            raise SloshCameraError(
                f"still image: the container's sides are turned by {np.degrees(turn):.1f} "
                "degrees against the calibration, calibrate the camera again"
            )
        clear = [self._is_clear(image, unrolled, body) for body in self._front.bodies]
        still = self._still_surface(image, unrolled, clear)
        is_clear = clear[self._front.bodies.index(still.body)]
        prior = replace(self._moving, centre=still.zero)
        # In one image all edges stand still: nothing tells those of the background as yet.
        found_again = is_found_again(still, self._compared_with(still.view, prior))
        sure = found_again and not (self._leans(still) or is_clear)
        if not sure:
            self._check_doubted(still, prior)
        # Of a doubted liquid it is not known which edge is its own.
        stationary = self._standing_edges(still) if sure else no_edges(self._grid.shape)
        view = replace(still.view, stationary=stationary)
        return StillReference(
            zero=still.zero,
            comparison=self._compared_with(view, prior),
            bodies=(still.body,),
            surface=view.surface,
            stationary=stationary,
            bias=self._bias(still),
            surrounded=not is_clear,
            sure=sure,
            turn=turn,
        )

    def _still_surface(self, image: Image, unrolled: Image, clear: list[bool]) -> StillSurface:
        """Detects the surface at rest; for clear liquid it also uses the surroundings."""
        unknown = no_edges(self._grid.shape)
        besides = [None if is_clear else image for is_clear in clear]
        seen = (
            (self._front.find(unrolled, body, unknown, float("nan"), beside), body)
            for body, beside in zip(self._front.bodies, besides, strict=True)
        )
        pictures = [(*found, body) for found, body in seen if found is not None]
        still = find_still_surface(self._chooser, pictures, self._at_rest, self._nearest)
        if still is None or surface_flags(self._wall, still.view, still.fit) & _NOT_WHOLE:
            raise SloshCameraError(
                "still image: shows no complete liquid line, check light, region and calibration"
            )
        return still

    def _leans(self, still: StillSurface) -> bool:
        """Whether the edges alone, without a prior, give a tilted surface for liquid at rest."""
        prior = replace(self._at_rest, first=TUNING.leaning * self._view.cup.radius)
        fit, _ = self._chooser.fit_still(still.view, still.points, prior)
        return self._chooser.is_suspect(fit)

    def _check_doubted(self, still: StillSurface, prior: Prior) -> None:
        """Raises an error if the level at rest is doubtful and far from the calibrated level."""
        if abs(still.zero[0]) > TUNING.level_stddev:
            raise SloshCameraError(
                f"still image: its line is {1e3 * still.zero[0]:+.0f} mm off the "
                "calibration's level, and may be an edge behind the liquid; check the fill "
                f"height, or {REMEDY}"
            )
        if self._chooser.plausible_heights(still.view, still.zero, prior) < TUNING.still_plausible:
            raise SloshCameraError(
                "still image: the contrast between the liquid and what is behind it is too "
                "low, and its line is hidden or faint at many of the examined places; remove "
                f"what hides the line, or {REMEDY}"
            )

    def _is_clear(self, image: Image, unrolled: Image, body: slice) -> bool:
        """Whether the liquid has the same colour as the container's surroundings."""
        tone = self._front.tone(unrolled, body)
        return tone is not None and looks_like_surroundings(image, self._grid.pixels[body], tone)

    def _compared(self, prior: Prior, at_rest: float = -np.inf) -> SurfaceComparison:
        """Creates the comparison of candidate surfaces, from a prior and the score at rest."""
        return SurfaceComparison(self._chooser, prior, self._wall.footprint, at_rest)

    def _compared_with(self, view: Unrolled, prior: Prior) -> SurfaceComparison:
        """Creates the comparison of candidate surfaces, and scores the surface at rest for it."""
        return self._compared(prior, self._chooser.plausible_heights(view, prior.centre, prior))

    def _bias(self, still: StillSurface) -> FrontBias:
        """Returns the contact line's height error at rest; one value for a low-contrast line."""
        if still.view.scatters:
            return FrontBias.unknown(still.zero, self._wall.lines)
        return FrontBias.at_rest(still.fit, still.zero, self._wall.footprint)

    def _standing_edges(self, still: StillSurface) -> Single:
        """Returns the edges in the image of the liquid at rest that are not the liquid's own."""
        fit, view = still.fit, still.view
        seen = (fit.front_weight > TUNING.inlier) & ~fit.points.bound
        front = np.where(seen, fit.points.place, np.nan)
        upper = np.where(fit.upper_weight > TUNING.inlier, fit.upper_place, np.nan)
        return stationary_edges(
            view.picture, np.stack((front, upper)), TUNING.edge_rows + view.softness
        )


REMEDY = "dye the liquid"
"""What was found to help."""


@dataclass(frozen=True, slots=True, eq=False)
class StillSurface:
    """The free surface that was detected in an image of the liquid at rest.

    Attributes:
        view: the picture, with what the free surface looks like in it.
        body: rows that show liquid.
        zero: (SHAPES,) heights of the surface at rest [m]: its level and its tilt.
    """

    view: Unrolled
    points: WallPoints
    fit: SurfaceFit
    body: slice
    zero: FloatArray


def find_still_surface(
    chooser: SurfaceChooser,
    seen: Sequence[tuple[Unrolled, WallPoints, slice]],
    prior: Prior,
    nearest: FloatArray,
) -> StillSurface | None:
    """Finds the most plausible level surface in an image of the liquid at rest.

    Args:
        seen: pictures, points of the contact line and rows of liquid, the usual ones first.
        prior: of the heights of liquid at rest.
        nearest: (2,) the place of the wall that is nearest to the camera, from the axis [m].

    Returns:
        The surface; None where there is no picture.
    """
    found: list[tuple[float, StillSurface]] = []
    for view, points, body in seen:
        fit, plausible = chooser.fit_still(view, points, prior)
        tone = chooser.surface_tone(view, _at_rest(fit, nearest))
        view = replace(view, surface=tone)
        if np.isfinite(tone):
            # Fitted anew: how the surface looks tells which edges end it.
            again, likely = chooser.fit_still(view, points, prior)
            if view.scatters or not chooser.is_suspect(again):
                fit, plausible = again, likely
        still = StillSurface(view, points, fit, body, _at_rest(fit, nearest))
        found.append((plausible - (TUNING.second_body if found else 0.0), still))
    return max(found, key=lambda entry: entry[0])[1] if found else None


def is_found_again(still: StillSurface, comparison: SurfaceComparison) -> bool:
    """Whether normal measurement of the liquid at rest clearly detects the level surface.

    Args:
        still: the liquid at rest, as it was found by what is known of it.

    Raises:
        SloshCameraError: it shows another surface.
    """
    choice = comparison.choose(comparison.sighting(((still.view, still.points),)), None)
    if not choice.believed:
        return False
    height = float(np.hypot(*comparison.first(choice.candidate.fit)))
    if height > TUNING.still_wave:
        raise SloshCameraError(
            f"still image: the liquid at rest would be measured as a wave of {1e3 * height:.0f} "
            f"mm, by an edge that is seen through it; {REMEDY}"
        )
    return not choice.doubtful


def _at_rest(fit: SurfaceFit, nearest: FloatArray) -> FloatArray:
    """Returns level and tilt (SHAPES,) [m] of a surface fitted to liquid at rest.

    What bends a contact line by some tenths of a millimetre, an uneven wall or what mirrors in the
    liquid's end, reads as a tilt towards the camera of a millimetre at the rear wall. So where
    that line is all that is seen, the calibration knows the tilt better.
    """
    heights, covariance = fit.heights[:3].copy(), fit.covariance[:3, :3]
    if (
        np.count_nonzero(fit.upper_weight > TUNING.inlier)
        < TUNING.least_upper * fit.upper_weight.size
    ):
        radius = float(np.hypot(*nearest))
        towards = np.concatenate(([0.0], nearest / radius))
        spread = covariance @ towards
        variance = float(towards @ spread) + (TUNING.tilt_towards * radius) ** 2
        heights -= spread * float(towards @ heights) / variance
    return np.concatenate((heights, np.zeros(SHAPES - 3)))
