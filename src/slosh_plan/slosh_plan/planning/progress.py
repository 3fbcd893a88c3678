"""Reports the progress of planning, and decides when to stop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from slosh_plan.errors import SloshPlanError


class StoppedError(SloshPlanError):
    """Error that planning was stopped by the user or caller before it found a safe motion."""


@dataclass(frozen=True, slots=True)
class PlanProgress:
    """Progress of planning: phase, elapsed time and best duration so far.

    Attributes:
        phase: what is done now: 'known laws', 'search 1 of 2', …
        duration: of the fastest safe motion so far [s]; infinite: there is none yet.
        elapsed: since the planning began [s].
    """

    phase: str
    duration: float
    elapsed: float


def ignored(_: PlanProgress) -> None:
    """Ignores a progress report; default for callers that want none."""


def never() -> bool:
    """Returns False, so that planning is never stopped early."""
    return False


class Watch:
    """Reports the progress of planning to the caller, and asks whether to stop.

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
        """Time since planning began [s]."""
        return self._clock() - self._began

    def enter(self, phase: str) -> None:
        """Records that a new phase of planning begins, and reports the progress."""
        self._phase = phase
        self.stopped()

    def forget(self) -> None:
        """Discards the safe motions found for another container, when planning starts again."""
        self._duration = math.inf

    def found(self, duration: float) -> None:
        """Reports the duration [s] of a safe motion that was found."""
        self._duration = min(self._duration, duration)
        self.stopped()

    def stopped(self) -> bool:
        """Reports the progress; returns whether planning must stop."""
        self._progress(PlanProgress(self._phase, self._duration, self.elapsed))
        return self._stopped()
