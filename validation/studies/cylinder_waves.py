"""Simulates the free surface of an upright cylinder by potential flow, as a reference.

The same method as `slosh_testing.multimodal` has for a rectangle, with the modes
J_m(k r) cos(m θ), J_m(k r) sin(m θ) and products by quadrature: Zakharov's equations with the
vertical velocity at the surface expanded to an order in its steepness (West et al. 1987). Lengths
may be in units of the radius, with gravity 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import jnp_zeros, jv, jvp

Array = NDArray[np.float64]
Label = tuple[int, int, bool]
"""A mode: m, n = 1, 2, …, and whether it goes with sin(m θ)."""

RADII, SAMPLES = 32, 16
HELD = 4.3  # above the modes (0, 1), (1, 1), (2, 1) and (3, 1)


@dataclass(eq=False)
class CylinderWaves:
    """The wave modes of a cylinder and their nonlinear products.

    Attributes:
        radius, fill_height: R and h [m].
        gravity: g [m/s²].
        order: in the surface's steepness, 1…3.
        angular, radial: largest m, and how many n of each.
        damping_ratio: of every mode.
        tension: surface tension over density [m³/s²].
        shortest: modes of a larger k R are left out.
        held_back: damping of modes with k R above HELD, relative to that of the others: where
            waves are high, an expansion makes more of short ones than there is.
        labels: of the modes.
    """

    radius: float
    fill_height: float
    gravity: float = 9.81
    order: int = 2
    angular: int = 3
    radial: int = 4
    damping_ratio: float = 0.0
    tension: float = 0.0
    shortest: float = math.inf
    held_back: float = 1.0
    labels: list[Label] = field(init=False)

    def __post_init__(self) -> None:
        roots = {m: jnp_zeros(m, self.radial) for m in range(self.angular + 1)}
        self.labels = [
            (m, n, odd)
            for m in range(self.angular + 1)
            for n in range(1, self.radial + 1)
            for odd in ((False, True) if m else (False,))
            if roots[m][n - 1] <= self.shortest
        ]
        places, weights = np.polynomial.legendre.leggauss(RADII)
        turns = 4 * self.angular + 4
        r, angle = (
            axis.ravel()
            for axis in np.meshgrid(
                0.5 + 0.5 * places, 2.0 * np.pi * np.arange(turns) / turns, indexing="ij"
            )
        )
        area = np.repeat(weights, turns) * r
        relative = np.array([roots[m][n - 1] for m, n, _ in self.labels])
        self._shapes, self._along, self._around = (
            np.array(
                [
                    part(m, k, odd, r, angle)
                    for (m, _, odd), k in zip(self.labels, relative, strict=True)
                ]
            )
            for part in (_shape, _along, _around)
        )
        self._along /= self.radius
        self._around /= self.radius
        norms = (self._shapes**2 * area).sum(axis=1)
        self._project = (self._shapes * area / norms[:, None]).T
        self._k = relative / self.radius
        self._tanh = np.tanh(self._k * self.fill_height)
        self._pull = self.gravity + self.tension * self._k**2
        self.frequency = np.sqrt(self._pull * self._k * self._tanh)
        held = np.where(relative > HELD, self.held_back, 1.0)
        self._drag = 2.0 * self.damping_ratio * held * self.frequency
        self._levers = [
            self.radius * r * shape(angle) @ self._project for shape in (np.cos, np.sin)
        ]

    def place(self, m: int, n: int, *, odd: bool = False) -> int:
        """Returns the index of a mode (m, n) among the amplitudes."""
        return self.labels.index((m, n, odd))

    def heights(self, amplitudes: Array, azimuths: Array, radius: float = 1.0) -> Array:
        """Returns surface elevations (T, K) [m] at azimuths [rad] and a relative radius."""
        roots = self._k * self.radius
        at = np.full(len(azimuths), radius)
        shapes = [
            _shape(m, k, odd, at, azimuths)
            for (m, _, odd), k in zip(self.labels, roots, strict=True)
        ]
        return np.asarray(amplitudes @ np.array(shapes))

    def rates(self, state: Array, push: Array) -> Array:
        """Returns the time derivatives (2, modes) of the elevation and potential amplitudes.

        Args:
            state: (2, modes) [m, m²/s].
            push: (2,) acceleration of the cylinder [m/s²].
        """
        eta, psi = state
        drive = push[0] * self._levers[0] + push[1] * self._levers[1]
        linear = -self._pull * eta - drive - self._drag * psi
        return np.stack([self._k * self._tanh * psi, linear]) + self.nonlinear(eta, psi)

    def nonlinear(self, eta: Array, psi: Array) -> Array:
        """Returns the nonlinear part (2, modes) of the time derivatives, up to the order."""
        height = eta @ self._shapes
        slope = np.stack([eta @ self._along, eta @ self._around])
        drift = np.stack([psi @ self._along, psi @ self._around])
        steep = (slope**2).sum(axis=0)
        w = self._vertical(height, psi)
        rise = sum(w[1:], np.zeros_like(height))
        pressure = np.zeros_like(height)
        if self.order >= 2:
            rise -= (drift * slope).sum(axis=0)
            pressure += 0.5 * w[0] ** 2 - 0.5 * (drift**2).sum(axis=0)
        if self.order >= 3:
            rise += steep * w[0]
            pressure += w[0] * w[1]
        return np.stack([rise @ self._project, pressure @ self._project])

    def _vertical(self, height: Array, psi: Array) -> list[Array]:
        """Returns the vertical velocities at the surface on the grid, one entry per order."""
        powers = [height**k / math.factorial(k) for k in range(self.order)]
        potentials = [psi]
        for m in range(2, self.order + 1):
            there = -sum(powers[k] * self._risen(potentials[m - k - 1], k) for k in range(1, m))
            potentials.append(np.asarray(there @ self._project))
        return [
            sum(
                (powers[k] * self._risen(potentials[m - k - 1], k + 1) for k in range(m)),
                np.zeros_like(height),
            )
            for m in range(1, self.order + 1)
        ]

    def _risen(self, amplitudes: Array, times: int) -> Array:
        """Returns the n-th derivative along z at the still level, on the grid."""
        rate = self._k**times * (self._tanh if times % 2 else 1.0)
        return np.asarray((rate * amplitudes) @ self._shapes)

    def simulate(self, times: Array, push: Array, steps: int = 2) -> Array:
        """Simulates from rest; returns the elevation's amplitudes (T, modes) [m].

        Args:
            times: (T,) [s].
            push: (T, 2) acceleration of the cylinder, linear between the times [m/s²].
            steps: of the classical Runge-Kutta method between two times.
        """
        state = np.zeros((2, len(self.labels)))
        found = np.zeros((len(times), len(self.labels)))
        for i in range(1, len(times)):
            step = (times[i] - times[i - 1]) / steps
            for j in range(steps):
                a, b, c = (
                    push[i - 1] + u / steps * (push[i] - push[i - 1]) for u in (j, j + 0.5, j + 1)
                )
                k1 = self.rates(state, a)
                k2 = self.rates(state + 0.5 * step * k1, b)
                k3 = self.rates(state + 0.5 * step * k2, b)
                k4 = self.rates(state + step * k3, c)
                state = state + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            found[i] = state[0]
        return found


def frequency_shifts(depth: float) -> tuple[float, float]:
    """Returns Δω/ω per (a/R)² of the first mode, for a planar and for a rotating wave.

    By harmonic balance to the third order; a is the height on the wall. Miles 1984; Lukovsky 1990.

    Args:
        depth: h/R.
    """
    second, third = (
        CylinderWaves(1.0, depth, gravity=1.0, order=order, radial=6) for order in (2, 3)
    )
    return _shift(second, third, turning=False), _shift(second, third, turning=True)


def _shift(second: CylinderWaves, third: CylinderWaves, *, turning: bool) -> float:
    even, odd = second.place(1, 1), second.place(1, 1, odd=True)
    w, rates = second.frequency[even], second._k * second._tanh
    count = len(rates)
    phases = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    first = np.zeros((SAMPLES, 2, count))
    first[:, 0, even], first[:, 1, even] = np.cos(phases), -w / rates[even] * np.sin(phases)
    if turning:
        first[:, 0, odd], first[:, 1, odd] = np.sin(phases), w / rates[even] * np.cos(phases)
    harmonics = np.fft.fft([second.nonlinear(*one) for one in first], axis=0) / SAMPLES
    bound = np.zeros((SAMPLES, 2, count), dtype=complex)
    for harmonic in (0, 2, -2):
        rise, push = harmonics[harmonic]
        # iΩη = K ψ + rise, iΩψ = -η + push.
        turn = 1j * harmonic * w
        eta = (turn * rise + rates * push) / (rates + turn**2)
        psi = (turn * eta - rise) / rates
        bound += np.exp(1j * harmonic * phases)[:, None, None] * np.stack([eta, psi])
    cubic = [
        third.nonlinear(*one)
        - second.nonlinear(*one)
        + 0.5 * (second.nonlinear(*(one + other)) - second.nonlinear(*(one - other)))
        for one, other in zip(first, bound.real, strict=True)
    ]
    rise, push = (np.fft.fft(cubic, axis=0)[1] / SAMPLES)[:, even]
    return float(-(rates[even] * push + 1j * w * rise).real / w**2)


def _shape(m: int, k: float, odd: bool, r: Array, angle: Array) -> Array:
    turn = np.sin(m * angle) if odd else np.cos(m * angle)
    return np.asarray(jv(m, k * r) / jv(m, k) * turn)


def _along(m: int, k: float, odd: bool, r: Array, angle: Array) -> Array:
    turn = np.sin(m * angle) if odd else np.cos(m * angle)
    return np.asarray(k * jvp(m, k * r) / jv(m, k) * turn)


def _around(m: int, k: float, odd: bool, r: Array, angle: Array) -> Array:
    turn = m * np.cos(m * angle) if odd else -m * np.sin(m * angle)
    return np.asarray(jv(m, k * r) / jv(m, k) / r * turn)
