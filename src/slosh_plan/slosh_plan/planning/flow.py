"""The equations of the first sloshing mode as CasADi expressions.

The same equations as in the model's effects `vertical_acceleration`, `surface_nonlinearity` (DL22,
eqs. (11), (14)) and `pendulum_nonlinearity` (TM20, eq. (6)); the search uses no others. What it
finds is simulated with the whole model.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_model import Model
from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.model import VERTICAL

Expression = Any
"""A CasADi expression, or a number: CasADi has no types."""


def casadi() -> Any:
    """Imports the library CasADi when it is first used, since it is optional."""
    return importlib.import_module("casadi")


@dataclass(frozen=True, slots=True)
class Flow:
    """Parameters of a model's first sloshing mode, with its equations.

    Attributes:
        frequency: ω along the container's x and y [rad/s].
        damping: ζ.
        gain: wall height by displacement along x and y.
        curvature: Cₙ; 0: the mass slides on a plane.
        radius: R [m].
        alpha: of the cubic spring.
        pendulum: whether the liquid swings as a pendulum does.
        cornered: whether the heights along x and y add up in a corner.
        axes: azimuth of the mode's x from the container's [rad].
        vertical: whether the vertical acceleration acts.
    """

    frequency: tuple[float, float]
    damping: float
    gain: tuple[float, float]
    curvature: float
    radius: float
    alpha: float
    pendulum: bool
    cornered: bool
    vertical: bool
    axes: float = 0.0

    def turned(self, vector: Sequence[Expression], angle: float) -> Sequence[Expression]:
        """Rotates pairs of horizontal components (x, y) of a vector by an angle [rad]."""
        if self.axes == 0.0:
            return vector
        c, s, found = math.cos(angle), math.sin(angle), list(vector)
        for n in range(0, len(found) - 1, 2):
            x, y = found[n], found[n + 1]
            found[n], found[n + 1] = c * x - s * y, s * x + c * y
        return found

    def acceleration(self, q: Expression, a: Expression) -> list[Expression]:
        """Returns q̈ [m/s²] of q = (x, y, ẋ, ẏ) for an acceleration in container axes.

        Both q in the axes of the mode.
        """
        a = self.turned([a[0], a[1], a[2]], -self.axes)
        lift = 1.0 + a[2] / GRAVITY if self.vertical else 1.0
        if self.pendulum:
            return [self._swing(q[n], q[n + 2], a[n], lift, self.frequency[n]) for n in (0, 1)]
        force = [
            -2.0 * self.damping * w * q[n + 2] - w * w * lift * q[n] - a[n]
            for n, w in enumerate(self.frequency)
        ]
        return force if self.curvature == 0.0 else self._slide(q, force)

    def _swing(
        self, q: Expression, v: Expression, a: Expression, lift: Expression, w: float
    ) -> Expression:
        ca = casadi()

        angle = q * w * w / GRAVITY
        c = ca.cos(angle)
        return -2.0 * self.damping * w * c * c * v - GRAVITY * lift * ca.sin(angle) - a * c

    def _slide(self, q: Expression, force: list[Expression]) -> list[Expression]:
        x, y, vx, vy = q[0], q[1], q[2], q[3]
        xr, yr, w, c2 = x / self.radius, y / self.radius, self.frequency[0], self.curvature**2
        radial = (
            2.0 * self.damping * w * c2 * (xr * vx + yr * vy)
            + c2 * (vx * vx + vy * vy) / self.radius
            + w * w * self.alpha * (xr * xr + yr * yr) * self.radius
        )
        fx, fy = force[0] - radial * xr, force[1] - radial * yr
        mxx, mxy, myy = 1.0 + c2 * xr * xr, c2 * xr * yr, 1.0 + c2 * yr * yr
        determinant = mxx * myy - mxy * mxy
        return [(myy * fx - mxy * fy) / determinant, (mxx * fy - mxy * fx) / determinant]

    def heights(self, q: Expression, limit: Expression) -> list[Expression]:
        """Returns expressions that are at most 1 if the wave stays below a height limit [m]."""
        x, y = self.gain[0] * q[0] / limit, self.gain[1] * q[1] / limit
        return [x + y, x - y, -x - y, y - x] if self.cornered else [x * x + y * y]

    def residual(self, q: Expression, limit: Expression, share: Expression) -> list[Expression]:
        """Returns expressions that are at most 0 if the residual wave stays below a limit [m].

        The wave runs on an ellipse whose half axes a, b follow from a² + b² = E, ab = L; its
        largest height is a ≤ 1 where 1 - E + L² ≥ 0 and E ≤ 2 (heights by the limit).

        Where x and y have different frequencies their amplitudes are at most `share` and
        1 - share of the limit: a free number between 0 and 1, in place of roots, which bend too
        sharply near 0 for a search.
        """
        x, y, vx, vy = (
            self.gain[n % 2] * q[n] / limit / (1.0 if n < 2 else self.frequency[n % 2])
            for n in range(4)
        )
        if self.frequency[0] != self.frequency[1]:
            return [x * x + vx * vx - share**2, y * y + vy * vy - (1.0 - share) ** 2]
        energy, turn = x * x + y * y + vx * vx + vy * vy, x * vy - y * vx
        return [energy - 1.0 - turn * turn, energy - 2.0]


def flow_of(model: Model) -> Flow:
    """Creates the equations of a model's first sloshing mode for the optimisation."""
    mode = model.mode_constants()[0]
    acting = model.acting
    curved = acting.get("surface_nonlinearity")
    gains = tuple(model.height_gains(axis=axis)[0] for axis in (X_AXIS, Y_AXIS))
    frequencies = tuple(mode.along(axis).natural_frequency for axis in (X_AXIS, Y_AXIS))
    axes = model.container.axes(model.mode_count)
    if model.container.one_directional:  # as if the first two were at right angles
        second = model.mode_constants()[1]
        gains = (gains[0], model.height_gains()[1])
        frequencies = (frequencies[0], second.natural_frequency)
        axes = model.container.direction(1)
    return Flow(
        frequency=(frequencies[0], frequencies[1]),
        damping=mode.damping_ratio,
        gain=(gains[0], gains[1]),
        curvature=0.0 if curved is None else mode.curvature,
        radius=mode.reach,
        alpha=0.0 if curved is None else curved["alpha"],
        pendulum="pendulum_nonlinearity" in acting,
        cornered=model.container.cornered,
        vertical=VERTICAL in acting,
        axes=axes,
    )


def first_mode(model: Model, modal: Array) -> Array:
    """Returns the first mode's states (N, 4) in a simulated motion, as `Flow` defines them.

    Args:
        model: the model.
        modal: (N, modes, 4), as `simulate` gives them.
    """
    container = model.container
    if not container.one_directional:
        return np.asarray(modal[:, 0])
    found = np.empty((len(modal), 4))
    for n in (0, 1):
        angle = container.direction(n + 1) - container.axes(model.mode_count)
        found[:, n] = modal[:, n, :2] @ [math.cos(angle), math.sin(angle)]
        found[:, n + 2] = modal[:, n, 2:] @ [math.cos(angle), math.sin(angle)]
    return found
