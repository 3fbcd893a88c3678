"""The free surface in one image: its mode shapes, their prior, the evidence and the fit.

The mode shapes [DL22, eqs. (18), (19)] over the cross-section of radius 1: the still level, the
first and the second mode that a lateral acceleration excites, J₁(ξ₁₁ρ) and J₁(ξ₁₂ρ), and the two
shapes that the first mode drives at second order, J₀(ξ₀₁ρ) (crests and troughs of unequal height
all around) and J₂(ξ₂₁ρ) (sharper crests). All but the level have the height 1 at the wall at their
highest place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_camera.cylinder.tuning import TUNING
from slosh_model.bessel import bessel_derivative_root

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


_TERMS = 14
# First positive roots of J₀′ and J₂′, as SciPy gives them: the camera starts without loading it.
_MEAN_ROOT, _DOUBLE_ROOT = 3.831705970207512, 3.054236928227140


class Shape(IntEnum):
    """Index of a mode shape; FIRST_X has its crest at the container's +x, FIRST_Y at +y."""

    LEVEL = 0
    FIRST_X = 1
    FIRST_Y = 2
    SECOND_X = 3
    SECOND_Y = 4
    MEAN = 5
    DOUBLE_X = 6
    DOUBLE_Y = 7


SHAPES = len(Shape)


def _series(order: int, root: float) -> FloatArray:
    """Returns the power series coefficients in ρ² of J_m(ξρ)/(J_m(ξ) ρ^m)."""
    half = 0.5 * root
    terms = np.array(
        [
            (-1.0) ** k * half ** (2 * k + order) / (math.factorial(k) * math.factorial(k + order))
            for k in range(_TERMS)
        ]
    )
    series: FloatArray = terms / math.fsum(terms)
    return series


RADIAL = np.array(
    [
        _series(1, bessel_derivative_root(1)),
        _series(1, bessel_derivative_root(2)),
        _series(0, _MEAN_ROOT),
        _series(2, _DOUBLE_ROOT),
    ]
)
"""(4, terms) power series in ρ² of first, second, mean and double shape."""

RADIAL_STEPS = 512
RADIAL_TABLE = (np.arange(RADIAL_STEPS + 2) / RADIAL_STEPS)[:, np.newaxis] ** np.arange(
    _TERMS
) @ RADIAL.T
"""(steps + 2, 4) the same by ρ² in equal steps; heights of shapes from it are right to 1e-5."""


def shapes_at(x: ArrayLike, y: ArrayLike) -> FloatArray:
    """Returns the heights of all mode shapes at positions on the surface.

    >>> shapes_at(0.0, 0.0)[0, [Shape.LEVEL, Shape.FIRST_X]].tolist()  # on the axis
    [1.0, 0.0]

    Args:
        x, y: place over the cross-section in radii, (N,).

    Returns:
        (N, SHAPES).
    """
    x, y = np.atleast_1d(np.asarray(x, dtype=np.float64)), np.atleast_1d(np.asarray(y, float))
    square = x * x + y * y
    powers = square[:, np.newaxis] ** np.arange(_TERMS)
    first, second, mean, double = RADIAL @ powers.T
    return np.column_stack(
        (
            np.ones_like(x),
            first * x,
            first * y,
            second * x,
            second * y,
            mean,
            double * (x * x - y * y),
            double * 2.0 * x * y,
        )
    )


def wall_shapes(azimuth: ArrayLike) -> FloatArray:
    """Returns the heights of all mode shapes on the wall, (N, SHAPES), at azimuths (N,) [rad].

    >>> wall_shapes([0.0])[0, [Shape.FIRST_X, Shape.FIRST_Y]].round(3).tolist()
    [1.0, 0.0]
    """
    angle = np.atleast_1d(np.asarray(azimuth, dtype=np.float64))
    return shapes_at(np.cos(angle), np.sin(angle))


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Prior distribution of the mode amplitudes, before an image is used.

    Attributes:
        centre: (SHAPES,) [m], at rest.
        first: standard deviation of the first mode [m].
        level: of the level [m].
        higher: part of their usual standard deviation that the higher shapes have; hardly any at
            rest.
        rare: what each of these surfaces takes from the agreement with a picture.
    """

    centre: FloatArray
    first: float
    level: float = 3e-4
    higher: float = 1.0
    rare: float = 0.0

    def of_changed_level(self) -> Self:
        """Returns the prior for liquid that has been added or removed."""
        return replace(self, level=TUNING.level_stddev, rare=TUNING.rare)

    def at_rest_on_changed_level(self) -> Self:
        """Returns the prior for a changed liquid level at rest."""
        return replace(
            self,
            first=TUNING.at_rest * self.first,
            level=TUNING.level_stddev,
            higher=TUNING.at_rest,
            rare=TUNING.rare_at_rest,
        )

    def conditional(
        self, heights: FloatArray, radius: float, *, front_alone: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Returns mean and inverse covariance of the mode amplitudes [m] for a known first mode.

        The shapes of second order grow with the square of the first mode. Crests are sharper than
        troughs: the double shape has its crest where the first mode has it. A contact line alone
        cannot tell these shapes from the first, so they are held tighter then.

        Args:
            heights: (SHAPES,) of which the first mode counts [m].
            radius: of the container [m].
            front_alone: whether there is no upper edge.
        """
        x, y = heights[1:3] - self.centre[1:3]
        size, square = float(np.hypot(x, y)), float(x * x + y * y) / radius
        tight = self.higher * (0.3 if front_alone else 1.0)
        second = tight * (3e-4 + 0.05 * size)
        mean = tight * (1e-4 + 0.25 * square)
        along, across = tight * (1e-4 + 0.25 * square), tight * (1e-4 + 0.12 * square)
        spread = (self.level, self.first, self.first, second, second, mean)
        precision = np.zeros((SHAPES, SHAPES))
        np.fill_diagonal(precision[:6, :6], np.power(spread, -2.0))
        # The double shape's crest turns by twice the azimuth.
        c, s = ((x * x - y * y) / size**2, 2.0 * x * y / size**2) if size > 0.0 else (1.0, 0.0)
        p, q = along**-2.0, across**-2.0
        precision[6:, 6:] = (
            (c * c * p + s * s * q, c * s * (p - q)),
            (c * s * (p - q), s * s * p + c * c * q),
        )
        centre = self.centre.copy()
        centre[6] += 0.15 * tight * square * c
        centre[7] += 0.15 * tight * square * s
        return centre, precision

    def surprise(self, heights: FloatArray, radius: float) -> float:
        """Returns how improbable mode amplitudes (SHAPES,) [m] are under the prior."""
        centre, precision = self.conditional(heights, radius)
        deviation = heights - centre
        return self.rare + TUNING.prior_surprise * float(deviation @ precision @ deviation)
