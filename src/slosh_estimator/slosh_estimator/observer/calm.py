"""Determines whether the liquid is calm, and when it will be."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final, NamedTuple

from slosh_estimator.observer.states import FusedState
from slosh_estimator.tuning import TUNING


class CalmReason(IntEnum):
    """Reason why the liquid is not calm; the values are those of Calm.msg."""

    CALM = 0
    MOVING = 1
    SETTLING = 2
    UNSURE = 3
    STALE = 4


class CalmState(NamedTuple):
    """Calmness of the liquid, assuming that the container does not move from now on.

    Attributes:
        stamp_ns: the moment [ns].
        reason: CALM, or why it is not.
        tolerance: height of a calm wave [m].
        envelope: largest height that the wave still reaches [m].
        bound: the same with a probability of 95 % [m].
        wait: time until the wave is within the tolerance [s]; 0: it is.
        shortest, longest: that time with a probability of 95 % each [s]; infinite: unknown.
    """

    stamp_ns: int
    reason: CalmReason
    tolerance: float
    envelope: float
    bound: float
    wait: float
    shortest: float
    longest: float

    @property
    def calm(self) -> bool:
        """Whether the liquid is calm: no reason against it is known."""
        return self.reason is CalmReason.CALM


CALM_FIELDS: Final = (
    "calm", "reason", "tolerance", "envelope", "bound", "time_until_calm", "shortest_time",
    "longest_time",
)  # fmt: skip
"""Fields of Calm.msg, beside the header."""


def calm_fields(state: CalmState) -> dict[str, float]:
    """Returns the numbers of Calm.msg by field name; an unknown time is NaN."""
    times = (state.wait, state.shortest, state.longest)
    told = (value if math.isfinite(value) else math.nan for value in times)
    values = (state.calm, int(state.reason), state.tolerance, state.envelope, state.bound, *told)
    return dict(zip(CALM_FIELDS, values, strict=True))


class CalmWatch:
    """Determines the calmness from successive fused states.

    The liquid becomes calm where its wave is surely within the tolerance for the rest of time. It
    stays so until the bound exceeds the tolerance clearly, or the container moves.

    Args:
        tolerance: height of a calm wave [m].
    """

    def __init__(self, tolerance: float) -> None:
        self.tolerance = tolerance
        self._calm = False
        self._first_ns: int | None = None

    def begin(self, first_ns: int) -> None:
        """Sets the stamp of the first fused state [ns]; until the first `update` it is unknown."""
        self._first_ns = first_ns

    def update(self, state: FusedState) -> CalmState:
        """Computes from the next fused state whether, or when, the liquid is calm."""
        if self._first_ns is None or state.stamp_ns < self._first_ns:  # or time was set back
            self._first_ns = state.stamp_ns
        return CalmState(
            state.stamp_ns, self._reason(state, self._first_ns), self.tolerance,
            state.envelope, state.bound, *self._waits(state),
        )  # fmt: skip

    def _reason(self, state: FusedState, first_ns: int) -> CalmReason:
        since = math.inf if state.moved_ns is None else state.stamp_ns - state.moved_ns
        if self._calm:
            self._calm = state.bound <= TUNING.calm_again * self.tolerance
        else:
            self._calm = state.sure_bound <= self.tolerance
        if since < TUNING.calm_after_ns:
            self._calm = False
            return CalmReason.MOVING
        # A start beside a wave: the first measurements have not come yet.
        if state.corrected_ns is None and state.stamp_ns - first_ns < TUNING.calm_first_ns:
            self._calm = False
        if self._calm:
            return CalmReason.CALM
        return CalmReason.SETTLING if state.envelope > self.tolerance else CalmReason.UNSURE

    def _waits(self, state: FusedState) -> tuple[float, float, float]:
        """Returns the time until the liquid is calm, with lower and upper bound [s]."""
        spread = math.exp(TUNING.bound * state.damping_stddev)
        lowest = state.envelope - TUNING.bound * state.envelope_stddev
        return (
            self._wait(state.envelope, state.decay),
            self._wait(lowest, state.decay * spread),
            self._wait(state.bound, state.slowest),
        )

    def _wait(self, height: float, decay: float) -> float:
        """Returns the time in which a wave height decays to the tolerance [s]."""
        if not height > self.tolerance:
            return 0.0 if height == height else math.inf
        return math.log(height / self.tolerance) / decay if decay > 0.0 else math.inf
