"""Which inputs of a recording the live estimator used.

A recorder may hear a message that the estimator never got, or got too late to use. Where estimates
were recorded they tell: each carries the stamp of its input and the number of inputs used so far.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]

PATIENCE_NS = 2_000_000_000
"""An input without an estimate is decided upon once inputs this much later have come [ns]."""


class Decision(NamedTuple):
    """What became of the next inputs.

    Attributes:
        reached: how many inputs it is about.
        used: (reached,) whether the live estimator used them.
        restarts: (R,) increasing indices of inputs with which a new estimator began.
    """

    reached: int
    used: NDArray[np.bool_]
    restarts: list[int]


class LiveUse:
    """Takes recorded estimates, decides on inputs; both in the order of the recording."""

    def __init__(self) -> None:
        self._stamps = np.empty(0, dtype=np.int64)
        self._used = np.empty(0, dtype=np.int64)
        self._before: tuple[int, int] | None = None

    def add_recorded(self, stamps: Integers, used: Integers) -> None:
        """Takes recorded estimates: stamps (N,) [ns] and `samples_used` (N,)."""
        self._stamps = np.concatenate((self._stamps, stamps))
        self._used = np.concatenate((self._used, used.astype(np.int64)))

    def decide(self, stamps: Integers, *, final: bool = False) -> Decision:
        """Decides on as many of the next inputs as the recorded estimates reach.

        Args:
            stamps: (N,) of the inputs that are not decided yet [ns].
            final: nothing follows.
        """
        count = self._reached(stamps, final)
        chosen = stamps[:count]
        index = np.searchsorted(self._stamps, chosen)
        known = np.append(self._stamps, np.iinfo(np.int64).max)
        used = known[index] == chosen
        used |= self._unrecorded(index, ~used)
        restarts = self._restarts(chosen)
        self._forget(int(chosen.max()) if count else None)
        return Decision(count, used, restarts)

    def _reached(self, stamps: Integers, final: bool) -> int:
        if final:
            return len(stamps)
        last = int(self._stamps[-1]) if len(self._stamps) else -(2**62)
        if len(stamps):
            last = max(last, int(stamps[-1]) - PATIENCE_NS)
        beyond = np.flatnonzero(stamps > last)
        return int(beyond[0]) if len(beyond) else len(stamps)

    def _unrecorded(self, index: Integers, candidates: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Inputs without an estimate that were used all the same: the counter went on."""
        steps = np.diff(np.concatenate(([self._count_before()], self._used))) - 1
        # Behind the last recorded estimate nothing speaks against an input.
        steps = np.append(steps, 1)
        used: NDArray[np.bool_] = candidates & (steps[index] > 0)
        return used

    def _count_before(self) -> int:
        return 0 if self._before is None else self._before[1]

    def _restarts(self, stamps: Integers) -> list[int]:
        """Inputs with which the counter began anew."""
        counts = np.concatenate(([self._count_before()], self._used))
        places = np.flatnonzero(np.diff(counts) <= 0)
        found = np.searchsorted(stamps, self._stamps[places])
        return [int(place) for place in found if place < len(stamps)]

    def _forget(self, until: int | None) -> None:
        if until is None:
            return
        done = int(np.searchsorted(self._stamps, until, side="right"))
        if done:
            self._before = (int(self._stamps[done - 1]), int(self._used[done - 1]))
            self._stamps, self._used = self._stamps[done:], self._used[done:]
