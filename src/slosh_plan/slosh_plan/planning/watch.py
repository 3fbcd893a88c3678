"""How far a planning is, for who waits for it, and its end before its time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

KNOWN_LAWS, SEARCH = "known laws", "search"
"""The phases of a planning."""


def _tell_nobody(phase: str, duration: float) -> None:
    pass


def _go_on() -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Watch:
    """Who waits for a plan.

    Attributes:
        tell: is told the phase, and the shortest safe motion so far [s]; NaN: none yet.
        stopped: asked often, between iterations of the solver, too; true: the planning ends with
            the fastest safe motion so far.
    """

    tell: Callable[[str, float], None] = _tell_nobody
    stopped: Callable[[], bool] = _go_on

    def begun(self) -> None:
        """Known laws are tried."""
        self.tell(KNOWN_LAWS, math.nan)

    def found(self, duration: float) -> None:
        """A motion of this duration [s] is safe, and faster ones are searched for."""
        self.tell(SEARCH, duration)


NOBODY = Watch()


def iteration_callback(casadi: Any, problem: dict[str, Any], watch: Watch) -> Any:
    """A callback for `casadi.nlpsol` that ends the solver where the watch says so."""
    of = {
        "x": problem["x"].sparsity(), "f": problem["f"].sparsity(),
        "g": problem["g"].sparsity(), "lam_x": problem["x"].sparsity(),
        "lam_g": problem["g"].sparsity(), "lam_p": problem["p"].sparsity(),
    }  # fmt: skip

    class Iteration(casadi.Callback):
        """Looks after each iteration."""

        def __init__(self) -> None:
            casadi.Callback.__init__(self)
            self.construct("iteration", {})

        def get_n_in(self) -> int:
            """The solver's outputs."""
            return int(casadi.nlpsol_n_out())

        def get_n_out(self) -> int:
            """Whether to end."""
            return 1

        def get_sparsity_in(self, number: int) -> Any:
            """Of an output of the solver."""
            return of[casadi.nlpsol_out(number)]

        def eval(self, _: Any) -> list[int]:
            """Not 0 ends it."""
            return [int(watch.stopped())]

    return Iteration()
