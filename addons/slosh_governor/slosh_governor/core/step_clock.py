"""When the governor's steps are made: on time, late, early, or by a clock that has jumped."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_governor.core.unknown import Cause
from slosh_governor.tuning import TUNING

NEVER = -(2**62)
_GAPS = 15
"""Recent times between steps of which the median is the usual one."""


class Lapse(NamedTuple):
    """What has passed between two steps that were made.

    Attributes:
        passed: time in which the waves have gone on [s].
        doubtful: time that may not have passed, or not only this [s]; infinite: any; 0: none.
        cause: of that doubt.
        held: time in which the robot has held its velocity since the last step's end [s].
        uneven: by how much robot and governor may be apart [s].
    """

    passed: float
    doubtful: float
    cause: Cause
    held: float
    uneven: float


class StepClock:
    """Tells of each step how late or early it is.

    A step that comes sooner than usual may be an early one, or one of a clock that went back.
    Nothing tells which until a step is left out since steps are early by a period, or comes late
    and is taken for one on time since they were early before. Both are mistakes if the clock went
    back: by all that came sooner. That steps are late and in time again by turns is usual:
    only what is sooner than ever since is doubted when it is late again.

    Args:
        period: of the steps [s].
        wave: period of the first mode [s].
        timeout: for so long a robot holds its velocity [s].

    Attributes:
        last_ns: of the last step [ns].
        is_late: whether the last step came late or the clock went back.
    """

    def __init__(self, period: float, wave: float, timeout: float) -> None:
        self._period, self._timeout = period, timeout
        self.last_ns, self.is_late = NEVER, False
        self._due_ns = self._made_ns = NEVER
        self._usual, self._share = 0.0, 1.0 - math.exp(-period / wave)
        self._gaps = deque([period] * _GAPS, maxlen=_GAPS)
        self._later = self._sooner = self._soonest = self._new = self._behind = 0.0

    @property
    def has_begun(self) -> bool:
        """Whether a step was made."""
        return self._made_ns >= 0

    def since(self, now_ns: int) -> float:
        """Returns the time since the last step [s]; before the first one a period."""
        return (now_ns - self.last_ns) / SECOND if self.last_ns > NEVER else self._period

    def arrive(self, now_ns: int) -> bool:
        """Takes the time of a step [ns]; returns whether the steps are early by a period.

        They are not where the clock goes back.
        """
        early = self._due_ns - now_ns >= TUNING.missed * self._period * SECOND
        early = early and now_ns > self.last_ns
        apart = (now_ns - self.last_ns) / SECOND
        usable = 0.0 < apart <= TUNING.late * self._period
        if usable:
            self._compare(apart)
        self.is_late = not usable and self.last_ns > NEVER
        self.last_ns = now_ns
        return early

    def _compare(self, apart: float) -> None:
        """Compares a time between two steps [s] with the usual one, the median of recent ones."""
        self._later = apart - sorted(self._gaps)[_GAPS // 2]
        self._gaps.append(apart)
        late_again = min(max(self._later, 0.0), self._new)
        self._new -= late_again
        self._behind += late_again
        self._sooner = max(self._sooner - self._later, 0.0)
        self._new += max(self._sooner - self._soonest, 0.0)
        self._soonest = max(self._soonest, self._sooner)

    def left_out(self) -> float:
        """Leaves a step out; returns the time [s] by which a clock that went back looks so."""
        found = min(self._sooner, self._period)
        self._sooner -= found
        self._soonest, self._new = self._sooner, max(self._new - found, 0.0)
        return found

    def make(self, now_ns: int) -> Lapse | None:
        """Makes a step at a time [ns]; returns what has passed since the last one, if any was."""
        lapse = self._lapse(now_ns) if self.has_begun else None
        if lapse is None:
            self._due_ns = now_ns
        self._made_ns = now_ns
        self._due_ns += round(self._period * SECOND)
        return lapse

    def _lapse(self, now_ns: int) -> Lapse:
        gap = (now_ns - self._made_ns) / SECOND
        known = 0.0 < gap <= TUNING.late * self._period
        lead = (self._due_ns - now_ns) / SECOND
        held = min(max(-lead, 0.0), self._timeout)
        doubtful, cause = max(min(held, self._later), 0.0) + self._behind, Cause.LATE
        if not known:
            lead, held = 0.0, min(max(gap - self._period, 0.0), self._timeout)
            doubtful = gap + self._sooner if gap > 0.0 else math.inf
            cause, self._sooner, self._soonest, self._new = Cause.CLOCK, 0.0, 0.0, 0.0
        self._behind = 0.0
        if lead <= 0.0:
            self._due_ns, lead = now_ns, 0.0
        uneven = held + abs(lead - self._usual)
        self._usual += self._share * (lead - self._usual)
        return Lapse(gap if known else self._period, doubtful, cause, held, uneven)
