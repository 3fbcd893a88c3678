"""One time interval of the collocation problem as CasADi functions.

Place along a leg, and the tilt where one is allowed, are polynomials of the time between two
nodes; the first mode of each liquid obeys its equations at the nodes and half-way between two
(Hermite-Simpson collocation, of the fourth order), so that nothing is integrated step by step. All
but the path's curve are functions of scalars, which CasADi evaluates and differentiates several
times faster than the same in matrices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from slosh_base.types import Array
from slosh_model.constants import GRAVITY
from slosh_plan.planning.flow import Expression, Flow, casadi
from slosh_plan.planning.joint_demands import CURVE, JointDemands
from slosh_plan.planning.limits import JOINT_LIMITS, STANDING_LIMITS
from slosh_plan.planning.loose_terms import LooseTerms
from slosh_plan.planning.path import DEGREE, Leg
from slosh_plan.tuning import TUNING

CHAIN = 3
"""States of what is driven by its third derivative: value, rate, acceleration."""
LIQUID = 4
"""States of the liquid: x, y, ẋ, ẏ."""
LIMITS = (
    "height", "residual", "acceleration", "jerk", "tilt", "tilt_rate", "tilt_acceleration",
    *STANDING_LIMITS, *JOINT_LIMITS,
)  # fmt: skip
JERK = LIMITS.index("jerk")
STANDING = slice(LIMITS.index("friction"), LIMITS.index("tipping") + 1)
JOINTS = slice(LIMITS.index(JOINT_LIMITS[0]), len(LIMITS))
SHARES = (0.0, 0.5, 1.0)
"""Of an interval, where its demands are looked at."""


@dataclass(frozen=True, slots=True)
class StateLayout:
    """Layout of a node's state: path position, tilts, their rates, and the liquids.

    Attributes:
        tilting: whether the container tilts, about its x and its y.
        liquids: number of liquids that the motion drives: of the model, and of other models
            whose heights keep the limits, too.
    """

    tilting: bool
    liquids: int = 1

    @property
    def driven(self) -> int:
        """Number of quantities whose third derivative is a control: path position and tilts."""
        return 3 if self.tilting else 1

    @property
    def size(self) -> int:
        """Number of entries of a node's state vector."""
        return CHAIN * self.driven + self.waves

    @property
    def waves(self) -> int:
        """Number of states of all liquids."""
        return LIQUID * self.liquids

    @property
    def scale(self) -> Array:
        """Scale (size,) of each state, so that the solver's numbers are about 1."""
        tilt = [0.2, 1.0, 10.0] * (self.driven - 1)
        return np.array([1.0, 1.0, 10.0, *tilt, *([0.01, 0.01, 0.2, 0.2] * self.liquids)])

    @property
    def control_scale(self) -> Array:
        """Scale (driven,) of the controls, so that the solver's numbers are about 1."""
        return np.array([50.0, *([100.0] * (self.driven - 1))])

    @property
    def liquid(self) -> slice:
        """Indices of the states of each liquid in a node's state vector."""
        return slice(self.size - self.waves, self.size)


