"""Intermediate results of one image: unrolled wall, contact-line points and fitted surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from slosh_camera.cylinder.tuning import TUNING

FloatArray = NDArray[np.float64]
Single = NDArray[np.float32]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Unrolled:
    """The container wall of one image, unrolled to a plane.

    Attributes:
        picture: (J, M), liquid 0, background 1.
        backdrop: (J, M) what should be seen above the liquid, at most 1.
        stationary: (2, J, M) steps that edges must exceed to be told from those that stood there
            in the still image.
        surface: what the free surface looked like at rest, on the picture's scale; NaN: unknown.
        hidden: a line against which more than this speaks is hidden, by a label or the like; inf:
            none is.
        noise: standard deviation of a sample.
        softness: width of its edges [rows].
        clipped: the background is white in the image, and so may be what is not background.
    """

    picture: Single
    backdrop: Single
    stationary: Single
    surface: float
    hidden: float
    noise: float
    softness: float
    clipped: bool

    @property
    def scatters(self) -> bool:
        """Whether the free surface looks like the liquid below it, as that of milk does.

        Such a liquid scatters light, as milk does: it ends at the upper edge, and its contact line
        is a mere shade. Other surfaces mirror what is around them.
        """
        return self.surface < TUNING.like_liquid


@dataclass(frozen=True, slots=True, eq=False)
class WallPoints:
    """Points of the contact line on the front wall, one per scan line.

    Attributes:
        place: (M,) row along the line; NaN: none.
        azimuth: (M,) [rad].
        height: (M,) above the origin [m].
        shapes: (M, SHAPES) heights of all shapes there.
        bound: (M,) whether the surface may be higher: the line ends at the image's border.
        width: (M,) of the edge [samples].
        scale: (M,) standard deviation of the height [m].
    """

    place: FloatArray
    azimuth: FloatArray
    height: FloatArray
    shapes: FloatArray
    bound: BoolArray
    width: FloatArray
    scale: FloatArray

    def near(self, rows: FloatArray, reach: float) -> Self:
        """Keeps points at most `reach` rows from expected rows (M,); sets other points to NaN."""
        far = ~(np.abs(self.place - rows) <= reach) & ~self.bound
        place, height = (np.where(far, np.nan, value) for value in (self.place, self.height))
        return replace(self, place=place, height=height)


@dataclass(frozen=True, slots=True)
class FadeShare:
    """Degree to which wave crests fade into the background, 0 to 1, with its uncertainty.

    All where liquid ends level at the wall, none where it climbs there, for then the edge that is
    seen is its line on the wall.

    Attributes:
        mean: what is known of it.
        stddev: how well.
    """

    mean: float
    stddev: float


USUAL_FADE = FadeShare(TUNING.fade_mean, TUNING.fade_stddev)
"""What is known before any image is seen."""


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceFit:
    """Fitted amplitudes of the surface's mode shapes, and the agreement of the edges.

    Attributes:
        points: of the contact line.
        heights: (SHAPES,) [m] above the container's origin.
        covariance: (SHAPES, SHAPES) [m²], for a given share of the fade.
        fade: share of the fade that the crests show.
        by_fade: (SHAPES,) what a standard deviation of that share changes [m].
        front_error, front_weight: (M,) fit less point [m], and weight in [0, 1].
        upper_place: (M,) row of the upper edge; NaN: none.
        upper_azimuth: (M,) where its ray meets the rear wall [rad].
        upper_error, upper_weight: (M,) fit less edge [m], and weight.
        upper_scale: standard deviation that an upper edge is given [m].
        upper_part: (M,) place of touch on the way from the front (0) to the rear wall (1).
    """

    points: WallPoints
    heights: FloatArray
    covariance: FloatArray
    fade: FadeShare
    by_fade: FloatArray
    front_error: FloatArray
    front_weight: FloatArray
    upper_place: FloatArray
    upper_azimuth: FloatArray
    upper_error: FloatArray
    upper_weight: FloatArray
    upper_scale: float
    upper_part: FloatArray

    @property
    def edges(self) -> int:
        """Number of image edges that agree with the surface."""
        front = np.count_nonzero(self.front_weight > TUNING.inlier)
        return int(front + np.count_nonzero(self.upper_weight > TUNING.inlier))
