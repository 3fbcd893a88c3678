"""Liquids in moving containers by the published equations, without code of the product.

A round cup by DL22, eqs. (11), (14) and Table 2 (NL model); a rectangle by TM20, eq. (6), along
both sides. Fixed-step Runge-Kutta of order 4 over pieces of linear acceleration, for several
liquids, motions and modes at once. It judges what other code computes, so it imports NumPy and
SciPy alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import jnp_zeros

Real = NDArray[np.float64]
GRAVITY, SPRING = 9.81, 0.58
PHASE = 0.2
"""Largest step, as phase of the fastest mode [rad]: a crest between two samples of that mode is
0.5 % higher, of the first mode less."""


class Vessel(NamedTuple):
    """Inner lengths of a container [m], and the number of modes of its liquid.

    Attributes:
        fill: height of the still liquid.
        radius: of a round cup; 0: a rectangle.
        width, depth: of a rectangle along x and y.
        modes: from the first.
    """

    fill: float
    radius: float = 0.0
    width: float = 0.0
    depth: float = 0.0
    modes: int = 1


class Liquids:
    """Several liquids in equal containers that make the same motion, or one each.

    Args:
        vessel: the container.
        damping: ratio ζ of every mode [1].
        factors: (N, 2) of frequency and damping of each liquid.

    Attributes:
        frequency_factor: of the first liquid.
        place, speed: (N, modes) x + iy of each mode's mass [m, m/s].
    """

    def __init__(self, vessel: Vessel, damping: float, factors: Real) -> None:
        self._round = vessel.radius > 0.0
        n = np.arange(1.0, vessel.modes + 1.0)
        if self._round:
            reach = np.full((1, 2), vessel.radius)
            xi = jnp_zeros(1, vessel.modes)[:, np.newaxis]
            mass = 2.0 * reach * np.tanh(xi * vessel.fill / reach)
            mass = mass / (xi * vessel.fill * (xi**2 - 1.0))
            gain = xi**2 * vessel.fill * mass / reach
        else:
            reach = 0.5 * np.array([[vessel.width, vessel.depth]])
            xi = (2.0 * n - 1.0)[:, np.newaxis] * 0.5 * math.pi
            # A single mode is a plane surface; with several each has its own shape.
            shape = 1.0 if vessel.modes == 1 else 2.0 / xi**2
            gain = shape * xi * np.tanh(xi * vessel.fill / reach)
        squared = GRAVITY * xi / reach * np.tanh(xi * vessel.fill / reach)
        frequency, damped = factors[:, :1, np.newaxis], factors[:, 1:, np.newaxis]
        omega = frequency * np.sqrt(squared)
        # A constant acceleration tilts the surface alike, whatever the frequency.
        self._gain, self._omega = frequency**2 * gain, omega
        self._squared, self._drag = omega**2, 2.0 * damping * damped * omega
        self._curved = (omega[..., 0] ** 2 / GRAVITY) ** 2
        self._spring = SPRING * omega[..., 0] ** 2 / reach[0, 0] ** 2
        self.frequency_factor = float(factors[0, 0])
        self._step = PHASE / float(omega.max())
        self.place = np.zeros(omega.shape[:2], dtype=np.complex128)
        self.speed = self.place.copy()

    @property
    def period(self) -> float:
        """Period of the first liquid's first mode [s]."""
        return float(2.0 * math.pi / self._omega[0, 0].min())

    def noise(self, height: float) -> Real:
        """Returns the deviation (modes, 4) of the first liquid's state for one of a height [m]."""
        size = height / self._gain[0].mean(axis=1)
        rate = size * self._omega[0].mean(axis=1)
        return np.column_stack([size, size, rate, rate]) / math.sqrt(len(size))

    @property
    def height(self) -> float:
        """Greatest height at the wall over all liquids [m]."""
        return float(self.heights.max())

    @property
    def heights(self) -> Real:
        """Height at the wall (N,) of each liquid [m]."""
        return self._heights(self.place)

    def disturb(self, height: float, azimuth: float, phase: float) -> None:
        """Adds a wave of the first mode to every liquid.

        Args:
            height: of its crest [m].
            azimuth: of its direction [rad].
            phase: of its oscillation [rad].
        """
        toward = np.exp(1j * azimuth) * height / self._gain[:, 0, 0]
        self.place[:, 0] += toward * math.cos(phase)
        self.speed[:, 0] -= toward * math.sin(phase) * self._omega[:, 0, 0]

    @property
    def largest(self) -> float:
        """Height g/ω² of a free wave whose crest falls with g; a higher one breaks [m]."""
        return float(GRAVITY / self._squared[:, 0].max())

    def decay(self, seconds: float) -> None:
        """Lets the waves decay in a container at rest; their phases are not changed."""
        left = np.exp(-0.5 * self._drag.min(axis=-1) * seconds)
        self.place, self.speed = left * self.place, left * self.speed

    def modal(self, index: int) -> Real:
        """Returns x, y, vx, vy (modes, 4) of one liquid [m, m/s]."""
        place, speed = self.place[index], self.speed[index]
        return np.column_stack([place.real, place.imag, speed.real, speed.imag])

    @property
    def cornered(self) -> bool:
        """Whether the container is a rectangle."""
        return not self._round

    def at(self, azimuths: Real) -> Real:
        """Returns heights of the first liquid at azimuths [rad] of the wall [m].

        In a rectangle at the middles of its sides, which are at multiples of 90°.
        """
        x, y = (self._gain[0].T * (self.place[0].real, self.place[0].imag)).sum(axis=1)
        found: Real = x * np.cos(azimuths) + y * np.sin(azimuths)
        return found

    def move(self, duration: float, begin: Real, end: Real) -> float:
        """Advances all liquids over a time in which the acceleration is linear.

        Args:
            duration: [s].
            begin, end: (3,) acceleration of the containers, or (N, 3) of each [m/s²].

        Returns:
            greatest height at the wall over all liquids [m].
        """
        count = max(math.ceil(duration / self._step), 1)
        h, highest = duration / count, 0.0
        at = np.linspace(0.0, 1.0, 2 * count + 1).reshape(-1, *[1] * np.ndim(begin))
        felt = (begin + at * (end - begin))[..., np.newaxis, :]
        along, lift = felt[..., 0] + 1j * felt[..., 1], 1.0 + felt[..., 2] / GRAVITY
        rate = self._round_rate if self._round else self._rectangle_rate
        q: NDArray[np.complex128] = self.place
        v: NDArray[np.complex128] = self.speed
        for k in range(count):
            first, middle, last = ((along[2 * k + m], lift[2 * k + m]) for m in range(3))
            a1 = rate(q, v, *first)
            v2 = v + 0.5 * h * a1
            a2 = rate(q + 0.5 * h * v, v2, *middle)
            v3 = v + 0.5 * h * a2
            a3 = rate(q + 0.5 * h * v2, v3, *middle)
            v4 = v + h * a3
            a4 = rate(q + h * v3, v4, *last)
            q = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            highest = max(highest, float(self._heights(q).max()))
        self.place, self.speed = q, v
        return highest

    def _heights(self, q: NDArray[np.complex128]) -> Real:
        """Returns the height (N,) at the wall [m]: modes add as vectors, corners as sides."""
        x = (self._gain[..., 0] * q.real).sum(axis=1)
        y = (self._gain[..., -1] * q.imag).sum(axis=1)
        found: Real = np.hypot(x, y) if self._round else np.abs(x) + np.abs(y)
        return found

    def _round_rate(
        self,
        q: NDArray[np.complex128],
        v: NDArray[np.complex128],
        along: NDArray[np.complex128],
        lift: Real,
    ) -> NDArray[np.complex128]:
        """Returns q̈ of DL22, eq. (14): a mass on a paraboloid with a cubic spring."""
        distance = q.real**2 + q.imag**2
        drag, squared = self._drag[..., 0], self._squared[..., 0]
        sliding = q.real * v.real + q.imag * v.imag
        radial = self._curved * (drag * sliding + v.real**2 + v.imag**2) + self._spring * distance
        pull = -drag * v - (squared * lift + radial) * q - along
        share = self._curved * (q.real * pull.real + q.imag * pull.imag)
        found: NDArray[np.complex128] = pull - q * (share / (1.0 + self._curved * distance))
        return found

    def _rectangle_rate(
        self,
        q: NDArray[np.complex128],
        v: NDArray[np.complex128],
        along: NDArray[np.complex128],
        lift: Real,
    ) -> NDArray[np.complex128]:
        """Returns q̈ of TM20, eq. (6), a pendulum of angle θ = ω² q/g along each side."""
        scale = self._squared / GRAVITY
        place, speed = np.stack([q.real, q.imag], -1), np.stack([v.real, v.imag], -1)
        angle = scale * place
        c = np.cos(angle)
        pull = -self._drag * c**2 * speed - GRAVITY * lift[..., np.newaxis] * np.sin(angle)
        pull = pull - np.stack([along.real, along.imag], -1) * c
        found: NDArray[np.complex128] = pull[..., 0] + 1j * pull[..., 1]
        return found