@dataclass(frozen=True, slots=True)
class Interval:
    """The optimisation constraints of one time interval of a leg of the path.

    Its unknowns are the leg's duration, the states at both ends, the controls and the liquid
    half-way, one below the other.

    Attributes:
        flows: the liquids.
        yaw: of the container [rad].
        layout: of the states.
        count: intervals of the leg.
        joints: that carry the container; None: its path is given, not theirs.
        loose: how the container stands on its tray, with each liquid; empty: it is held.
    """

    flows: tuple[Flow, ...]
    yaw: float
    layout: StateLayout
    count: int
    joints: JointDemands | None = None
    loose: tuple[LooseTerms, ...] = ()

    @property
    def curve(self) -> int:
        """Number of quantities that are interpolated along a leg for the limits of the joints."""
        return CURVE if self.joints is None else self.joints.width

    @property
    def size(self) -> int:
        """Number of unknowns of the interval."""
        return 1 + 2 * self.layout.size + self.layout.driven + self.layout.waves

    def places(self) -> Any:
        """Returns a function from the unknowns to path positions [m] at start, middle and end."""
        ca = casadi()

        unknowns = ca.SX.sym("unknowns", self.size)
        step, (first, _), thirds, _ = self._parts(unknowns)
        laws = [_later([first[k] for k in range(CHAIN)], thirds[0], t * step) for t in SHARES]
        return ca.Function("places", [unknowns], [ca.vertcat(*(law[0] for law in laws))])

    def demands(self) -> tuple[Any, Any, Any]:
        """Returns functions for the constraints, their Jacobian and their Hessian.

        Functions of the unknowns, the limits, three places and the curve there, and, the last
        one, of the multipliers; the Hessian is an upper triangle. The curve is given by its Taylor
        expansion of the second order about the places, (3 curve, 3): value, first and second
        derivative.
        """
        ca = casadi()

        unknowns, limits = ca.SX.sym("unknowns", self.size), ca.SX.sym("limits", len(LIMITS))
        about, terms = ca.SX.sym("about", 3), ca.SX.sym("terms", 3 * self.curve, 3)
        zero, kept = self._demanded(unknowns, limits, about, terms)
        found = ca.vertcat(*zero, *kept)
        given = [unknowns, limits, about, terms]
        weights = ca.SX.sym("weights", found.numel())
        hessian = ca.triu(ca.hessian(ca.dot(weights, found), unknowns)[0])
        return (
            ca.Function("demands", given, [found]),
            ca.Function("slopes", given, [ca.jacobian(found, unknowns)]),
            ca.Function("bends", [*given, weights], [hessian]),
        )

    def bounds(self) -> tuple[Array, Array]:
        """Returns lower and upper bounds of the constraints."""
        ca = casadi()

        unknowns, limits = ca.SX.sym("unknowns", self.size), ca.SX.sym("limits", len(LIMITS))
        about, terms = ca.SX.sym("about", 3), ca.SX.sym("terms", 3 * self.curve, 3)
        zero, kept = self._demanded(unknowns, limits, about, terms)
        equal, below = ca.vertcat(*zero).numel(), len(kept)
        lower = np.concatenate([np.zeros(equal), np.full(below, -np.inf)])
        return lower, np.concatenate([np.zeros(equal), np.ones(below)])

    def _demanded(
        self, unknowns: Expression, limits: Expression, about: Expression, terms: Expression
    ) -> tuple[list[Expression], list[Expression]]:
        ca = casadi()

        step, (first, last), thirds, half = self._parts(unknowns)
        driven = [self._driven(first, thirds, share * step) for share in SHARES]
        curves = [
            _expanded(terms[:, n], at[0] - about[n], self.curve) for n, at in enumerate(driven)
        ]
        middle = ca.vertcat(*driven[1], half)
        old, kept = self._there(first, curves[0], limits)
        between, more = self._there(middle, curves[1], limits)
        new, _ = self._there(last, curves[2], limits)
        kept += more
        for curve, at in ((curves[0], driven[0]), (curves[2], driven[2])):
            kept.append(ca.sumsqr(_jerk(curve[:CURVE], at, thirds[0])) / limits[JERK] ** 2)
            if self.joints is not None:
                kept += self.joints.jerks(curve, at, thirds[0], limits[JOINTS])
        scale, liquid = self.layout.scale, self.layout.liquid
        q, q_new = first[liquid], last[liquid]
        zero = [
            (ca.vertcat(*driven[2]) - last[: len(driven[2])]) / scale[: len(driven[2])],
            (half - 0.5 * (q + q_new) - step / 8.0 * (old - new)) / scale[liquid],
            (q + step / 6.0 * (old + 4.0 * between + new) - q_new) / scale[liquid],
        ]
        return zero, kept

    def _parts(self, unknowns: Expression) -> tuple[Expression, list[Expression], Expression, Any]:
        """Splits an interval's unknowns: time step, end states, controls, middle liquid state."""
        ca = casadi()

        layout = self.layout
        sizes = np.cumsum([0, 1, layout.size, layout.size, layout.driven, layout.waves]).tolist()
        duration, first, last, control, half = ca.vertsplit(unknowns, sizes)
        states = [first * layout.scale, last * layout.scale]
        liquid = half * layout.scale[layout.liquid]
        return duration / self.count, states, control * layout.control_scale, liquid

    def _driven(self, full: Expression, thirds: Expression, time: Expression) -> list[Expression]:
        """Extrapolates path position and tilts over a time from a node, with constant jerk."""
        found: list[Expression] = []
        for n in range(self.layout.driven):
            chain = [full[CHAIN * n + k] for k in range(CHAIN)]
            found += _later(chain, thirds[n], time)
        return found

    def _there(
        self, full: Expression, curve: Expression, limits: Expression
    ) -> tuple[Expression, list[Expression]]:
        """Returns the liquid state's time derivative and the constraint values at a state."""
        ca = casadi()

        tangent, bend, _ = ca.vertsplit(curve[:CURVE], 3)
        acceleration = tangent * full[2] + bend * full[1] ** 2
        kept = [ca.sumsqr(acceleration) / limits[2] ** 2]
        if self.layout.tilting:
            for n, limit in enumerate(limits[index] for index in (4, 5, 6)):
                kept.append((full[CHAIN + n] ** 2 + full[2 * CHAIN + n] ** 2) / limit**2)
        if self.joints is not None:
            kept += self.joints.demands(curve, full, limits[JOINTS])
        felt = self._felt(full, acceleration, curve)
        rates: list[Expression] = []
        for n, flow in enumerate(self.flows):
            q = full[self.layout.liquid][LIQUID * n : LIQUID * (n + 1)]
            kept += flow.heights(q, limits[0])
            pushed = flow.acceleration(q, felt)
            rates += [q[2], q[3], *pushed]
            if self.loose:
                kept += self.loose[n].demands(flow, q, pushed, felt, limits[STANDING])
        return ca.vertcat(*rates), kept

    def _felt(self, full: Expression, acceleration: Expression, curve: Expression) -> Expression:
        """Returns the liquid's acceleration in container axes, with gravity if tilt is allowed."""
        ca = casadi()

        if self.joints is not None:
            gravity = ca.DM([0.0, 0.0, GRAVITY])
            return self.joints.turned(curve) @ (acceleration + gravity) - gravity
        c, d = np.cos(self.yaw), np.sin(self.yaw)
        own = ca.DM([[c, d, 0.0], [-d, c, 0.0], [0.0, 0.0, 1.0]]) @ acceleration
        if not self.layout.tilting:
            return own
        weight = own + ca.DM([0.0, 0.0, GRAVITY])
        return _turned_back(full[CHAIN], full[2 * CHAIN], weight) - ca.DM([0.0, 0.0, GRAVITY])


