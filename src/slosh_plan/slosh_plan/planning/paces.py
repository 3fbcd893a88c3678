"""Parameters of a leg along which a known law runs: its length, or one that is slower in curves.

A law along the length takes a curve as fast as a straight line: what its sharpest curve bears then
holds for all of the leg.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

from slosh_plan.planning.path import Leg

Array = NDArray[np.float64]

POINTS = 800
STRAIGHT = 1e-3
"""Curvature by length of a leg below which it is straight."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Speed by curvature κ: proportional to (κ² + (floor · κ̄)²)^(-power / 2), κ̄ its RMS.

    Attributes:
        power: 0: an even speed; 1/3: the two-thirds power law, at which an ellipse is gone through
            harmonically; 1/2: an even lateral acceleration.
        floor: below which curvature hardly counts.
    """

    power: float
    floor: float


PACES: Mapping[str, Pace] = MappingProxyType(
    {
        "": Pace(0.0, 1.0),
        ", slower in curves": Pace(1.0 / 3.0, 0.3),
        ", evenly in curves": Pace(0.5, 1.0),
    }
)
"""By what their names add to a law's."""


@dataclass(frozen=True)
class PacedLeg:
    """A leg by the parameter of a pace, from 0 to 1.

    Attributes:
        leg: the leg.
        pace: the pace.
    """

    leg: Leg
    pace: Pace

    @cached_property
    def splines(self) -> tuple[BSpline, ...]:
        """S [m] over the parameter and its first two derivatives."""
        s = np.linspace(0.0, self.leg.length, POINTS + 1)
        squared = (self.leg.at(s)[2] ** 2).sum(axis=1)
        least = (self.pace.floor**2) * squared.mean() + (STRAIGHT / self.leg.length) ** 2
        slow = (squared + least) ** (0.5 * self.pace.power)
        at = np.concatenate([[0.0], np.cumsum(0.5 * (slow[1:] + slow[:-1]))])
        spline = make_interp_spline(at / at[-1], s, k=5)
        return (spline, spline.derivative(), spline.derivative(2))

    def along(self, place: Array, rate: Array, change: Array) -> tuple[Array, Array, Array]:
        """S and its first two derivatives by time, of the parameter's."""
        s, slope, bend = (np.asarray(spline(np.clip(place, 0.0, 1.0))) for spline in self.splines)
        return s, slope * rate, bend * rate**2 + slope * change


def curved(leg: Leg) -> bool:
    """Whether a leg has curves, so that paces differ."""
    bends = np.linalg.norm(leg.at(np.linspace(0.0, leg.length, POINTS + 1))[2], axis=1)
    return bool(np.ptp(bends) * leg.length > STRAIGHT)
