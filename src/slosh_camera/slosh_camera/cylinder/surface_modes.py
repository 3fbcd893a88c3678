"""Mode shapes of the free surface that are fitted to camera images [DL22, eqs. (18), (19)].

Over the cross-section of radius 1: the still level, the first and the second mode that a lateral
acceleration excites, J₁(ξ₁₁ρ) and J₁(ξ₁₂ρ), and the two shapes that the first mode drives at
second order, J₀(ξ₀₁ρ) (crests and troughs of unequal height all around) and J₂(ξ₂₁ρ) (sharper
crests).
All but the level have the height 1 at the wall at their highest place.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_model.bessel import bessel_derivative_root

FloatArray = NDArray[np.float64]

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
