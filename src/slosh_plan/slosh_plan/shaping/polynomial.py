"""The residual-free polynomial: a time law whose acceleration has no part at a mode's poles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from slosh_model.motion_profiles import quintic
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.known_laws import UnitLaw
from slosh_plan.shaping.filters import Damped

Array = NDArray[np.float64]

TERMS = 6
_POINTS = 400
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_POINTS)
_U: Array = 0.5 * (_NODES + 1.0)
_BACKWARDS = -1e-9


def residual_free(mode: Damped, duration: float) -> UnitLaw:
    """The law from 0 to 1 of the thirteenth degree that leaves no wave of a linear mode.

    To the quintic polynomial u⁴ (1 − u)⁴ Σ cₖ (1 − 2u)ᵏ, k = 0 … 5, is added, which leaves the
    ends as they are. The cₖ make ∫ s̈ exp(−p t) dt zero at the mode's pole p, two real equations;
    of all that do, they add the least acceleration in the mean square. Fewer terms would run
    backwards at many durations.

    Args:
        mode: the mode.
        duration: of the motion [s].

    Raises:
        SloshPlanError: so short or so long a motion would run backwards on its way.
    """
    coefficients = _coefficients(mode, duration)

    def law(u: Array) -> tuple[Array, Array, Array]:
        inside = np.clip(u, 0.0, 1.0)
        first, second = quintic(inside), _added(inside)
        place, rate, change = (
            one + coefficients @ more for one, more in zip(first, second, strict=True)
        )
        return place, rate, change

    rate = law(np.linspace(0.0, 1.0, 2001))[1]
    if rate.min() < _BACKWARDS * max(rate.max(), 1.0):
        raise SloshPlanError(
            f"a motion of {duration:.3g} s, {duration / mode.period:.1f} periods of the liquid, "
            "has no residual-free polynomial that does not run backwards: choose another "
            "duration, or a filter"
        )
    return law


def _coefficients(mode: Damped, duration: float) -> Array:
    """(TERMS,) cₖ."""
    pole = complex(-mode.decay, mode.damped_frequency)
    # As seen at the motion's end: at most 1 in size, so that long motions do not overflow.
    wave = _WEIGHTS * np.exp(pole * duration * (1.0 - _U))
    more = _added(_U)[2]
    parts, own = more @ wave, quintic(_U)[2] @ wave
    equations = np.stack([parts.real, parts.imag])
    squares = (more * _WEIGHTS) @ more.T
    eased = np.linalg.solve(squares, equations.T)
    right = -np.array([own.real, own.imag])
    return np.asarray(eased @ np.linalg.lstsq(equations @ eased, right, rcond=1e-12)[0])


def _added(u: Array) -> tuple[Array, Array, Array]:
    """(TERMS, N) u⁴(1 − u)⁴(1 − 2u)ᵏ: value, first and second derivative."""
    v, w = u * (1.0 - u), 1.0 - 2.0 * u
    # With v' = w and w' = -2; a negative power only comes with the factor 0.
    powers = [np.zeros_like(w), np.zeros_like(w), *(w**n for n in range(TERMS + 2))]
    rows = [
        (
            v**4 * powers[k + 2],
            4.0 * v**3 * powers[k + 3] - 2.0 * k * v**4 * powers[k + 1],
            12.0 * v**2 * powers[k + 4]
            - (16.0 * k + 8.0) * v**3 * powers[k + 2]
            + 4.0 * k * (k - 1.0) * v**4 * powers[k],
        )
        for k in range(TERMS)
    ]
    value, rate, change = (np.stack(column) for column in zip(*rows, strict=True))
    return value, rate, change
