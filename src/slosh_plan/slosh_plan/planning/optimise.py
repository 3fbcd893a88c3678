"""The fastest time law along a path, by direct multiple shooting (CasADi, IPOPT).

State at each node: place s, speed and acceleration along the leg, and the liquid's first mode;
control: the jerk along the leg, constant between two nodes; free: each leg's duration. The limits
hold at the nodes and at some places between two. Neither sees what happens elsewhere: what comes
out is to be simulated, see `plan`.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_plan.planning.flow import Flow
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import DEGREE, Leg, Path
from slosh_plan.planning.time_law import JerkLaw
from slosh_plan.planning.watch import NOBODY, Watch, iteration_callback

Array = NDArray[np.float64]
Expression = Any

NODES_PER_SECOND = 16.0
FEWEST_NODES, MOST_NODES = 40, 100
FEWEST_ON_A_LEG = 10
SUBSTEP = 0.4
"""Longest step of the liquid's integration, in 1/ω."""
_STATE = 7
_SCALE = np.array([1.0, 1.0, 10.0, 0.01, 0.01, 0.2, 0.2])
"""Of s, its rates and the liquid's x, y, ẋ, ẏ: the search sees numbers of about 1."""
_MOST_ITERATIONS = 200


def casadi() -> Any:
    """The module, which is loaded only where something is searched."""
    return importlib.import_module("casadi")


