"""Compares the stamps of messages with the times at which they were recorded.

A message may be late, but the clock that stamps it runs as the recorder's does, and goes on
evenly. Stamps that are counted at a nominal rate, written in another unit or set while the robot
moves change the motion that follows from them, and nothing else shows it.

A recording of a simulation, or one made while another was played back, has stamps far from its
log times. There the log times tell nothing certain.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, Integers
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
