"""Compares the stamps of messages with the times at which they were recorded.

A message may be late, but the clock that stamps it runs as the recorder's does, and goes on
evenly. Stamps that are counted at a nominal rate, written in another unit or set while the robot
moves change the motion that follows from them, and nothing else shows it.

A recording of a simulation, or one made while another was played back, has stamps far from its
log times. There the log times tell nothing certain.

A controller or a camera measures evenly. Where its messages are stamped as they are sent or
arrive, the motion is smoother at even times, in the order of arrival, than at the stamps. Where
it measures unevenly and stamps rightly the stamps are smoother, and with noise both are alike. The
filter of poses finds the even times itself, unless stamps are nearer to another tick.

A scatter σ of the stamps is an error vσ of each position. As white noise it makes waves: for the
wave of frequency ω their mean square is (1.82 ω σ)² dt/2 ∫v²dt, without damping. 1.82 is the
height of a deep round container's first mode for its displacement (DL22, table 1).
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median
from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, Integers
from slosh_motion.checks.constancy import Vector
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.tuning import TUNING

_DAY = 86_400.0
_UNITS = {
    "is always 0": SECOND, "holds milliseconds": SECOND // 1_000, "holds microseconds": 1_000
}  # fmt: skip
"""What a fraction is whose largest value is below a second's nanoseconds over this."""
_REMEDY = "let the driver stamp each message with the time of measurement"


class StampUnit:
    """Finds stamps whose fraction of a second is in another unit than nanoseconds, or missing.

    Within a second such fractions stay below what the unit allows.
    """

    def __init__(self) -> None:
        self._largest = self._count = self._seconds = 0
        self._second = -1

    def take(self, stamp_ns: int) -> None:
        """Adds a stamp [ns]."""
        second, fraction = divmod(stamp_ns, SECOND)
        self._count += 1
        self._seconds += second != self._second
        self._second = second
        if fraction > self._largest:
            self._largest = fraction

    @property
    def text(self) -> str:
        """What is wrong, with the remedy; empty: nothing is known to be."""
        # One second alone may have begun with the first message.
        if self._count < TUNING.clock_messages or not 3 <= self._seconds <= self._count // 3:
            return ""
        for name, unit in _UNITS.items():
            if self._largest < SECOND // unit:
                return (
                    f"the stamps' nanosec {name}: "
                    "write the fraction of the second in ns, below 1000000000"
                )
        return ""


class _Clock(NamedTuple):
    """Stamps and log times of one publisher, from their first [s]."""

    stamps: Array
    logs: Array


def stamp_doubts(stamps: Integers, logs: Integers, noun: str) -> tuple[InputDoubt, ...]:
    """Returns how the stamps of one publisher contradict the log times, one sentence each.

    Args:
        stamps: (N,) in order of arrival [ns].
        logs: (N,) when each message was recorded [ns].
        noun: what comes, in the plural.
    """
    filled = stamps != 0
    if np.count_nonzero(filled) < TUNING.clock_messages:
        return ()
    stamps, logs = stamps[filled], logs[filled]
    unit = StampUnit()
    for stamp in stamps.tolist():
        unit.take(stamp)
    if unit.text:
        return (InputDoubt(unit.text),)
    clock = _Clock((stamps - stamps[0]) / SECOND, (logs - logs[0]) / SECOND)
    if not clock.stamps.any():
        return (InputDoubt(f"all {noun} have the same stamp: {_REMEDY}"),)
    if float(np.ptp(clock.logs)) < TUNING.clock_span:
        return ()
    apart = abs(float(stamps[0] - logs[0])) / SECOND > _DAY
    rate = _rate(clock)
    if abs(rate - 1.0) > TUNING.clock_rate and _grows_evenly(clock):
        return (_rate_doubt(rate, clock, noun, apart=apart),)
    return () if apart else _step_doubt(clock, noun)


def _rate_doubt(rate: float, clock: _Clock, noun: str, *, apart: bool) -> InputDoubt:
    told = (
        f"the stamps of the {noun} advance by {float(np.ptp(clock.stamps)):.4g} s while "
        f"{float(np.ptp(clock.logs)):.4g} s passed"
    )
    if apart:
        return InputDoubt(f"{told}: a simulated clock, or a recording played back?", wrong=False)
    unit = "in another unit, or " if not 0.1 < rate < 10.0 else ""
    return InputDoubt(f"{told}: they are {unit}counted at a rate that is not real; {_REMEDY}")


def _rate(clock: _Clock) -> float:
    """Returns by how much the stamps advance per second of log time: the median over pairs."""
    half = len(clock.logs) // 2
    passed = clock.logs[half:] - clock.logs[: len(clock.logs) - half]
    gone = clock.stamps[half:] - clock.stamps[: len(clock.stamps) - half]
    known = passed > 0.0
    return float(np.median(gone[known] / passed[known])) if known.any() else 1.0


def _grows_evenly(clock: _Clock) -> bool:
    """Returns whether stamps and log times drift apart all the time, as no delay does.

    The least of a quarter's delays tells the clocks' offset there: a message cannot come early.
    """
    behind = clock.logs - clock.stamps
    ends = np.searchsorted(clock.logs, float(clock.logs[-1]) * np.arange(1, 4) / 4.0)
    quarters = np.split(behind, ends)
    if min(map(len, quarters)) < 3:
        return False
    growth = np.diff([float(each.min()) for each in quarters])
    sizes = np.abs(growth)
    same = bool((growth > 0.0).all() or (growth < 0.0).all())
    least, most = float(sizes.min()), float(sizes.max())
    return same and least > 0.6 * most and 3.0 * least > TUNING.clock_growth


