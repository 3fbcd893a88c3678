"""Roots of J₁′, and the radial shape of the free surface in a cylinder."""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from slosh_model.errors import SloshModelError

MAXIMUM_MODE = 200

_FIRST_ROOTS = (
    1.8411837813406595, 5.3314427735250325, 8.536316366346286, 11.706004902592063,
    14.863588633909034, 18.015527862681804, 21.164369859188792, 24.311326857210776,
    27.457050571059245, 30.601922972669094,
)  # fmt: skip
"""As SciPy gives them: a process that needs no more starts without loading it (0.25 s)."""


def check_mode(n: int) -> None:
    """Raises SloshModelError unless n is in 1 … MAXIMUM_MODE."""
    if not 1 <= n <= MAXIMUM_MODE:
        raise SloshModelError(f"mode = {n} must lie in 1 … {MAXIMUM_MODE}")


@cache
def bessel_derivative_root(n: int) -> float:
    """Returns the n-th positive root ξₙ of J₁′, n ≥ 1 (DL22, eq. (3)): 1.8412, 5.3314, ….

    Raises:
        SloshModelError: n is not in 1 … MAXIMUM_MODE.
    """
    check_mode(n)
    if n <= len(_FIRST_ROOTS):
        return _FIRST_ROOTS[n - 1]
    return float(scipy.special.jnp_zeros(1, n)[-1])


def radial_shape(n: int, relative_radius: ArrayLike) -> NDArray[np.float64]:
    """Returns J₁(ξₙ r/R) / J₁(ξₙ), which is 1 at the wall (DL22, eq. (19)).

    Args:
        n: mode.
        relative_radius: r/R, any shape.

    Returns:
        the shape at each radius, same shape as the argument.
    """
    xi = bessel_derivative_root(n)
    argument = xi * np.asarray(relative_radius, dtype=np.float64)
    return np.asarray(scipy.special.j1(argument) / scipy.special.j1(xi))
