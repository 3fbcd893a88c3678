"""Lets through samples that can be integrated; drops and counts the others."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_estimator.checks import in_range
from slosh_estimator.sample import Start


@dataclass(frozen=True, slots=True)
class GateSettings:
    """Limits of the gate.

    Attributes:
        max_gap: longest time between samples that is integrated across [s].
        max_age: oldest sample, against its time of arrival [s]; 0: not checked.
        restart_jump: a stamp this far back may mean that time started anew [s].
        restart_count: so many such samples in a row mean that it did.

    Raises:
        SloshEstimatorError: a value out of range.
    """

    max_gap: float = 0.05
    max_age: float = 1.0
    restart_jump: float = 1.0
    restart_count: int = 10

    def __post_init__(self) -> None:
        in_range("max_gap", self.max_gap, 1e-4, 10.0, "s")
        in_range("max_age", self.max_age, 0.0, 3600.0, "s")
        in_range("restart_jump", self.restart_jump, 0.0, 3600.0, "s")
        in_range("restart_count", self.restart_count, 1, 10_000, "samples")


class SampleGate:
    """Judges samples by their stamps.

    A gap is never integrated across: what the liquid did meanwhile is unknown, so the next sample
    starts anew. A stamp far back is dropped as out of order until several in a row come: then time
    has restarted (a simulation or a bag that loops), and a new run begins. The same rule recovers
    from a single stamp far in the future.

    Attributes:
        used, gaps, restarts: samples let through, and how many of them followed a gap or a restart.
        stale, repeated, out_of_order, not_finite: samples dropped, by reason.
    """

    __slots__ = (
        "_back_count",
        "_back_ns",
        "_last_ns",
        "_max_age_ns",
        "_max_gap_ns",
        "_restart_count",
        "_restart_ns",
        "gaps",
        "not_finite",
        "out_of_order",
        "repeated",
        "restarts",
        "stale",
        "used",
    )

    def __init__(self, settings: GateSettings | None = None) -> None:
        settings = settings or GateSettings()
        self._max_gap_ns = round(settings.max_gap * 1e9)
        self._max_age_ns = round(settings.max_age * 1e9)
        self._restart_ns = round(settings.restart_jump * 1e9)
        self._restart_count = settings.restart_count
        self.used = self.gaps = self.restarts = 0
        self.stale = self.repeated = self.out_of_order = self.not_finite = 0
        self.reset()

    @property
    def dropped(self) -> int:
        """Samples dropped, for whatever reason."""
        return self.stale + self.repeated + self.out_of_order + self.not_finite

    def reset(self) -> None:
        """The next sample is a first one; the counters stay."""
        self._last_ns: int | None = None
        self._back_ns, self._back_count = 0, 0

    def check(self, stamp_ns: int, finite: bool, receive_ns: int | None = None) -> Start | None:
        """Judges a sample.

        Args:
            stamp_ns: its stamp [ns].
            finite: whether all its values are finite.
            receive_ns: its time of arrival on the stamps' clock [ns]; None: unknown.

        Returns:
            how it continues the sample before, or None where it is dropped.
        """
        if not finite:
            self.not_finite += 1
            return None
        if self._max_age_ns and receive_ns is not None:
            if receive_ns - stamp_ns > self._max_age_ns:
                self.stale += 1
                return None
        last = self._last_ns
        start = Start.FIRST
        if last is not None:
            step = stamp_ns - last
            if step > 0:
                start = Start.CONTINUES if step <= self._max_gap_ns else Start.AFTER_GAP
            elif not self._restarted(stamp_ns, step):
                return None
        self._back_count = 0
        self._last_ns = stamp_ns
        self.used += 1
        self.gaps += start is Start.AFTER_GAP
        return start

    def _restarted(self, stamp_ns: int, step: int) -> bool:
        """Whether a stamp that does not increase starts a new run; counts it where it does not."""
        if step == 0:
            self.repeated += 1
            return False
        if step <= -self._restart_ns:
            increasing = self._back_count > 0 and stamp_ns > self._back_ns
            self._back_count = self._back_count + 1 if increasing else 1
            self._back_ns = stamp_ns
            if self._back_count >= self._restart_count:
                self.restarts += 1
                return True
        self.out_of_order += 1
        return False
