"""Separates one estimator's estimates from those of other estimators on the same topic.

Each estimate carries the number of inputs that its estimator has used so far, which grows by one
from one estimate to the next. That and the stamps tell the estimators apart; a publisher's
identity is in no recording.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Integers

LONGEST = 500_000_000
"""Estimates that follow each other are not further apart [ns]."""
MOST = 8
"""So many others are followed."""
TOLERANCE = 0.5
"""By so much the time of a gap may differ from that of the inputs in it, relative."""


class _Estimator(NamedTuple):
    """The last known estimate of one of several estimators.

    Attributes:
        used: inputs that it had used at its newest estimate.
        stamp_ns: of that [ns].
        period_ns: between two inputs [ns]; 0: not known yet.
    """

    used: int
    stamp_ns: int
    period_ns: int = 0

    def misfit(self, used: int, stamp_ns: int) -> float | None:
        """Returns an estimate's deviation [ns] from this estimator's rate; None if not its own."""
        steps, elapsed = used - self.used, stamp_ns - self.stamp_ns
        if steps < 1 or elapsed <= 0:
            return None
        if steps == 1:
            known = self.period_ns > 0
            return abs(elapsed - self.period_ns) * known if elapsed < LONGEST else None
        misfit = abs(elapsed - steps * self.period_ns)
        return misfit if misfit < TOLERANCE * steps * self.period_ns else None

    def after(self, used: int, stamp_ns: int) -> _Estimator:
        """Returns a copy of this record with one more estimate."""
        steps = used - self.used
        return _Estimator(used, stamp_ns, (stamp_ns - self.stamp_ns) // steps)


class OneEstimator:
    """Selects the estimates of one estimator among those of several, until it restarts.

    Args:
        number: which, from 1, in the order of their first estimates.

    Attributes:
        turns: how often the estimates went on from one estimator to another; once at a restart.
    """

    def __init__(self, number: int = 1) -> None:
        self._number = number
        self.turns = self._last = 0
        self._known: list[_Estimator] = []

    @property
    def count(self) -> int:
        """Number of estimators with more than one estimate so far."""
        return sum(one.period_ns > 0 for one in self._known)

    def mask(self, stamps: Integers, used: Integers) -> NDArray[np.bool_]:
        """Returns which of the next estimates come from the selected estimator.

        Args:
            stamps: (N,) of estimates [ns], in the order of the recording.
            used: (N,) their `samples_used`.

        Returns:
            (N,).
        """
        pairs = zip(used.tolist(), stamps.tolist(), strict=True)
        of = np.array([self._take(one, stamp_ns) for one, stamp_ns in pairs], dtype=np.int64)
        self.turns += int(np.count_nonzero(np.diff(of, prepend=self._last)))
        self._last = int(of[-1]) if len(of) else self._last
        return np.asarray(of == self._number - 1)

    def _take(self, used: int, stamp_ns: int) -> int:
        """Returns the index of the known or new estimator that published an estimate."""
        fits = {
            number: misfit
            for number, one in enumerate(self._known)
            if (misfit := one.misfit(used, stamp_ns)) is not None
        }
        if not fits:
            self._known.append(_Estimator(used, stamp_ns))
            del self._known[1:-MOST]  # the first one stays
            return min(len(self._known) - 1, MOST)
        # Of two that fit alike it is the turn of the one that has been silent for longer.
        best = min(fits, key=lambda number: (fits[number], self._known[number].stamp_ns))
        self._known[best] = self._known[best].after(used, stamp_ns)
        return best
