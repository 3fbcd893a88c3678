"""How far a plan has come, for whoever waits for it, and when it is to end."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from slosh_plan.errors import SloshPlanError


class StoppedError(SloshPlanError):
    """A plan was stopped before it had any safe motion."""


@dataclass(frozen=True, slots=True)
class PlanProgress:
    """How far a plan has come.

    Attributes:
        phase: what is done now: 'known laws', 'search 1 of 2', …
        duration: of the fastest safe motion so far [s]; infinite: there is none yet.
        elapsed: since the planning began [s].
    """

    phase: str
    duration: float
    elapsed: float


def ignored(_: PlanProgress) -> None:
    """Nobody waits."""


def never() -> bool:
    """Nobody stops."""
    return False


class Watch:
    """Tells a plan's progress and when to end, while it goes on.

    Args:
        progress: is told at every phase, every candidate and every iteration of a search.
        stopped: whether somebody wants the plan to end.
        clock: tells seconds.
    """

    def __init__(
        self,
        progress: Callable[[PlanProgress], None] = ignored,
        stopped: Callable[[], bool] = never,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._progress, self._stopped, self._clock = progress, stopped, clock
        self._began = clock()
        self._phase, self._duration = "", math.inf

    @property
    def elapsed(self) -> float:
        """Since the planning began [s]."""
        return self._clock() - self._began

    def enter(self, phase: str) -> None:
        """A phase begins."""
        self._phase = phase
        self.stopped()

    def found(self, duration: float) -> None:
        """A safe motion was found [s]."""
        self._duration = min(self._duration, duration)
        self.stopped()

    def stopped(self) -> bool:
        """Whether somebody wants the plan to end; tells the progress."""
        self._progress(PlanProgress(self._phase, self._duration, self.elapsed))
        return self._stopped()
