"""When the governor's steps are made: on time, late, early, or by a clock that has jumped."""

from __future__ import annotations

import math
from typing import NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_plan.governor.unknown import Cause
from slosh_plan.tuning import TUNING

NEVER = -(2**62)


class Lapse(NamedTuple):
    """What has passed between two steps that were made.

    Attributes:
        passed: time in which the waves have gone on [s].
        doubtful: time that may not have passed, or not only this [s]; ≤ 0: any; None: none.
        cause: of that doubt.
        held: time in which the robot has held its velocity since the last step's end [s].
        uneven: by how much robot and governor may be apart [s].
    """

    passed: float
    doubtful: float | None
    cause: Cause
    held: float
    uneven: float


class StepClock:
    """Tells of each step how late or early it is.

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
        self._usual = self._later = self._sooner = 0.0
        self._usual_gap, self._share = period, 1.0 - math.exp(-period / wave)

    @property
    def has_begun(self) -> bool:
        """Whether a step was made."""
        return self._made_ns >= 0

    def arrive(self, now_ns: int) -> bool:
        """Takes the time of a step [ns]; returns whether the steps are early by a period.

        They are not where the clock goes back.
        """
        early = self._due_ns - now_ns >= TUNING.governor_missed * self._period * SECOND
        early = early and now_ns > self.last_ns
        apart = (now_ns - self.last_ns) / SECOND
        usable = 0.0 < apart <= TUNING.governor_late * self._period
        if usable:
            self._later = apart - self._usual_gap
            self._sooner = max(self._sooner, -self._later)
            self._usual_gap += self._share * self._later
        self.is_late = not usable and self.last_ns > NEVER
        self.last_ns = now_ns
        return early

    def left_out(self) -> float:
        """Leaves a step out; returns the time [s] by which a clock that went back looks so."""
        sooner, self._sooner = self._sooner, 0.0
        return min(sooner, self._period)

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
        known = 0.0 < gap <= TUNING.governor_late * self._period
        lead = (self._due_ns - now_ns) / SECOND
        held = min(max(-lead, 0.0), self._timeout)
        doubtful, cause = None, Cause.LATE
        if not known:
            lead, held = 0.0, min(max(gap - self._period, 0.0), self._timeout)
            doubtful, cause = gap, Cause.CLOCK
        elif min(held, self._later) > 0.0:
            doubtful = min(held, self._later)
        if lead <= 0.0:
            self._due_ns, lead = now_ns, 0.0
        uneven = held + abs(lead - self._usual)
        self._usual += self._share * (lead - self._usual)
        return Lapse(gap if known else self._period, doubtful, cause, held, uneven)
