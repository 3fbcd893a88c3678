"""Determines which of the recorded inputs the live estimator used.

A recorder may hear a message that the estimator never got, or got too late to use. Where estimates
were recorded they tell: each carries the stamp of its input and the number of inputs used so far.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Integers

PATIENCE_NS = 10_000_000_000
"""An input without an estimate is decided upon once inputs this much later have come [ns]. On a
loaded machine a recorder may hear a new estimator seconds after it began, and only the counter in
its first recorded estimate tells with which input that was."""


class Decision(NamedTuple):
    """Which of the next recorded inputs the live estimator used, and where it was restarted.

    Attributes:
        reached: how many inputs it is about.
        used: (reached,) whether the live estimator used them.
        restarts: (R,) increasing indices of inputs with which a new estimator began.
        counts: (reached,) the estimator's counter at each input, 0 where no estimate tells; None:
            nothing tells.
    """

    reached: int
    used: NDArray[np.bool_]
    restarts: list[int]
    counts: Integers | None = None


class InputMatcher:
    """Matches recorded estimates with inputs, both in recorded order.

    Inputs before the first estimate are those of an estimator that was not there yet; inputs
    behind the last one count as used, as nothing speaks against them.

    Args:
        mixed: inputs come from several publishers, so that their stamps may go back by up to a
            second, and only those with an estimate were used.

    Attributes:
        used_before: inputs that the estimator had used before the recording began.
        unclear: inputs of which the counter tells only that some were used; they are all taken.
    """

    def __init__(self, *, mixed: bool = False) -> None:
        self._mixed = mixed
        self.used_before = self.unclear = 0
        self._stamps = np.empty(0, dtype=np.int64)
        self._used = np.empty(0, dtype=np.int64)
        self._count = 0  # of the newest estimate that was forgotten
        self._heard = False  # whether inputs have come to the first estimate
        self._early = 0  # inputs before it
        self._anew = False  # whether the next input is the first of a new estimator

    def add_recorded(self, stamps: Integers, used: Integers) -> None:
        """Adds recorded estimates: stamps (N,) [ns] and `samples_used` counters (N,)."""
        self._stamps = np.concatenate((self._stamps, stamps))
        self._used = np.concatenate((self._used, used.astype(np.int64)))

    def decide(self, stamps: Integers, *, final: bool = False) -> Decision:
        """Decides on the next inputs, as far as there are recorded estimates.

        Args:
            stamps: (N,) of the inputs that are not decided yet [ns].
            final: nothing follows.
        """
        count = self._reached(stamps, final)
        chosen = stamps[:count]
        index = np.searchsorted(self._stamps, chosen)
        known = np.append(self._stamps, np.iinfo(np.int64).max)
        used = known[index] == chosen
        counts = np.where(used, np.append(self._used, 0)[index], 0)
        if not self._mixed:
            used |= self._unrecorded(index, ~used, final)
        restarts = self._starts(chosen, used)
        if count:
            self.forget(int(chosen.max()) - SECOND * self._mixed)
            self._anew = False
        return Decision(count, used, restarts, counts)

    def forget(self, until: int) -> None:
        """Drops data up to this stamp [ns], since no earlier input will follow."""
        done = int(np.searchsorted(self._stamps, until, side="right"))
        if done:
            self._anew |= bool((np.diff(self._counts()[: done + 1]) <= 0).any())
            self._count = int(self._used[done - 1])
            self._stamps, self._used = self._stamps[done:], self._used[done:]

    def remarks(self) -> tuple[str, ...]:
        """Explains, one line each, why estimates may differ despite equal model and code."""
        found = []
        if self.used_before:
            found.append(
                f"the recording begins after the estimator had used {self.used_before} inputs: "
                "the liquid's state at its beginning is unknown"
            )
        if self.unclear:
            found.append(
                f"it is unknown which of {self.unclear} inputs the live estimator used: it "
                "missed some, and the recorder missed estimates"
            )
        return tuple(found)

    def _reached(self, stamps: Integers, final: bool) -> int:
        if final:
            return len(stamps)
        last = int(self._stamps[-1]) if len(self._stamps) else -(2**62)
        if len(stamps):
            last = max(last, int(stamps[-1]) - PATIENCE_NS)
        beyond = np.flatnonzero(stamps > last)
        return int(beyond[0]) if len(beyond) else len(stamps)

    def _unrecorded(
        self, index: Integers, candidates: NDArray[np.bool_], final: bool
    ) -> NDArray[np.bool_]:
        """Returns inputs that were used although their estimate was not recorded."""
        steps = np.append(np.diff(self._counts()) - 1, len(index))
        if not self._heard and not (final and len(steps) == 1):
            steps[0] = 0
        used: NDArray[np.bool_] = candidates & (steps[index] > 0)
        waiting = np.bincount(index[candidates], minlength=len(steps))
        self.unclear += int(waiting[(steps > 0) & (waiting > steps)].sum())
        return used

    def _starts(self, stamps: Integers, used: NDArray[np.bool_]) -> list[int]:
        """Returns the inputs at which the estimator's counter of used inputs restarted."""
        restarts = [0] if self._anew and len(stamps) else []
        anew = np.diff(self._counts()) <= 0
        if not self._heard and len(anew):
            anew[0] = True
        for place in np.flatnonzero(anew).tolist():
            end = int(np.searchsorted(stamps, self._stamps[place]))
            if end == len(stamps):
                break
            # The recorder hears a new estimator late: its first estimates may not be there.
            unheard = int(self._used[place]) - 1
            before = self._stamps[place - 1] if place else -(2**62)
            start = max(int(np.searchsorted(stamps, before, side="right")), end - unheard)
            # Later where estimates of several nodes are mixed, whose stamps go back.
            start = min(start, end)
            used[start:end] = True
            if self._heard:
                restarts.append(start)
            else:
                self._heard = True
                self.used_before = max(0, unheard - self._early - end)
        if not self._heard:
            self._early += len(stamps)
        return restarts

    def _counts(self) -> Integers:
        """Returns the counter of used samples before and at each stored estimate."""
        return np.concatenate(([self._count], self._used))
