"""Simulates the free surface of a moving rectangular tank by potential flow.

What the lumped models are compared with: a surface that is no straight line, whose crests are
sharper than its troughs. The velocity potential in the tank's frame is a sum of modes
cos(nπξ) cosh(k(z + h)), ξ = 0…1 across the width, k = nπ/w. Elevation η and the potential ψ at
the free surface follow Zakharov's equations,

    η̇ = −ψ' η' + (1 + η'²) W
    ψ̇ = −(g + z̈) η + (σ/ρ) η'' − a x − ½ ψ'² + ½ (1 + η'²) W² − 2ζω ψ,

with the vertical velocity W at the surface expanded about the still level up to the order M (West,
Brueckner, Janda, Milder, Milton, J. Geophys. Res. 92, 1987; Dommermuth, Yue, J. Fluid Mech. 184,
1987). Order 1 is the linear multimodal theory (Faltinsen & Timokha, Sloshing, ch. 5), order 2 adds
the bound second mode that sharpens crests, order 3 the frequency's dependence on amplitude.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from slosh_base.types import Array
from slosh_model.checks import within
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError

ORDERS = (1, 5)
STEPS_PER_PERIOD = 24
"""Of the highest mode: the classical Runge–Kutta method then loses less than 1e-6 of a period's
energy, and is stable."""


@dataclass(frozen=True, slots=True)
class Tanks:
    """Rectangular tanks that are simulated together.

    Attributes:
        width: (L,) inner widths along the motion [m].
        fill_height: (L,) heights of the still liquid [m].
        damping_ratio: (L,) of the first mode; that of mode n grows as √n does, for the boundary
            layers on the walls do so with the frequency (Keulegan, J. Fluid Mech. 6, 1959).
        surface_tension: σ/ρ [m³/s²], 7.3e-5 for clean water; it holds back the short modes of a
            narrow tank, the surface meeting its walls at a right angle.

    Raises:
        SloshModelError: impossible dimensions, or numbers of them that differ.
    """

    width: Array
    fill_height: Array
    damping_ratio: Array
    surface_tension: float = 0.0

    @classmethod
    def of(
        cls,
        width: ArrayLike,
        fill_height: ArrayLike,
        damping_ratio: ArrayLike = 0.0,
        surface_tension: float = 0.0,
    ) -> Tanks:
        """Creates one or several tanks; scalars apply to all tanks."""
        given = (width, fill_height, damping_ratio)
        try:
            columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in given))
        except ValueError:
            raise SloshModelError(
                "tanks: width, fill_height and damping_ratio differ in number"
            ) from None
        for name, values, bounds in zip(
            ("width", "fill_height", "damping_ratio"), columns,
            ((1e-3, 100.0), (1e-3, 100.0), (0.0, 0.9)), strict=True,
        ):  # fmt: skip
            for value in values.tolist():
                within(f"tank.{name}", value, "" if name == "damping_ratio" else "m", *bounds)
        within("tank.surface_tension", surface_tension, "m^3/s^2", 0.0, 1.0)
        width, fill_height, damping_ratio = (np.array(column, dtype=float) for column in columns)
        return cls(width, fill_height, damping_ratio, surface_tension)


@dataclass(frozen=True, slots=True)
class FreeSurfaces:
    """Surface elevations over time, as amplitudes of the modes cos(nπξ).

    Attributes:
        times: (T,) [s].
        amplitudes: (T, L, N) of the modes 1…N [m]; the volume is kept, so mode 0 is zero.
    """

    times: Array
    amplitudes: Array

    def profile(self, positions: ArrayLike) -> Array:
        """Returns elevations [m] by time, tank and position across the width, from −½ to ½."""
        at = np.asarray(positions, float) + 0.5
        order = np.arange(1, self.amplitudes.shape[2] + 1)
        return np.asarray(self.amplitudes @ np.cos(np.pi * np.outer(order, at)))


class _Basis:
    """Mode shapes on a grid that is fine enough for their products."""

    def __init__(self, tanks: Tanks, modes: int, order: int) -> None:
        grid = 1 + math.ceil(modes * (order + 1) / 2)
        n = np.arange(1, modes + 1)
        xi = (np.arange(grid) + 0.5) / grid
        self.cosine = np.cos(np.pi * np.outer(n, xi))
        self.sine = np.sin(np.pi * np.outer(n, xi))
        self.project = 2.0 / grid * self.cosine.T
        self.k = n * np.pi / tanks.width[:, None]
        self.tanh = np.tanh(self.k * tanks.fill_height[:, None])
        self.tension = tanks.surface_tension * self.k**2
        self.frequency = np.sqrt((GRAVITY + self.tension) * self.k * self.tanh)
        self.damping = 2.0 * tanks.damping_ratio[:, None] * np.sqrt(n) * self.frequency
        # Amplitudes of x in the modes: x = Σ cₙ cos(nπξ), without the even ones.
        self.lever = -4.0 * tanks.width[:, None] / (n * np.pi) ** 2 * (n % 2)

    def slope(self, amplitudes: Array) -> Array:
        """Returns the derivative across the width of values on the grid."""
        return np.asarray(-(self.k * amplitudes) @ self.sine)

    def vertical(self, amplitudes: Array, times: int) -> Array:
        """Returns the n-th derivative along z of values on the grid, at the still level."""
        rate = self.k**times * (self.tanh if times % 2 else 1.0)
        return np.asarray((rate * amplitudes) @ self.cosine)


def simulate_tanks(
    tanks: Tanks,
    accelerations: Array,
    interval: float,
    *,
    vertical: Array | None = None,
    order: int = 2,
    modes: int = 15,
    start: ArrayLike | None = None,
    may_break: bool = False,
) -> FreeSurfaces:
    """Simulates the free surfaces of horizontally moving tanks from rest.

    >>> tank = Tanks.of(width=0.1, fill_height=0.06, damping_ratio=0.01)
    >>> sway = 0.5 * np.sin(10.0 * np.linspace(0.0, 1.0, 201))[:, np.newaxis]  # m/s²
    >>> surface = simulate_tanks(tank, sway, interval=0.005)
    >>> surface.profile([-0.5, 0.5]).shape  # at both walls
    (201, 1, 2)

    Args:
        tanks: L of them.
        accelerations: (T, L) of the tanks along their width [m/s²]; linear between the samples.
        interval: between two samples [s].
        vertical: (T, L) accelerations upwards [m/s²]; None: none.
        order: in the surface's steepness, 1…5.
        modes: N, how many.
        start: (L, N) amplitudes at the start [m], the liquid still; None: a level surface.
        may_break: whether a tank whose wave breaks is NaN from there on, and the others go on.

    Raises:
        SloshModelError: shapes that do not fit, what is not finite, or, unless it may break, a
            surface so steep that the expansion fails: a wave that breaks.
    """
    sway = _samples("accelerations", accelerations, tanks)
    lift = np.zeros_like(sway) if vertical is None else _samples("vertical", vertical, tanks)
    if lift.shape != sway.shape:
        raise SloshModelError(f"vertical: {lift.shape} samples, accelerations: {sway.shape}")
    if not ORDERS[0] <= order <= ORDERS[1]:
        raise SloshModelError(f"order = {order} must lie in [{ORDERS[0]}, {ORDERS[1]}]")
    within("interval", interval, "s", 1e-6, 1.0)
    basis = _Basis(tanks, modes, order)
    steps = math.ceil(interval * basis.frequency.max() * STEPS_PER_PERIOD / (2.0 * math.pi))
    state = np.zeros((2, *basis.k.shape))
    if start is not None:
        state[0] = start
    amplitudes = np.empty((len(sway), *basis.k.shape))
    amplitudes[0] = state[0]
    for i in range(1, len(sway)):
        for j in range(steps):
            ends = [
                ((1.0 - u) * sway[i - 1] + u * sway[i], (1.0 - u) * lift[i - 1] + u * lift[i])
                for u in (j / steps, (j + 0.5) / steps, (j + 1) / steps)
            ]
            state = _runge_kutta(basis, state, ends, interval / steps, order)
        state[:, ~np.isfinite(state).all(axis=(0, 2))] = np.nan
        amplitudes[i] = state[0]
        if not may_break and not np.isfinite(state).all():
            tank = int(np.flatnonzero(~np.isfinite(state).all(axis=(0, 2)))[0])
            raise SloshModelError(
                f"tank {tank}: the surface is too steep for order {order} at t = "
                f"{i * interval:.3f} s: the wave breaks; take a smaller order or motion"
            )
    times = np.arange(len(sway), dtype=np.float64) * interval
    return FreeSurfaces(np.asarray(times), amplitudes)


def _samples(name: str, values: Array, tanks: Tanks) -> Array:
    columns = np.asarray(values, float)
    if columns.ndim != 2 or columns.shape[1] != len(tanks.width) or not len(columns):
        raise SloshModelError(f"{name}: shape {columns.shape}, (T, {len(tanks.width)}) is needed")
    if not np.isfinite(columns).all():
        row = int(np.flatnonzero(~np.isfinite(columns).all(axis=1))[0])
        raise SloshModelError(f"{name}: sample {row} is not finite")
    return columns


def _runge_kutta(
    basis: _Basis, state: Array, ends: list[tuple[Array, Array]], step: float, order: int
) -> Array:
    begin, middle, end = ends
    with np.errstate(over="ignore", invalid="ignore"):
        k1 = _rates(basis, state, *begin, order)
        k2 = _rates(basis, state + 0.5 * step * k1, *middle, order)
        k3 = _rates(basis, state + 0.5 * step * k2, *middle, order)
        k4 = _rates(basis, state + step * k3, *end, order)
        return np.asarray(state + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))


def _rates(basis: _Basis, state: Array, sway: Array, lift: Array, order: int) -> Array:
    """Returns the time derivatives of the tanks' modal amplitudes, up to the given order."""
    eta, psi = state
    gravity = (GRAVITY + lift)[:, None] + basis.tension
    linear = -gravity * eta - sway[:, None] * basis.lever - basis.damping * psi
    if order == 1:
        return np.stack((basis.k * basis.tanh * psi, linear))
    w = _vertical_velocities(basis, eta, psi, order)
    slope, drift = basis.slope(eta), basis.slope(psi)
    steep = slope * slope
    rise = sum(w) - drift * slope
    pressure = -0.5 * drift * drift
    for m, velocity in enumerate(w, start=1):
        if m + 2 <= order:
            rise = rise + steep * velocity
        for other, second in enumerate(w[: order - m], start=1):
            pressure = pressure + 0.5 * velocity * second
            if m + other + 2 <= order:
                pressure = pressure + 0.5 * steep * velocity * second
    return np.stack((rise @ basis.project, linear + pressure @ basis.project))


def _vertical_velocities(basis: _Basis, eta: Array, psi: Array, order: int) -> list[Array]:
    """Returns the vertical velocities at the surface on the grid, one entry per order."""
    height = eta @ basis.cosine
    powers = [np.ones_like(height)]
    for k in range(1, order + 1):
        powers.append(powers[-1] * height / k)
    potentials = [psi]
    for m in range(2, order + 1):
        there = -sum(powers[k] * basis.vertical(potentials[m - k - 1], k) for k in range(1, m))
        potentials.append(np.asarray(there @ basis.project))
    return [
        sum(
            (powers[k] * basis.vertical(potentials[m - k - 1], k + 1) for k in range(m)),
            np.zeros_like(height),
        )
        for m in range(1, order + 1)
    ]
