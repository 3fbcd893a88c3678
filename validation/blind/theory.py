"""Formulae for a cup's sloshing constants from the literature, independent of slosh_model.

Written from the sources alone, with SciPy's Bessel functions: nothing here comes from slosh_model.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]

GRAVITY = 9.81
MODES = 2
ROOTS: Array = np.asarray(special.jnp_zeros(1, MODES), dtype=float)
"""ξ₁, ξ₂: where J₁′ is zero."""


def frequency_squared(radius: float, depth: Array) -> Array:
    """Returns ωₙ² [rad²/s²] of two modes (..., 2) for liquid depths [m] (DL22, eq. (3))."""
    reach = np.multiply.outer(depth, ROOTS) / radius
    return np.asarray(GRAVITY * ROOTS / radius * np.tanh(reach))


def planar_gain(radius: float, depth: Array) -> Array:
    """Returns the height gain (..., 2) of a plane surface, 4 h mₙ/(m_F R) (DL22, eq. (28))."""
    tanh = np.tanh(np.multiply.outer(depth, ROOTS) / radius)
    return np.asarray(8.0 * tanh / (ROOTS * (ROOTS**2 - 1.0)))


def bessel_gain(radius: float, depth: Array) -> Array:
    """Returns the height gain (..., 2) of a Bessel surface (DL22, eqs. (4), (30))."""
    tanh = np.tanh(np.multiply.outer(depth, ROOTS) / radius)
    return np.asarray(2.0 * ROOTS * tanh / (ROOTS**2 - 1.0))


def empirical_damping_ratio(radius: float, depth: Array, viscosity: float) -> Array:
    """Returns a cylinder's damping ratio ζ by an empirical formula (Ibrahim 2005; Dodge 2000)."""
    filling = np.asarray(depth) / radius
    bottom = 1.0 + (1.0 - filling) / np.cosh(1.84 * filling)
    size = 0.92 * np.sqrt(viscosity / np.sqrt(GRAVITY * radius**3))
    return np.asarray(size * (1.0 + 0.318 / np.sinh(1.84 * filling) * bottom))