def available() -> bool:
    """Whether CasADi is installed."""
    return importlib.util.find_spec("casadi") is not None


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """Where a search starts.

    Attributes:
        durations: of the legs [s].
        states: for each leg (n + 1, 7) s, ds/dt, d²s/dt², x, y, ẋ, ẏ at its nodes.
        jerks: for each leg (n,) [m/s³].
    """

    durations: tuple[float, ...]
    states: tuple[Array, ...]
    jerks: tuple[Array, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """What a search found.

    Attributes:
        laws: of the legs.
        guess: the same as the start of the next search.
        converged: whether the solver says that it is a local optimum.
        status: the solver's own words.
    """

    laws: tuple[JerkLaw, ...]
    guess: Guess
    converged: bool
    status: str


def node_counts(durations: Sequence[float]) -> tuple[int, ...]:
    """How many intervals each leg gets."""
    total = sum(durations)
    count = min(max(NODES_PER_SECOND * total, FEWEST_NODES), MOST_NODES)
    return tuple(max(FEWEST_ON_A_LEG, round(count * part / total)) for part in durations)


class Search:
    """The problem of one path and one number of nodes; its limits are parameters.

    Args:
        flow: the liquid.
        path: the path.
        yaw: of the container [rad].
        durations: of the legs as far as they are known [s]: the nodes are laid out by them.
        watch: may end the solver.

    Attributes:
        counts: intervals of each leg.
    """

    def __init__(
        self, flow: Flow, path: Path, yaw: float, durations: Sequence[float],
        watch: Watch = NOBODY,
    ) -> None:  # fmt: skip
        ca = casadi()

        self.counts = counts = node_counts(durations)
        # As long as the intervals of the fastest motion that is hoped for.
        interval = 0.7 * sum(durations) / sum(counts)
        substeps = max(2, math.ceil(interval * max(flow.frequency) / SUBSTEP))
        self._path = path
        self._limits = ca.MX.sym("limits", len(_LIMITS))
        self._unknowns: list[Expression] = []
        self._constraints: list[Expression] = []
        self._lower: list[Array] = []
        self._upper: list[Array] = []
        total: Expression = ca.MX(0)
        before: Expression = None
        for n, leg in enumerate(path.legs):
            duration = ca.MX.sym(f"T{n}")
            states = ca.MX.sym(f"q{n}", _STATE, counts[n] + 1)
            jerks = ca.MX.sym(f"j{n}", counts[n])
            self._unknowns += [duration, ca.vec(states), jerks]
            total += duration
            step = _interval(flow, leg, yaw, substeps)
            ends, inequalities = step.map(counts[n])(
                states[:, :-1], jerks.T, duration / counts[n], self._limits
            )
            self._add(ca.vec(ends - states[:, 1:]), 0.0, 0.0)
            self._add(ca.vec(inequalities), -np.inf, 1.0)
            self._join(states, leg, before, n)
            before = states
        residual = flow.residual(before[3:, -1] * _SCALE[3:], self._limits[1])
        self._add(ca.vertcat(*residual), -np.inf, 0.0)
        self._total = total
        self._made: Any = None
        self._made_for = 0.0
        self._watch = watch

    def _add(self, expression: Expression, lower: float, upper: float) -> None:
        self._constraints.append(expression)
        self._lower.append(np.full(expression.numel(), lower))
        self._upper.append(np.full(expression.numel(), upper))

    def _join(self, states: Expression, leg: Leg, before: Expression, n: int) -> None:
        """Rest at the path's ends and at corners, and the liquid as the leg before left it."""
        self._add(states[:2, 0], 0.0, 0.0)
        place = leg.length / _SCALE[0]
        self._add(states[0, -1] - place, 0.0, 0.0)
        self._add(states[1, -1], 0.0, 0.0)
        if before is None:
            self._add(states[2:, 0], 0.0, 0.0)
        else:
            self._add(states[3:, 0] - before[3:, -1], 0.0, 0.0)
            if self._path.reversals[n - 1]:
                self._add(states[2, 0] + before[2, -1], 0.0, 0.0)
            else:
                self._add(states[2, 0], 0.0, 0.0)
        if n == len(self._path.legs) - 1 or not self._path.reversals[n]:
            self._add(states[2, -1], 0.0, 0.0)

    def solve(self, limits: PlanLimits, guess: Guess, seconds: float) -> Solution:
        """Searches from a guess.

        Args:
            limits: to be kept.
            guess: with the search's numbers of nodes.
            seconds: after which the solver gives up.
        """
        solver = self._solver(seconds)
        lower, upper = self._bounds(guess)
        answer = solver(
            x0=self._packed(guess), lbx=lower, ubx=upper, lbg=np.concatenate(self._lower),
            ubg=np.concatenate(self._upper), p=[getattr(limits, name) for name in _LIMITS],
        )  # fmt: skip
        stats = solver.stats()
        return self._unpacked(
            np.asarray(answer["x"]).ravel(), bool(stats["success"]), str(stats["return_status"])
        )

    def _solver(self, seconds: float) -> Any:
        """IPOPT for the problem; it is made anew where its time limit has become too long."""
        ca = casadi()

        if self._made is None or seconds < 0.6 * self._made_for:
            options = {
                "ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": 1e-6,
                "ipopt.max_wall_time": max(seconds, 0.1), "ipopt.mu_init": 1e-2,
                "ipopt.max_iter": _MOST_ITERATIONS, "ipopt.acceptable_tol": 1e-4,
                "ipopt.acceptable_iter": 8,
            }  # fmt: skip
            problem = {
                "x": ca.vertcat(*self._unknowns), "f": self._total,
                "g": ca.vertcat(*self._constraints), "p": self._limits,
            }  # fmt: skip
            # Kept beside the solver, which does not hold it.
            self._callback = iteration_callback(ca, problem, self._watch)
            options["iteration_callback"] = self._callback
            self._made = ca.nlpsol("plan", "ipopt", problem, options)
            self._made_for = seconds
        return self._made

    def _bounds(self, guess: Guess) -> tuple[Array, Array]:
        lower, upper = [], []
        for count, duration, leg in zip(
            self.counts, guess.durations, self._path.legs, strict=True
        ):
            least, most = (
                np.full((count + 1, _STATE), -np.inf),
                np.full((count + 1, _STATE), np.inf),
            )
            least[:, :2] = -1e-9
            most[:, 0] = leg.length / _SCALE[0] + 1e-9
            lower += [np.array([0.1 * duration]), least.ravel(), np.full(count, -np.inf)]
            upper += [np.array([4.0 * duration]), most.ravel(), np.full(count, np.inf)]
        return np.concatenate(lower), np.concatenate(upper)

    @staticmethod
    def _packed(guess: Guess) -> Array:
        parts = []
        for duration, states, jerk in zip(guess.durations, guess.states, guess.jerks, strict=True):
            parts += [np.array([duration]), (states / _SCALE).ravel(), jerk / _JERK]
        return np.concatenate(parts)

    def _unpacked(self, x: Array, converged: bool, status: str) -> Solution:
        laws, states, durations, jerks, at = [], [], [], [], 0
        for count, leg in zip(self.counts, self._path.legs, strict=True):
            duration = float(x[at])
            node = x[at + 1 : at + 1 + _STATE * (count + 1)].reshape(-1, _STATE) * _SCALE
            at += 1 + _STATE * (count + 1)
            jerk = x[at : at + count] * _JERK
            at += count
            law = JerkLaw(duration, jerk, float(node[0, 2]))
            share = leg.length / max(float(law.nodes()[-1, 0]), 1e-9)
            laws.append(JerkLaw(duration, share * jerk, share * float(node[0, 2])))
            states.append(node)
            durations.append(duration)
            jerks.append(jerk)
        guess = Guess(tuple(durations), tuple(states), tuple(jerks))
        return Solution(tuple(laws), guess, converged, status)


_LIMITS = ("height", "residual", "acceleration", "jerk")
_EDGE = 1e-6
_JERK = 50.0
"""What the search takes the jerk in."""


def _interval(flow: Flow, leg: Leg, yaw: float, substeps: int) -> Any:
    """Function from a node's state to the next one's, with what must be at most 1 between."""
    ca = casadi()

    state, jerk, step = ca.MX.sym("state", _STATE), ca.MX.sym("j"), ca.MX.sym("step")
    limits = ca.MX.sym("limits", len(_LIMITS))
    full = state * _SCALE
    s, v, a, j = full[0], full[1], full[2], jerk * _JERK
    curve = [_spline(spline, n) for n, spline in enumerate(leg.derivatives)]
    times = [step * k / (2 * substeps) for k in range(2 * substeps + 1)]
    laws = [
        (s + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j) for t in times
    ]
    last = laws[-1]
    laws = [(_inside(p, leg.length), rate, change) for p, rate, change in laws]
    felt = [curve[1](p) * change + curve[2](p) * rate**2 for p, rate, change in laws]
    liquid = _liquid(flow, yaw, substeps)
    ending, heights = liquid(full[3:], ca.horzcat(*felt), step, limits[0])
    squared = [ca.sumsqr(felt[k]) / limits[2] ** 2 for k in range(0, 2 * substeps + 1, substeps)]
    jerks = [
        ca.sumsqr(curve[1](p) * j + 3 * curve[2](p) * rate * change + curve[3](p) * rate**3)
        / limits[3] ** 2
        for p, rate, change in (laws[0], laws[-1])
    ]
    end = ca.vertcat(*last, ending) / _SCALE
    return ca.Function(
        "interval", [state, jerk, step, limits], [end, ca.vertcat(heights, *squared, *jerks)]
    )


def _inside(s: Expression, length: float) -> Expression:
    """A place just within a leg: at its ends, and outside, CasADi's splines are zero."""
    ca = casadi()

    edge = _EDGE * length
    return ca.fmax(0.5 * edge, ca.fmin(length - 0.5 * edge, edge + (1.0 - 2.0 * _EDGE) * s))


def _liquid(flow: Flow, yaw: float, substeps: int) -> Any:
    """Function from the liquid at a node and accelerations on the way to the liquid at the next.

    With it come the heights on the way, by their limit.
    """
    ca = casadi()

    q, felt = ca.SX.sym("q", 4), ca.SX.sym("felt", 3, 2 * substeps + 1)
    step, limit = ca.SX.sym("step"), ca.SX.sym("limit")
    c, d = np.cos(yaw), np.sin(yaw)
    # The container's axes: upright, turned by the yaw.
    turn = ca.DM([[c, d, 0.0], [-d, c, 0.0], [0.0, 0.0, 1.0]])
    own = ca.horzsplit(turn @ felt)
    at, heights = q, []
    for k in range(substeps):
        heights += flow.heights(at, limit)
        at = _runge_kutta(flow, at, own[2 * k : 2 * k + 3], step / substeps)
    return ca.Function("liquid", [q, felt, step, limit], [at, ca.vertcat(*heights)])


def _spline(spline: Any, order: int) -> Any:
    ca = casadi()

    # Behind those that belong to the knots, a derivative of scipy's holds zeros.
    degree = DEGREE - order
    coefficients = np.asarray(spline.c)[: len(spline.t) - degree - 1]
    knots, flat = [spline.t.tolist()], coefficients.ravel().tolist()
    return ca.Function.bspline(f"d{order}", knots, flat, [degree], 3)


def _runge_kutta(flow: Flow, q: Expression, a: list[Expression], step: Expression) -> Expression:
    ca = casadi()

    def rate(at: Expression, felt: Expression) -> Expression:
        return ca.vertcat(at[2], at[3], *flow.acceleration(at, felt))

    k1 = rate(q, a[0])
    k2 = rate(q + step / 2 * k1, a[1])
    k3 = rate(q + step / 2 * k2, a[1])
    k4 = rate(q + step * k3, a[2])
    return q + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