def curve_of(leg: Leg) -> Any:
    """Returns a function from path position to a leg's derivatives, by a Taylor expansion.

    A spline through many of their values: one look-up in place of three.
    """
    ca = casadi()

    s = np.linspace(0.0, leg.length, TUNING.curve_points + 1)
    values = leg.columns(s)
    spline = make_interp_spline(s, values, k=DEGREE)
    at = ca.MX.sym("s")
    inside = ca.fmax(TUNING.edge * leg.length, ca.fmin((1.0 - TUNING.edge) * leg.length, at))
    orders = [_look_up(spline, order)(inside) for order in range(3)]
    return ca.Function("curve", [at], [inside, ca.vertcat(*orders)])


def _look_up(spline: BSpline, order: int) -> Any:
    derivative, degree = spline.derivative(order), DEGREE - order
    # Behind those that belong to the knots, a derivative of scipy's holds zeros.
    coefficients = np.asarray(derivative.c)[: len(derivative.t) - degree - 1]
    knots, flat = [derivative.t.tolist()], coefficients.ravel().tolist()
    return casadi().Function.bspline(f"d{order}", knots, flat, [degree], derivative.c.shape[1])


def _expanded(terms: Expression, distance: Expression, width: int) -> Expression:
    """Evaluates a leg's interpolated quantities at a distance by their Taylor expansion."""
    value, first, second = casadi().vertsplit(terms, width)
    return value + distance * (first + 0.5 * distance * second)


def _later(chain: list[Expression], third: Expression, t: Expression) -> list[Expression]:
    """Extrapolates a value and two derivatives by a time, with constant third derivative."""
    s, v, a = chain
    return [s + t * (v + t * (a / 2 + t * third / 6)), v + t * (a + t * third / 2), a + t * third]


def _jerk(curve: Expression, at: Expression, third: Expression) -> Expression:
    """Returns the container's jerk d³x/dt³ in world axes [m/s³]."""
    tangent, bend, change = casadi().vertsplit(curve, 3)
    return tangent * third + 3 * bend * at[1] * at[2] + change * at[1] ** 3


def _turned_back(x: Expression, y: Expression, vector: Expression) -> Expression:
    """Rotates a vector by the inverse of the rotation vector (x, y, 0)."""
    ca = casadi()

    # Even functions of the angle, smooth at 0.
    angle = ca.sqrt(x * x + y * y + TUNING.least_angle**2)
    sine, versine = ca.sin(angle) / angle, 0.5 * (ca.sin(0.5 * angle) / (0.5 * angle)) ** 2
    axis = ca.vertcat(x, y, 0.0)
    return (
        ca.cos(angle) * vector
        - sine * ca.cross(axis, vector)
        + versine * axis * (x * vector[0] + y * vector[1])
    )
