"""Roots of J₁′ and the free surface's radial shape."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import j1, jnp_zeros

from slosh_model.errors import SloshModelError

MAXIMUM_MODE = 200


def check_mode(n: int) -> None:
    """Raises SloshModelError unless n is in 1 … MAXIMUM_MODE."""
    if not 1 <= n <= MAXIMUM_MODE:
        raise SloshModelError(f"mode = {n} must lie in 1 … {MAXIMUM_MODE}")


@cache
def bessel_derivative_root(n: int) -> float:
    """The n-th positive root ξₙ of J₁′, n ≥ 1 (DL22, eq. (3)): 1.8412, 5.3314 and so on.

    Raises:
        SloshModelError: n is not in 1 … MAXIMUM_MODE.
    """
    check_mode(n)
    return float(jnp_zeros(1, n)[-1])


def radial_shape(n: int, relative_radius: ArrayLike) -> NDArray[np.float64]:
    """J₁(ξₙ r/R) / J₁(ξₙ), equal to 1 at the wall (DL22, eq. (19)).

    Args:
        n: mode.
        relative_radius: r/R, any shape.

    Returns:
        the shape at each radius, same shape as the argument.
    """
    xi = bessel_derivative_root(n)
    return np.asarray(j1(xi * np.asarray(relative_radius, dtype=np.float64)) / j1(xi))
