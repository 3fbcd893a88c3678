"""Selects valid input samples, counts invalid ones and detects gaps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from slosh_motion.checks.stamp_checks import StampUnit
from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.frames import Vector
from slosh_motion.tuning import TUNING


class SampleVerdict(Enum):
    """How an input sample was judged: used, or dropped for a reason."""

    USE = "used"
    RESTART = "used after a gap"
    STALE = "stale"
    UNSTAMPED = "stamped 0"
    AHEAD = "stamped in the future"
    REPEATED = "repeated"
    DISORDERED = "out of order"
    NOT_FINITE = "not finite"
    IMPOSSIBLE = "out of physical range"
    APART = "isolated in time"
    JUMP = "jumps above max_jump"
    WRONG_FRAME = "wrong frame"

    # Each sample is counted by its verdict, and Enum's own hash is a function in Python.
    __hash__ = object.__hash__


DROPPED = tuple(
    verdict
    for verdict in SampleVerdict
    if verdict not in (SampleVerdict.USE, SampleVerdict.RESTART)
)


@dataclass(frozen=True, slots=True)
class GateSettings:
    """Limits on gap, age and jump by which input samples are accepted or dropped.

    Attributes:
        max_gap: longest time between two samples that is integrated across [s]. A later one is
            believed when the next one follows it; a single stray stamp is set aside.
        max_age: how far a sample's stamp may lie before or after its arrival [s].
        max_jump: largest change of an axis' acceleration from one sample to the next [m/s²]. What
            changes by more is set aside, until samples in a row agree that it is so: then the
            motion between is unknown, as after a gap.
        restart_after: so many samples in order before the newest one mean that time itself was
            set back, by a restarted simulation or a corrected clock: the gate starts anew with
            them.
        confirms: whether what comes after a gap waits for the next one; where all samples are
            known strays are sorted out before.
        chosen: whether a gate has judged the samples before, and only those that it used come:
            what jumps then follows what had been set aside.

    Raises:
        SloshMotionError: a limit is not positive.
    """

    max_gap: float = 0.05
    max_age: float = 0.5
    max_jump: float = 20.0
    restart_after: int = 20
    confirms: bool = True
    chosen: bool = False

    def __post_init__(self) -> None:
        for name in ("max_gap", "max_age", "max_jump", "restart_after"):
            if not getattr(self, name) > 0:
                raise SloshMotionError(f"{name} = {getattr(self, name)!r} must be positive")


def fault_of(values: Vector, largest: float) -> SampleVerdict | None:
    """Returns what is wrong with an input vector, e.g. NaN; None if it is valid.

    Args:
        largest: size up to which each of them is possible, in their unit.
    """
    x, y, z = values
    if -largest <= x <= largest and -largest <= y <= largest and -largest <= z <= largest:
        return None
    return SampleVerdict.IMPOSSIBLE if math.isfinite(x + y + z) else SampleVerdict.NOT_FINITE


class SampleGate:
    """Accepts or drops input samples by their stamps and by jumps of the acceleration.

    Attributes:
        used, dropped: samples that were used, and that were not.
        interval_ns: time between the last two that were used [ns]; 0: there is none.
        gap_ns: the last time without a sample that was longer than max_gap [ns]; 0: none.
    """

    def __init__(self, settings: GateSettings) -> None:
        self.counts: dict[SampleVerdict, int] = dict.fromkeys(SampleVerdict, 0)
        # Kept beside the counts: they are read for each message.
        self.used = self.dropped = 0
        self.interval_ns = self.gap_ns = 0
        self.unit = StampUnit()
        self.change(settings)
        self._agreeing = 1 if settings.chosen else TUNING.agreeing
        self._restart_after = settings.restart_after
        self._last_ns: int | None = None
        self._early_ns: int | None = None
        self._early_count = 0
        self._confirms = settings.confirms and not settings.chosen
        self._apart_ns: int | None = None
        self._last: Vector = (0.0, 0.0, 0.0)
        self._aside: Vector = (0.0, 0.0, 0.0)
        self._aside_count = 0

    def change(self, settings: GateSettings) -> None:
        """Sets new limits max_gap, max_age and max_jump for the next samples."""
        self._max_gap_ns = round(settings.max_gap * 1e9)
        self._max_age_ns = round(settings.max_age * 1e9)
        self._max_jump = settings.max_jump

    @property
    def max_gap_ns(self) -> int:
        """Longest time without samples that the models integrate across [ns]."""
        return self._max_gap_ns

    @property
    def gaps(self) -> int:
        """Number of restarts after gaps in the input."""
        return max(0, self.counts[SampleVerdict.RESTART] - 1)

    def judge(
        self,
        stamp_ns: int,
        acceleration: Vector | None,
        now_ns: int | None = None,
        fault: SampleVerdict | None = None,
    ) -> SampleVerdict:
        """Decides whether one input sample is used or dropped.

        Args:
            stamp_ns: its stamp [ns].
            acceleration: that it tells [m/s²]; None: it tells none.
            now_ns: the time of its arrival, on the stamps' clock [ns]; None: age does not matter.
        """
        self.unit.take(stamp_ns)
        verdict = self._judge(stamp_ns, acceleration, now_ns, fault)
        self.counts[verdict] += 1
        if verdict is SampleVerdict.USE or verdict is SampleVerdict.RESTART:
            self.used += 1
            last = self._last_ns
            self.interval_ns = 0 if last is None else max(stamp_ns - last, 0)
            self.go_on(stamp_ns, acceleration)
        else:
            self.dropped += 1
        return verdict

    @property
    def last_ns(self) -> int | None:
        """Stamp of the last accepted sample [ns], or None before the first one."""
        return self._last_ns

    @property
    def last(self) -> Vector:
        """Last accepted acceleration [m/s²]; samples without acceleration do not change it."""
        return self._last

    def go_on(self, stamp_ns: int, acceleration: Vector | None) -> None:
        """Continues from a replaced gate's last accepted sample: stamp [ns], acceleration."""
        self._last_ns, self._early_ns, self._apart_ns = stamp_ns, None, None
        self._early_count = self._aside_count = 0
        if acceleration is not None:
            self._last = acceleration

    def judge_many(
        self, stamps: NDArray[np.int64], accelerations: NDArray[np.float64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Accepts or drops N samples in order of arrival, without regard to their age.

        Args:
            stamps: (N,) [ns].
            accelerations: (N, 3) [m/s²].

        Returns:
            (N,) which of them are used, and (N,) which of these come after a gap.
        """
        count = len(stamps)
        if count and self._all_follow(stamps, accelerations):  # as nearly always
            self._last_ns = int(stamps[-1])
            ax, ay, az = accelerations[-1].tolist()
            self._last = (ax, ay, az)
            self.counts[SampleVerdict.USE] += count
            self.used += count
            return np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
        verdicts = [
            self.judge(stamp, (ax, ay, az))
            for stamp, (ax, ay, az) in zip(stamps.tolist(), accelerations.tolist(), strict=True)
        ]
        restarted = np.array(
            [verdict is SampleVerdict.RESTART for verdict in verdicts], dtype=bool
        )
        used = np.array([verdict is SampleVerdict.USE for verdict in verdicts], dtype=bool)
        return used | restarted, restarted

    def refuse(self, verdict: SampleVerdict) -> None:
        """Counts a sample that was dropped for a reason other than its stamp."""
        self.counts[verdict] += 1
        self.dropped += 1

    def _judge(
        self,
        stamp_ns: int,
        acceleration: Vector | None,
        now_ns: int | None,
        fault: SampleVerdict | None,
    ) -> SampleVerdict:
        if fault is None and acceleration is not None:
            fault = fault_of(acceleration, TUNING.strongest)
        if fault is not None:
            return fault
        if now_ns is not None and not -self._max_age_ns <= now_ns - stamp_ns <= self._max_age_ns:
            early = SampleVerdict.STALE if stamp_ns else SampleVerdict.UNSTAMPED
            return early if stamp_ns < now_ns else SampleVerdict.AHEAD
        last = self._last_ns
        if last is not None and stamp_ns <= last:
            if stamp_ns == last:
                return SampleVerdict.REPEATED
            if not self._time_was_set_back(stamp_ns):
                return SampleVerdict.DISORDERED
            last = None
        if last is None:
            return SampleVerdict.RESTART
        if stamp_ns - last > self._max_gap_ns:
            return self._after_gap(stamp_ns)
        if acceleration is None or self._near(acceleration, self._last):
            return SampleVerdict.USE
        return self._jumped(acceleration)

    def _after_gap(self, stamp_ns: int) -> SampleVerdict:
        """Holds back a sample after a gap until the next sample confirms its stamp."""
        apart, self._apart_ns = self._apart_ns, stamp_ns
        before = apart if apart is not None else self._last_ns
        if before is not None and stamp_ns - before > self._max_gap_ns:
            self.gap_ns = stamp_ns - before
        follows = apart is not None and stamp_ns > apart
        return SampleVerdict.RESTART if follows or not self._confirms else SampleVerdict.APART

    def _jumped(self, acceleration: Vector) -> SampleVerdict:
        """Holds back samples after a jump of the acceleration until enough samples agree."""
        agrees = self._aside_count > 0 and self._near(acceleration, self._aside)
        self._aside_count = self._aside_count + 1 if agrees else 1
        self._aside = acceleration
        return SampleVerdict.RESTART if self._aside_count >= self._agreeing else SampleVerdict.JUMP

    def _near(self, one: Vector, other: Vector) -> bool:
        bound = self._max_jump
        dx, dy, dz = one[0] - other[0], one[1] - other[1], one[2] - other[2]
        return -bound <= dx <= bound and -bound <= dy <= bound and -bound <= dz <= bound

    def _all_follow(self, stamps: NDArray[np.int64], accelerations: NDArray[np.float64]) -> bool:
        """Returns whether all samples follow each other without gaps or jumps."""
        if self._last_ns is None or self._early_count or self._aside_count or self._apart_ns:
            return False
        steps = np.diff(stamps, prepend=np.int64(self._last_ns))
        if steps.min() <= 0 or steps.max() > self._max_gap_ns:
            return False
        changes = np.abs(np.diff(accelerations, axis=0, prepend=[self._last]))
        # Written so that NaN fails too.
        return bool(
            changes.max() <= self._max_jump and np.abs(accelerations).max() <= TUNING.strongest
        )

    def _time_was_set_back(self, stamp_ns: int) -> bool:
        """Returns whether enough increasing stamps before the last used one show a clock reset."""
        in_order = self._early_ns is not None and stamp_ns > self._early_ns
        self._early_count = self._early_count + 1 if in_order else 1
        self._early_ns = stamp_ns
        return self._early_count >= self._restart_after
