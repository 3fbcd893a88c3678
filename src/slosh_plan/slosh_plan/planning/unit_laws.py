"""Standard time laws from 0 to 1, at rest at both ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from slosh_base.types import Array
from slosh_model.motion_profiles import cycloidal, modified_trapezoid, quintic
from slosh_plan.planning.time_law import JerkLaw

UnitLaw = Callable[[Array], tuple[Array, Array, Array]]
"""Share of the duration to that of the way, and its first two derivatives."""


def septic(u: Array) -> tuple[Array, Array, Array]:
    """Evaluates 35u⁴ − 84u⁵ + 70u⁶ − 20u⁷, which has a continuous jerk."""
    u = np.clip(u, 0.0, 1.0)
    rest = 1.0 - u
    place = u**4 * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)))
    rate = 140.0 * (u * rest) ** 3
    return place, rate, 420.0 * (u * rest) ** 2 * (1.0 - 2.0 * u)


def _steady(share: float) -> UnitLaw:
    """Returns a time law with constant speed between two smooth ramps, for curved paths."""

    def law(u: Array) -> tuple[Array, Array, Array]:
        u = np.clip(u, 0.0, 1.0)
        second = u > 0.5
        x = np.minimum(np.where(second, 1.0 - u, u) / share, 1.0)
        top = 1.0 / (1.0 - share)
        ramp = x**4 * (2.5 + x * (x - 3.0))
        past = np.maximum(np.where(second, 1.0 - u, u) - share, 0.0)
        place = top * (share * ramp + past)
        change = 30.0 * (x * (1.0 - x)) ** 2 * top / share
        return (
            np.where(second, 1.0 - place, place),
            top * x**3 * (10.0 + x * (6.0 * x - 15.0)),
            np.where(second, -change, change),
        )

    return law


def s_curve(ramp: int, hold: int, coast: int) -> UnitLaw:
    """Returns a law with constant jerk, constant acceleration and constant speed in turn.

    Args:
        ramp, hold, coast: parts of the duration, 4 ramp + 2 hold + coast.
    """
    push = [1.0] * ramp + [0.0] * hold + [-1.0] * ramp
    law = JerkLaw(1.0, np.array([*push, *([0.0] * coast), *(-one for one in push)]))
    law = JerkLaw(1.0, law.jerk / float(law.nodes()[-1, 0]))
    return lambda u: law(np.clip(u, 0.0, 1.0))


UNIT_LAWS: Mapping[str, UnitLaw] = MappingProxyType(
    {
        "quintic": quintic,
        "septic": septic,
        "cycloidal": cycloidal,
        "modified trapezoidal": modified_trapezoid,
        "steady, 30 % ramps": _steady(0.3),
        "steady, 15 % ramps": _steady(0.15),
        "S-curve": s_curve(4, 6, 12),
    }
)