def _step_doubt(clock: _Clock, noun: str) -> tuple[InputDoubt, ...]:
    """Returns where a clock was set: the stamps step, the log times do not, and it stays so."""
    stamped, passed = np.diff(clock.stamps), np.diff(clock.logs)
    usual = float(np.median(passed))
    noise = float(np.quantile(np.abs(stamped - passed), 0.9))
    uneven = float(np.quantile(np.abs(stamped - usual), 0.9))
    least = max(TUNING.clock_step, 0.5 * usual, 3.0 * noise, 3.0 * uneven)
    strange = np.abs(stamped - passed) > least
    even = np.abs(passed - usual) < 0.3 * least
    behind = clock.logs - clock.stamps  # how late each message is, and the clocks' offset
    window = max(int(TUNING.clock_beside / max(usual, 1e-6)), 5)
    found: list[tuple[float, float]] = []
    for row in np.flatnonzero(strange & even & (np.abs(stamped - usual) > least)).tolist():
        before, after = behind[max(row + 1 - window, 0) : row + 1], behind[row + 1 :][:window]
        if min(len(before), len(after)) < 5:
            continue
        step = float(np.median(before) - np.median(after))
        # Stamps of single messages that are off come back at once.
        if abs(step) > least and abs(step - (stamped[row] - passed[row])) < 0.3 * abs(step):
            found.append((float(clock.logs[row]), step))
    if not found:
        return ()
    at, step = max(found, key=lambda each: abs(each[1]))
    count = f"{len(found)} times, at most " if len(found) > 1 else ""
    return (
        InputDoubt(
            f"the stamps of the {noun} step {count}by {1e3 * step:+.0f} ms, {at:.2f} s after the "
            "first message, where the log times go on evenly: the clock was set; synchronise it "
            "before recording"
        ),
    )


HEIGHT_GAIN = 1.82
"""Height at the wall for a displacement of the sloshing mass, of a deep round container."""
_SCATTER = 1.4826 / math.sqrt(1.5)
"""Standard deviation of single stamps for the median of their distances to their neighbours'."""


class JitterCheck:
    """Compares how smooth a motion is at its stamps and at even times.

    Args:
        noun: what comes, in the plural.
        order: 2 for positions, 1 for velocities.

    Attributes:
        scatter: of the stamps, where the motion shows one [s]; else 0.
    """

    def __init__(self, noun: str, order: int = 2) -> None:
        self.scatter = 0.0
        self._noun, self._order = noun, order
        self._least = TUNING.jitter_speed if order == 2 else TUNING.jitter_acceleration
        self._one: tuple[int, Vector] | None = None
        self._two: tuple[int, Vector] | None = None
        self._off: tuple[Vector, Vector] | None = None  # from even times, from the stamps
        self._rows: deque[tuple[float, float, float]] = deque(maxlen=TUNING.jitter_rows)
        self._count = self._all = self._astray = 0
        self._squares = 0.0  # of the rate of the values, over time

    def take(self, stamp_ns: int, values: Vector) -> None:
        """Adds a position [m] or a velocity [m/s], in order of arrival, with its stamp [ns]."""
        one, two = self._one, self._two
        self._one, self._two = two, (stamp_ns, values)
        if one is None or two is None:
            return
        seconds = (stamp_ns - one[0]) / SECOND
        off, self._off = self._off, None
        self._all += 1
        self._astray += seconds <= 0.0
        if not 0.0 < seconds < TUNING.jitter_gap:
            return
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = one[1], two[1], values
        dx, dy, dz = cx - ax, cy - ay, cz - az
        even = bx - ax - 0.5 * dx, by - ay - 0.5 * dy, bz - az - 0.5 * dz
        share = (two[0] - one[0]) / SECOND / seconds - 0.5
        self._astray += abs(share) > TUNING.jitter_astray
        stamped = even[0] - share * dx, even[1] - share * dy, even[2] - share * dz
        self._off = even, stamped
        rate = math.sqrt(dx * dx + dy * dy + dz * dz) / seconds
        self._squares += 0.5 * seconds * rate * rate
        if off is not None and rate > self._least:
            self._add(math.dist(even, off[0]), math.dist(stamped, off[1]), abs(share) * seconds)

    def _add(self, even: float, stamped: float, aside: float) -> None:
        """Adds how far a value is off at even times and at the stamps, and a stamp's scatter."""
        self._rows.append((even, stamped, aside))
        self._count += 1
        if self._count % TUNING.jitter_least:
            return
        smooth, rough, scatter = (median(column) for column in zip(*self._rows, strict=True))
        if smooth < TUNING.jitter_ratio * rough:
            self.scatter = max(self.scatter, _SCATTER * scatter)

    def error(self, frequency: float, interval: float) -> float:
        """Returns the standard deviation of a wave's height by the scatter [m].

        Args:
            frequency: of the wave [rad/s].
            interval: between two messages [s].
        """
        gain = HEIGHT_GAIN * (frequency if self._order == 2 else 1.0)
        return gain * self.scatter * math.sqrt(0.5 * interval * self._squares)

    def doubt(self, frequency: float, interval: float) -> Doubt | None:
        """Returns what is told of stamps that scatter; None if that does not matter.

        Args:
            frequency: of the wave [rad/s].
            interval: between two messages [s].
        """
        error = self.error(frequency, interval)
        if error < TUNING.jitter_error or self._astray < TUNING.jitter_share * self._all:
            return None
        return Doubt(
            f"the stamps of the {self._noun} scatter by {1e3 * self.scatter:.2g} ms about the "
            f"moments of measurement: heights are uncertain by {2e3 * error:.2g} mm, or more "
            "where stamps go back; let the driver stamp each message with the time of measurement"
        )
