"""Finds the fastest time law along a path by direct collocation (CasADi, IPOPT).

State at each node: place s, speed and acceleration along the leg, the tilts' likewise where the
container may tilt, and the liquid's first mode; controls: the third derivatives of what is driven,
constant between two nodes; free: each leg's duration. The limits hold at the nodes and half-way
between two. Neither sees what happens elsewhere: what comes out is to be simulated, see `plan`.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_plan.planning.collocation import CollocationProblem
from slosh_plan.planning.flow import Flow, casadi
from slosh_plan.planning.interval import CHAIN, LIMITS, StateLayout
from slosh_plan.planning.limits import LARGEST, PlanLimits
from slosh_plan.planning.loose_terms import LooseTerms
from slosh_plan.planning.path import Path
from slosh_plan.planning.progress import never
from slosh_plan.tuning import TUNING

_OPTIONS = {
    "ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": 1e-6,
    "ipopt.mu_init": 1e-2, "ipopt.max_iter": TUNING.most_iterations, "ipopt.acceptable_tol": 1e-4,
    "ipopt.acceptable_iter": 8,
}  # fmt: skip


def available() -> bool:
    """Returns whether the library CasADi is installed."""
    return importlib.util.find_spec("casadi") is not None


@dataclass(frozen=True, slots=True, eq=False)
class LegGuess:
    """Initial guess for the motion along a leg and the liquid's state, at even time steps.

    Attributes:
        duration: of the leg [s].
        states: (n + 1, K) as `StateLayout` has them: s [m] and its first two derivatives, the
            tilts [rad] and theirs where there are any, each liquid's x, y, ẋ, ẏ.
        controls: (n, D) third derivatives of s and of the tilts between nodes.
        middles: (n, 4 for each liquid) the liquids half-way between nodes.
    """

    duration: float
    states: Array
    controls: Array
    middles: Array

    @property
    def tilts(self) -> bool:
        """Whether the container tilts in the initial guess."""
        return len(self.controls[0]) > 1

    def slowed(self, factor: float) -> LegGuess:
        """Returns the guess with its motion slowed by a factor and the same liquid states."""
        states, driven = self.states.copy(), self.controls.shape[1]
        states[:, : CHAIN * driven] /= np.tile(factor ** np.arange(CHAIN), driven)
        return LegGuess(factor * self.duration, states, self.controls / factor**3, self.middles)


@dataclass(frozen=True, slots=True, eq=False)
class PathSolution:
    """Result of an optimisation: the motion, and the solver's status.

    Attributes:
        legs: the motion: where the next search may start.
        converged: whether the solver says that it is a local optimum.
        status: the solver's own words.
    """

    legs: tuple[LegGuess, ...]
    converged: bool
    status: str


def node_counts(durations: Sequence[float]) -> tuple[int, ...]:
    """Returns the number of collocation intervals of each leg."""
    total = sum(durations)
    count = min(max(TUNING.nodes_per_second * total, TUNING.fewest_nodes), TUNING.most_nodes)
    return tuple(max(TUNING.fewest_on_a_leg, round(count * part / total)) for part in durations)


class PathSearch:
    """Optimisation for one path and number of nodes, with the limits as parameters.

    Args:
        flows: the liquids: of the model, and of others that keep the limits, too.
        path: the path.
        yaw: of the container [rad].
        durations: of the legs as far as they are known [s]: the nodes are laid out by them.
        tilting: whether the container may tilt.
        loose: how the container stands on its tray, with each liquid; empty: it is held.

    Attributes:
        counts: intervals of each leg.
        layout: of the states.
    """

    def __init__(
        self,
        flows: Sequence[Flow],
        path: Path,
        yaw: float,
        durations: Sequence[float],
        *,
        tilting: bool = False,
        loose: tuple[LooseTerms, ...] = (),
    ) -> None:
        self.counts = node_counts(durations)
        self.layout = StateLayout(tilting, len(flows))
        self._path = path
        self._problem = CollocationProblem(
            tuple(flows), path, yaw, self.counts, self.layout, loose
        )
        # Asked at each iteration; another one in each search.
        self._stop: Callable[[], bool] = never
        self._stopper = _stopper(lambda: self._stop(), self._problem.sizes())
        self._made: Any = None
        self._made_for = 0.0

    def solve(
        self,
        limits: PlanLimits,
        guess: Sequence[LegGuess],
        seconds: float,
        stop: Callable[[], bool] = never,
    ) -> PathSolution:
        """Solves the optimisation from an initial guess; returns motion and status.

        Args:
            limits: to be kept.
            guess: of each leg, with the search's numbers of nodes.
            seconds: after which the solver gives up.
            stop: is asked at every iteration whether to give up, but not while the solver looks
                for any point at all that keeps the limits.
        """
        self._stop = stop
        solver = self._solver(min(seconds, TUNING.longest_solve))
        lower, upper = self._bounds(guess)
        answer = solver(
            x0=self._packed(guess), lbx=lower, ubx=upper, lbg=self._problem.lower,
            ubg=self._problem.upper, p=[min(getattr(limits, name), LARGEST) for name in LIMITS],
        )  # fmt: skip
        stats = solver.stats()
        legs = self._unpacked(np.asarray(answer["x"]).ravel())
        return PathSolution(legs, bool(stats["success"]), str(stats["return_status"]))

    def _solver(self, seconds: float) -> Any:
        """Returns IPOPT's solver; makes a new one if its time limit exceeds the time left."""
        if self._made is None or seconds < 0.6 * self._made_for:
            options = {
                "iteration_callback": self._stopper, "ipopt.max_wall_time": max(seconds, 0.1)
            }  # fmt: skip
            self._made = self._problem.solver(_OPTIONS | options)
            self._made_for = seconds
        return self._made

    def _bounds(self, guess: Sequence[LegGuess]) -> tuple[Array, Array]:
        lower, upper = [], []
        count = self.layout.liquids
        for part, leg in zip(guess, self._path.legs, strict=True):
            shape = (len(part.states), self.layout.size)
            least, most = np.full(shape, -np.inf), np.full(shape, np.inf)
            least[:, :2] = -1e-9
            most[:, 0] = leg.length / self.layout.scale[0] + 1e-9
            # What is given there needs no bounds, which would have no room between them.
            least[[0, -1]], most[[0, -1]] = -np.inf, np.inf
            free = np.full(part.controls.size + part.middles.size, np.inf)
            lower += [np.array([0.1 * part.duration]), least.ravel(), -free]
            upper += [np.array([4.0 * part.duration]), most.ravel(), free]
        return np.concatenate([*lower, np.zeros(count)]), np.concatenate([*upper, np.ones(count)])

    def _packed(self, guess: Sequence[LegGuess]) -> Array:
        parts = []
        for part in guess:
            parts += [
                np.array([part.duration]),
                (part.states / self.layout.scale).ravel(),
                (part.controls / self.layout.control_scale).ravel(),
                (part.middles / self.layout.scale[self.layout.liquid]).ravel(),
            ]
        return np.concatenate([*parts, np.full(self.layout.liquids, 0.5)])

    def _unpacked(self, x: Array) -> tuple[LegGuess, ...]:
        legs, layout = [], self.layout
        for count in self.counts:
            sizes = (1, layout.size * (count + 1), layout.driven * count, layout.waves * count)
            duration, states, controls, middles, x = np.split(x, np.cumsum(sizes))
            legs.append(
                LegGuess(
                    float(duration[0]),
                    states.reshape(-1, layout.size) * layout.scale,
                    controls.reshape(-1, layout.driven) * layout.control_scale,
                    middles.reshape(count, layout.waves) * layout.scale[layout.liquid],
                )
            )
        return tuple(legs)


def _stopper(stop: Callable[[], bool], counts: dict[str, int]) -> Any:
    """Returns a CasADi callback that can stop the solver after each iteration."""
    ca = casadi()
    rows = {"x": "x", "g": "g", "lam_x": "x", "lam_g": "g", "lam_p": "p", "f": "f"}
    sizes = [counts.get(rows[name], 1) for name in ca.nlpsol_out()]

    class Stopper(ca.Callback):  # type: ignore[name-defined]
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.construct("stopper", {})

        def get_n_in(self) -> int:
            return len(sizes)

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            return ca.Sparsity.dense(sizes[i], 1)

        def eval(self, _: Any) -> list[int]:
            return [int(stop())]

    return Stopper()
