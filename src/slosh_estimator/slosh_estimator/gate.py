"""Decides which input samples are used, counts the others, and sees gaps."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from slosh_estimator.errors import SloshEstimatorError


class Verdict(Enum):
    """What becomes of a sample."""

    USE = "used"
    RESTART = "used after a gap"
    STALE = "stale"
    REPEATED = "repeated"
    DISORDERED = "out of order"
    NOT_FINITE = "not finite"
    WRONG_FRAME = "wrong frame"


DROPPED = (
    Verdict.STALE,
    Verdict.REPEATED,
    Verdict.DISORDERED,
    Verdict.NOT_FINITE,
    Verdict.WRONG_FRAME,
)


@dataclass(frozen=True, slots=True)
class GateSettings:
    """Limits of the gate.

    Attributes:
        max_gap: longest time between two samples that is integrated across [s].
        max_age: oldest sample that is used, against the time of its arrival [s].
        restart_after: so many samples in order before the newest one mean that time itself was set
            back, by a restarted simulation or a corrected clock: the gate starts anew with them.

    Raises:
        SloshEstimatorError: a limit is not positive.
    """

    max_gap: float = 0.05
    max_age: float = 0.5
    restart_after: int = 20

    def __post_init__(self) -> None:
        for name in ("max_gap", "max_age", "restart_after"):
            if not getattr(self, name) > 0:
                raise SloshEstimatorError(f"{name} = {getattr(self, name)!r} must be positive")


class SampleGate:
    """Judges samples by their stamps.

    Attributes:
        counts: samples by what became of them.
        used, dropped: samples that were used, and that were not.
    """

    def __init__(self, settings: GateSettings) -> None:
        self.counts: dict[Verdict, int] = dict.fromkeys(Verdict, 0)
        # Kept beside the counts: they are read for each message.
        self.used = self.dropped = 0
        self._max_gap_ns = round(settings.max_gap * 1e9)
        self._max_age_ns = round(settings.max_age * 1e9)
        self._restart_after = settings.restart_after
        self._last_ns: int | None = None
        self._early_ns: int | None = None
        self._early_count = 0

    @property
    def gaps(self) -> int:
        """Restarts but the first."""
        return max(0, self.counts[Verdict.RESTART] - 1)

    def judge(self, stamp_ns: int, finite: bool, now_ns: int | None = None) -> Verdict:
        """Judges a sample.

        Args:
            stamp_ns: its stamp [ns].
            finite: whether all its numbers are finite.
            now_ns: the time of its arrival, on the stamps' clock [ns]; None: age does not matter.
        """
        verdict = self._judge(stamp_ns, finite, now_ns)
        self.counts[verdict] += 1
        if verdict is Verdict.USE or verdict is Verdict.RESTART:
            self.used += 1
        else:
            self.dropped += 1
        return verdict

    def judge_many(
        self, stamps: NDArray[np.int64], finite: NDArray[np.bool_]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Judges samples in the order in which they came, without regard to their age.

        Args:
            stamps: (N,) [ns].
            finite: (N,) whether all numbers of a sample are finite.

        Returns:
            (N,) which of them are used, and (N,) which of these come after a gap.
        """
        last = self._last_ns
        if last is not None and len(stamps) and finite.all() and not self._early_count:
            steps = np.diff(stamps, prepend=np.int64(last))
            if steps.min() > 0 and steps.max() <= self._max_gap_ns:  # as nearly always
                self._last_ns = int(stamps[-1])
                self.counts[Verdict.USE] += len(stamps)
                self.used += len(stamps)
                return finite, np.zeros(len(stamps), dtype=bool)
        verdicts = [self.judge(*row) for row in zip(stamps.tolist(), finite.tolist(), strict=True)]
        restarted = np.array([verdict is Verdict.RESTART for verdict in verdicts], dtype=bool)
        used = np.array([verdict is Verdict.USE for verdict in verdicts], dtype=bool)
        return used | restarted, restarted

    def refuse(self, verdict: Verdict) -> None:
        """Counts a sample that was dropped for a reason outside its stamp."""
        self.counts[verdict] += 1
        self.dropped += 1

    def _judge(self, stamp_ns: int, finite: bool, now_ns: int | None) -> Verdict:
        if not finite:
            return Verdict.NOT_FINITE
        if now_ns is not None and now_ns - stamp_ns > self._max_age_ns:
            return Verdict.STALE
        last = self._last_ns
        if last is not None and stamp_ns <= last:
            if stamp_ns == last:
                return Verdict.REPEATED
            if not self._time_was_set_back(stamp_ns):
                return Verdict.DISORDERED
            last = None
        self._last_ns, self._early_ns, self._early_count = stamp_ns, None, 0
        if last is None or stamp_ns - last > self._max_gap_ns:
            return Verdict.RESTART
        return Verdict.USE

    def _time_was_set_back(self, stamp_ns: int) -> bool:
        """True once enough early samples follow each other in order."""
        in_order = self._early_ns is not None and stamp_ns > self._early_ns
        self._early_count = self._early_count + 1 if in_order else 1
        self._early_ns = stamp_ns
        return self._early_count >= self._restart_after
