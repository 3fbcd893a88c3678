"""The liquid's surface over the cup: two sloshing modes and a second-order part.

Heights are metres above the still level, azimuths radians from +x towards +y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.special import jv

Array = NDArray[np.float64]

# Zeros of the derivatives of J1 (first and second mode), J0 and J2: no flow through the wall.
MODE_1 = 1.841183781
MODE_2 = 5.331442774
MEAN_MODE = 3.831705970
DOUBLE_MODE = 3.054236928
GRAVITY = 9.81


class Surface(Protocol):
    """Interface of a liquid surface that can be drawn."""

    @property
    def reach(self) -> float:
        """Radius up to which the surface is drawn [m]."""

    def height(self, r: Array, azimuth: Array) -> Array:
        """Returns the surface height [m] at radius `r` [m] and `azimuth` [rad]."""


@dataclass(frozen=True)
class Wave:
    """The liquid's surface in a cylinder at one moment.

    Attributes:
        radius: inner radius of the cup, m.
        a1, phi: first mode's amplitude at the wall (m, may be negative) and azimuth (rad).
        a2, phi2: the same for the second mode.
        mean, double: second-order amplitudes at the wall (m): an axisymmetric part and one in
            cos 2(theta - phi). Both leave the volume as it is.
    """

    radius: float
    a1: float = 0.0
    phi: float = 0.0
    a2: float = 0.0
    phi2: float = 0.0
    mean: float = 0.0
    double: float = 0.0

    @property
    def reach(self) -> float:
        """Radius up to which the surface is drawn [m]."""
        return self.radius

    def height(self, r: Array, azimuth: Array) -> Array:
        """Returns the surface height [m] at radius `r` [m] and `azimuth` [rad]."""
        x = np.asarray(r) / self.radius
        first = jv(1, MODE_1 * x) / jv(1, MODE_1) * np.cos(azimuth - self.phi)
        second = jv(1, MODE_2 * x) / jv(1, MODE_2) * np.cos(azimuth - self.phi2)
        mean = jv(0, MEAN_MODE * x) / jv(0, MEAN_MODE)
        double = jv(2, DOUBLE_MODE * x) / jv(2, DOUBLE_MODE) * np.cos(2 * (azimuth - self.phi))
        return np.asarray(
            self.a1 * first + self.a2 * second + self.mean * mean + self.double * double
        )

    def wall(self, azimuth: Array | float) -> Array:
        """Returns the height on the wall [m] at `azimuth` [rad]."""
        return self.height(np.asarray(self.radius), np.asarray(azimuth))

    def peak(self) -> tuple[float, float]:
        """Returns the maximum height on the wall [m] and its azimuth in (-π, π] [rad]."""
        coarse = np.radians(np.arange(0.0, 360.0, 1.0))
        start = float(coarse[int(np.argmax(self.wall(coarse)))])
        found = minimize_scalar(
            lambda azimuth: -float(self.wall(azimuth)),
            bounds=(start - 0.03, start + 0.03),
            method="bounded",
            options={"xatol": 1e-10},
        )
        azimuth = math.atan2(math.sin(found.x), math.cos(found.x))
        return -float(found.fun), azimuth


def natural_frequency(radius: float, fill_height: float, mode: float = MODE_1) -> float:
    """Returns the natural frequency [Hz] of a mode for a fill height [m]."""
    wave_number = mode / radius
    squared = GRAVITY * wave_number * math.tanh(wave_number * fill_height)
    return math.sqrt(squared) / (2 * math.pi)
