"""A stroke's normalised time law: one polynomial of degree 7 for each segment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, PPoly

from slosh_base.types import Array
from slosh_machines.tuning import TUNING

DEGREE = 5
"""Degree of the acceleration's spline; the position's is higher by two."""
KNOTS = np.concatenate(
    [np.zeros(DEGREE), np.linspace(0.0, 1.0, TUNING.segments + 1), np.ones(DEGREE)]
)
COUNT = TUNING.segments + DEGREE - 2
"""Weights of a law: those at both ends are zero, so that the acceleration begins and ends at 0."""


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """A time law from 0 to 1 over the normalised time u from 0 to 1, at rest at both ends.

    Attributes:
        weights: (COUNT,) of the acceleration's B-splines of the fifth degree.
    """

    weights: Array

    def acceleration(self, u: Array) -> Array:
        """Returns the second derivative at normalised times; 0 outside the range 0 to 1."""
        inside = (u >= 0.0) & (u <= 1.0)
        return np.where(inside, spline(self.weights)(np.clip(u, 0.0, 1.0)), 0.0)

    def position(self, u: Array) -> Array:
        """Returns the normalised position at given normalised times."""
        return np.asarray(self.polynomials()(np.clip(u, 0.0, 1.0)), dtype=np.float64)

    def polynomials(self) -> PPoly:
        """Returns the time law as polynomials of degree 7 between the knots."""
        return PPoly.from_spline(spline(self.weights).tck).antiderivative(2)

    def coefficients(self) -> Array:
        """Returns coefficients (segments, 8) of v⁰ … v⁷; v runs from 0 to 1 in each segment."""
        found = self.polynomials()
        width = np.diff(found.x)
        real = width > 0.0  # the knots at both ends coincide
        powers = np.arange(DEGREE + 3)
        scaled: Array = found.c[::-1, real].T * width[real, None] ** powers
        return scaled


def spline(weights: Array) -> BSpline:
    """Returns acceleration splines over normalised time for given weights, one per column."""
    ends = np.zeros((1, *weights.shape[1:]))
    return BSpline(KNOTS, np.concatenate([ends, weights, ends]), DEGREE)


def moments() -> Array:
    """Returns each B-spline's contribution to final speed and final position, (2, COUNT)."""
    each = spline(np.eye(COUNT))
    return np.array([each.antiderivative(order)(1.0) for order in (1, 2)])
