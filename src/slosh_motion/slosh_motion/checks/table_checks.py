"""Checks a complete motion in a table, a trajectory or a path.

The samples go through the streaming checks. Beyond them, a whole motion has two ends: it begins
and ends at rest, so a constant that both ends and the mean show is no acceleration.
"""

from __future__ import annotations

import math

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, Integers
from slosh_model.constants import GRAVITY
from slosh_motion.checks.constancy import (
    DEPARTURE,
    MOST,
    REST,
    TOLERANCE,
    TOP_SPEED,
    Bins,
    Stretch,
    Vector,
)
from slosh_motion.checks.constant_meaning import FINE, SIZE, Doubt, acceleration_doubt
from slosh_motion.checks.input_checks import AccelCheck, PoseCheck
from slosh_motion.checks.input_faults import FaultKind
from slosh_motion.checks.message_checks import ToAndFro
from slosh_motion.tuning import TUNING

_LONGEST = 1e9
"""Longer motions do not fit into nanoseconds [s]."""


class InputDoubt(str):
    """A warning text about a doubtful input.

    Attributes:
        wrong: whether the answer is wrong then; else it is worth a look.
    """

    __slots__ = ("wrong",)
    wrong: bool

    def __new__(cls, text: str, wrong: bool = True) -> InputDoubt:
        """Creates a warning text about a doubtful input."""
        made = super().__new__(cls, text)
        made.wrong = wrong
        return made

    @classmethod
    def of(cls, doubt: Doubt) -> InputDoubt:
        """Creates the warning text for a suspected fault."""
        return cls(doubt.text, doubt.wrong)

    def of_file(self, path: object) -> InputDoubt:
        """Returns the warning text, preceded by the path of the file."""
        return InputDoubt(f"{path}: {self}", self.wrong)


@np.errstate(over="ignore")  # what reads it refuses such numbers
def motion_doubts(
    t: Array, acceleration: Array, attitude: Array | None = None, position: Array | None = None
) -> tuple[InputDoubt, ...]:
    """Returns one sentence for each suspected fault of a motion.

    Args:
        t: (N,) rising [s].
        acceleration: (N, 3) gravity excluded, world's axes [m/s²].
        attitude: (N, 4) x, y, z, w, world ← container; None: upright.
        position: (N, 3) of the container [m]; None: not known.
    """
    if len(t) < 2 or t[-1] - t[0] > _LONGEST:
        return ()
    stamps = np.rint((t - t[0]) * SECOND).astype(np.int64)
    check = AccelCheck()
    check.add_many(stamps, acceleration, np.zeros(len(t), dtype=bool))
    check.finish()
    found = [InputDoubt.of(doubt) for doubt in check.raised.values()]
    # Missing samples are named by their gap, with the length that the liquid allows.
    faults = [f.text() for f in check.faults.faults if f.kind is not FaultKind.MISSING]
    fastest = float(np.linalg.norm(acceleration, axis=1).max())
    if not found and fastest > TUNING.unlikely:
        found.append(
            InputDoubt(
                f"accelerations up to {fastest:.4g} m/s²: are they in mm/s²? They must be m/s²"
            )
        )
    if not found:
        found += _ends_doubt(t - t[0], stamps, acceleration)
    if position is not None:
        found += _pose_doubts(stamps, position, attitude) + _row_doubts(position)
    elif attitude is not None:
        rest = _first_rest(stamps, acceleration)
        found += _pose_doubts(stamps[:rest], np.zeros((rest, 3)), attitude[:rest])
    return (*found, *map(InputDoubt, faults))


def _pose_doubts(stamps: Integers, position: Array, attitude: Array | None) -> list[InputDoubt]:
    """Returns one sentence for each suspected fault of poses."""
    check = PoseCheck()
    turns = np.tile((0.0, 0.0, 0.0, 1.0), (len(stamps), 1)) if attitude is None else attitude
    if len(stamps):
        check.add_many(stamps, position, turns)
    check.finish()
    return [InputDoubt.of(doubt) for doubt in check.raised.values()]


def _row_doubts(position: Array) -> list[InputDoubt]:
    """Returns what positions show that two sources wrote. Stairs of honest rows occur."""
    check = ToAndFro("positions")
    for x, y, z in position.tolist():
        check.take((x, y, z))
    return [InputDoubt.of(check.raised)] if check.raised is not None else []


def _first_rest(stamps: Integers, acceleration: Array) -> int:
    """Returns the number of samples before the container starts to move."""
    bins, stretch = Bins(3), Stretch(TOLERANCE, MOST)
    for row, (number, (x, y, z)) in bins.add_many(stamps, acceleration):
        if not stretch.take(number, (x, y, z)) and not stretch.first:
            return max(row - 1, 0)
    return len(stamps)


def _ends_doubt(t: Array, stamps: Integers, acceleration: Array) -> list[InputDoubt]:
    """Checks the acceleration at both ends of a motion, and its mean."""
    if t[-1] < REST:
        return []
    steps = np.diff(t)[:, None]
    speed = (0.5 * steps * (acceleration[1:] + acceleration[:-1])).sum(axis=0)
    mean: Vector = tuple((speed / t[-1]).tolist())
    if math.hypot(*mean) <= FINE:
        return []
    ends = _constant_ends(stamps, acceleration)
    peak = float(np.linalg.norm(acceleration - np.array(mean), axis=1).max())
    if t[-1] >= TUNING.shortest_table and ends is not None and peak > DEPARTURE:
        first, last = ends
        close = 0.1 + 0.25 * math.hypot(*first)
        if math.dist(first, last) <= 0.1 + 0.02 * math.hypot(*first) and (
            math.dist(first, mean) <= close
        ):
            doubt = acceleration_doubt(first)
            return [InputDoubt.of(doubt)] if doubt is not None else []
    return _mean_doubt(mean, peak, float(t[-1]))


def _mean_doubt(mean: Vector, peak: float, seconds: float) -> list[InputDoubt]:
    """Checks the mean acceleration of a motion that is not at rest at its ends."""
    size = math.hypot(*mean)
    in_g = (
        seconds >= TUNING.shortest_table
        and abs(size - 1.0) <= 0.05
        and peak < TUNING.gentle
        and abs(mean[2]) > 0.9 * size
    )
    gravity = abs(size - GRAVITY) <= SIZE * GRAVITY
    if not (in_g or gravity or size * seconds > TOP_SPEED):
        return []
    what = (
        "the mean acceleration, by which the container ends "
        f"{size * seconds:.3g} m/s faster than it began,"
    )
    doubt = acceleration_doubt(mean, what)
    return [InputDoubt.of(doubt)] if doubt is not None else []


def _constant_ends(stamps: Integers, acceleration: Array) -> tuple[Vector, Vector] | None:
    """Returns the constant accelerations at both ends of a motion; None if not constant."""
    found: list[Vector] = []
    for rows in (slice(None), slice(None, None, -1)):
        times = stamps[rows] if rows.step is None else stamps[-1] - stamps[rows]
        bins, stretch = Bins(3), Stretch(TOLERANCE, MOST)
        closed = [each for _, each in bins.add_many(times, acceleration[rows])]
        for number, (x, y, z) in closed:
            if not stretch.take(number, (x, y, z)) and not stretch.first:
                break
            if stretch.seconds >= REST:
                found.append(stretch.mean)
                break
    return (found[0], found[1]) if len(found) == 2 else None
