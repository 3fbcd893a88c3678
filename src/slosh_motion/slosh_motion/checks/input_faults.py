"""Finds faults of a recorded acceleration: clipped, frozen, mixed or missing samples.

What a sensor, a driver or a bus does to an input looks like physics that a model lacks: so it is
looked for first, in tables, bags and live windows alike. Everything here is a function of samples.

- *Clipped*: an axis stays at its own extreme value for some samples, and what comes before and
  after would have gone on beyond it. A planned motion's plateau is none: it is entered along a
  straight ramp or without a slope.
- *Frozen*: all axes repeat their values while the container is being accelerated, and jump
  afterwards to where they would have gone meanwhile.
- *Mixed*: samples jump to and fro between two motions, in turns and at uneven intervals, as those
  of two publishers on one topic do.
- *Missing*: no sample for a time in which the acceleration is not nearly zero.

An input that holds its values at a lower rate than its stamps (125 Hz written at 500 Hz) is sound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_motion.tuning import TUNING

AXES = ("ax", "ay", "az")
MIXED_INPUT = "several publishers are mixed on its topic; stop one of them and record again"
"""What such a fault comes from, and what helps."""

Finder = Callable[[Array, Array], "tuple[InputFault, ...]"]
"""Takes (N,) times [s] and (N, 3) values, and returns the faults among them."""


class FaultKind(Enum):
    """Kind of an input fault: clipped, frozen, mixed or missing samples."""

    CLIPPED = "clipped"
    FROZEN = "frozen"
    MIXED = "mixed"
    MISSING = "missing"


class InputFault(NamedTuple):
    """A fault in an input: kind, time span, axis and value.

    Attributes:
        start, end: from when to when it first is [s].
        axis: 0, 1, 2: the one that is clipped; -1: all.
        value: at which it is clipped [m/s²]; NaN: it is not.
    """

    kind: FaultKind
    start: float
    end: float
    times: int
    axis: int = -1
    value: float = float("nan")

    def text(self) -> str:
        """Describes the fault, its time and its remedy in one sentence without a full stop."""
        when = f"from {self.start:.2f} to {self.end:.2f} s"
        when += f" and {self.times - 1} times more" if self.times > 1 else ""
        if self.kind is FaultKind.CLIPPED:
            return (
                f"{AXES[self.axis]} is clipped at {self.value:.4g} m/s² {when}: the sensor's "
                "range or a limit in its driver is too small; raise it and record again"
            )
        if self.kind is FaultKind.FROZEN:
            return (
                f"the acceleration repeats its values {when} while the container moves: the "
                "driver or the bus stalled; record again"
            )
        if self.kind is FaultKind.MIXED:
            return f"the acceleration jumps to and fro between two motions {when}: {MIXED_INPUT}"
        return (
            f"the acceleration has no samples {when} while the container moves: messages were "
            "lost; record again"
        )


@np.errstate(over="ignore")  # what reads it refuses such numbers
def find_input_faults(t: Array, acceleration: Array) -> tuple[InputFault, ...]:
    """Finds the faults of an input; each kind is listed once, in order of time.

    Args:
        t: (N,) increasing [s].
        acceleration: (N, 3) gravity excluded [m/s²].
    """
    if len(t) < TUNING.least_samples:
        return ()
    groups = [
        *_clipped(t, acceleration),
        *_one(FaultKind.FROZEN, _frozen(t, acceleration)),
        *_one(FaultKind.MIXED, _mixed(t, acceleration)),
        *_one(FaultKind.MISSING, _missing(t, acceleration)),
    ]
    return tuple(sorted(groups, key=lambda fault: fault.start))


def find_mixed_velocities(t: Array, velocities: Array) -> tuple[InputFault, ...]:
    """Finds out whether velocities are those of two publishers in turn, one of them late.

    Args:
        t: (N,) increasing [s].
        velocities: (N, 3) [m/s].
    """
    if len(t) < TUNING.least_samples:
        return ()
    spans = _mixed(t, velocities, TUNING.apart_speed, TUNING.in_turn_speed, TUNING.least_speed)
    return tuple(_one(FaultKind.MIXED, spans))


class FaultWatch:
    """Finds the faults of an input that arrives in parts.

    Args:
        has_gravity: whether the samples are specific forces, which rest at gravity.

    Attributes:
        faults: each kind (and each clipped axis and value) once, with how often it occurred.
    """

    def __init__(self, *, has_gravity: bool = False, find: Finder = find_input_faults) -> None:
        self.faults: list[InputFault] = []
        self._find = find
        self._has_gravity = has_gravity
        self._taken: list[tuple[int, tuple[float, float, float]]] = []
        self._origin: int | None = None
        self._stamps = np.empty(0, dtype=np.int64)
        self._values = np.empty((0, 3))

    def take(self, stamp_ns: int, acceleration: tuple[float, float, float]) -> None:
        """Stores a sample [m/s²] quickly; `look` analyses it later."""
        self._taken.append((stamp_ns, acceleration))
        if len(self._taken) >= TUNING.most_taken:
            self.look()

    def look(self) -> None:
        """Analyses the stored samples if they fill a window."""
        taken, self._taken = self._taken, []
        if taken:
            stamps, values = zip(*taken, strict=True)
            self.add(np.array(stamps, dtype=np.int64), np.array(values))

    def texts(self) -> list[str]:
        """Returns one sentence for each fault that was found so far."""
        return [fault.text() for fault in self.faults]

    def add(self, stamps: NDArray[np.int64], accelerations: Array) -> None:
        """Adds input samples and searches complete windows for faults.

        Args:
            stamps: (N,) increasing, and after those before [ns].
            accelerations: (N, 3) [m/s²].
        """
        self._stamps = np.concatenate([self._stamps, stamps])
        self._values = np.concatenate([self._values, accelerations])
        if len(self._stamps) and self._stamps[-1] - self._stamps[0] >= TUNING.window_ns:
            self.finish()

    def finish(self) -> None:
        """Analyses the remaining samples at the end of a part of the input."""
        if self._taken:
            self.look()
        if not len(self._stamps):
            return
        if self._origin is None:
            self._origin = int(self._stamps[0])
        rest = np.median(self._values, axis=0) if self._has_gravity else np.zeros(3)
        t = (self._stamps - self._origin) / SECOND
        for fault in self._find(t, self._values - rest):
            self._count(fault._replace(value=fault.value + float(rest[fault.axis])))
        # A fault at the end is seen with what follows.
        kept = self._stamps > self._stamps[-1] - TUNING.overlap_ns
        self._stamps, self._values = self._stamps[kept], self._values[kept]

    def _count(self, fault: InputFault) -> None:
        for index, known in enumerate(self.faults):
            same = (known.kind, known.axis) == (fault.kind, fault.axis)
            if same and _equal(known, fault):
                if fault.start > known.start:
                    self.faults[index] = known._replace(times=known.times + fault.times)
                return
        if len(self.faults) < TUNING.most_faults:
            self.faults.append(fault)


def _equal(one: InputFault, other: InputFault) -> bool:
    """Returns whether two faults have the same clipping value, or neither has one."""
    return one.value == other.value or (math.isnan(one.value) and math.isnan(other.value))


def _one(kind: FaultKind, spans: Sequence[tuple[float, float]]) -> list[InputFault]:
    return [InputFault(kind, *spans[0], len(spans))] if spans else []


def _clipped(t: Array, acceleration: Array) -> Iterator[InputFault]:
    rough = _is_rough(acceleration)
    for axis, values in enumerate(acceleration.T):
        low, high = float(values.min()), float(values.max())
        if max(high, -low) < TUNING.fault_moving:
            continue
        quantum = _step(values)
        for extreme, sign in ((high, 1.0), (low, -1.0)):
            if sign * extreme < TUNING.fault_moving:  # where it rests, it is not clipped
                continue
            at = np.abs(values - extreme) <= TUNING.exact * (high - low)
            runs = [
                (start, end)
                for start, end in _runs(at)
                if end - start >= TUNING.flat_samples
                and (
                    rough
                    or _goes_on(sign * values, start, end, TUNING.cap * (high - low), quantum)
                )
            ]
            if runs:
                (start, end), count = runs[0], len(runs)
                yield InputFault(
                    FaultKind.CLIPPED, float(t[start]), float(t[end - 1]), count, axis, extreme
                )


def _goes_on(values: Array, start: int, end: int, least: float, quantum: float) -> bool:
    """Returns whether the curve would rise above a flat top if extended from both sides."""
    before, after = (
        values[max(start - TUNING.beside, 0) : start],
        values[end : end + TUNING.beside][::-1],
    )
    if len(before) < TUNING.beside or len(after) < TUNING.beside:
        return False
    return all(_cut_off(side, float(values[start]), least, quantum) for side in (before, after))


def _cut_off(values: Array, top: float, least: float, quantum: float) -> bool:
    """Returns whether values rise to an apex clearly above the flat top."""
    first, middle, last = np.diff(values).tolist()
    bend = middle - last
    # The value next to the top may lie between a ramp's last one and the top.
    known = max(TUNING.straight * first, TUNING.quanta * quantum)
    if not (last > 0.0 and min(first - middle, bend) > known):
        return False
    # `last` is the slope half a sample before the last value, from where the apex is foretold.
    slope, left = max(last - 0.5 * bend, 0.0), top - float(values[-1])
    rise = slope * slope / (2.0 * bend)
    return bool(rise > TUNING.arriving * left and rise - left > least)


def _is_rough(values: Array) -> bool:
    """Returns whether values are noisy, so that repeated values are a fault."""
    if any(_is_coarse(column) for column in values.T):
        return False
    first, second, third = (np.linalg.norm(np.diff(values, n, axis=0), axis=1) for n in (1, 2, 3))
    moving = first[2:] > 0.0
    if np.count_nonzero(moving) < TUNING.everywhere * len(moving):
        return False
    # Not what the rounding of numbers leaves of a ramp.
    changing = moving & (np.minimum(second[1:], second[:-1]) > TUNING.exact * np.abs(values).max())
    if np.count_nonzero(changing) < max(TUNING.least_samples, 0.5 * np.count_nonzero(moving)):
        return False
    return bool(np.median(third[changing]) > TUNING.rough * np.median(second[1:][changing]))


def _is_coarse(values: Array) -> bool:
    """Returns whether the values are rounded so coarsely that repeated values are normal."""
    step = _step(values)
    return step > 0.0 and not float(np.median(np.abs(np.diff(values, 3)))) > TUNING.fine * step


def _step(values: Array) -> float:
    """Returns the quantisation step of which all values are multiples; 0 if there is none."""
    levels = np.unique(values)
    step = float(np.diff(levels).min(initial=np.inf))
    if not TUNING.exact * float(np.abs(levels).max()) < step < np.inf:
        return 0.0
    ratios = (levels - levels[0]) / step
    return step if np.abs(ratios - np.round(ratios)).max() < TUNING.rounded else 0.0


def _frozen(t: Array, acceleration: Array) -> list[tuple[float, float]]:
    rough = _is_rough(acceleration)
    steps = np.linalg.norm(np.diff(acceleration, axis=0), axis=1)
    runs = [(start, end + 1) for start, end in _runs(steps == 0.0)]  # of equal samples
    moving = [
        (start, end)
        for start, end in runs
        if np.linalg.norm(acceleration[start]) > TUNING.fault_moving
        or _jump(steps, start, end) > TUNING.leap
    ]
    lengths = [end - start for start, end in moving]
    single = np.count_nonzero(steps > 0.0)
    # Of most inputs no value repeats.
    usual = float(np.median(lengths)) if len(lengths) > 0.1 * single else 1.0
    found = []
    for start, end in moving:
        long = end - start >= max(TUNING.freeze_samples, TUNING.held * usual)
        if not (long and t[end - 1] - t[start] >= TUNING.freeze and end < len(t) and start > 0):
            continue
        if rough:
            found.append((float(t[start]), float(t[end - 1])))
            continue
        after = steps[end : end + TUNING.beside]
        if np.count_nonzero(after) < len(after):  # a planned step, to what stays as it is again
            continue
        beside = np.concatenate([steps[max(start - TUNING.beside, 0) : start], after])
        if steps[start - 1] > 0.0 and _jump(steps, start, end) > TUNING.jump * float(beside.max()):
            found.append((float(t[start]), float(t[end - 1])))
    return found


def _jump(steps: Array, start: int, end: int) -> float:
    """Returns the change of the acceleration just after a run of repeated values [m/s²]."""
    return float(steps[end - 1]) if end - 1 < len(steps) else 0.0


def _mixed(
    t: Array,
    values: Array,
    apart: float = TUNING.apart,
    in_turn: int = TUNING.in_turn,
    at_least: int = TUNING.at_least,
) -> list[tuple[float, float]]:
    beside = values[2:] - values[:-2]
    off = values[1:-1] - values[:-2] - 0.5 * beside
    sizes = np.linalg.norm(off, axis=1)
    least = np.maximum(TUNING.sticks_out * np.linalg.norm(beside, axis=1), apart)
    rows = np.flatnonzero(sizes > least)
    if len(rows) < in_turn:
        return []
    size, between = sizes[rows], np.diff(rows)
    ratio = size[1:] / size[:-1]
    cosine = np.abs(np.sum(off[rows[1:]] * off[rows[:-1]], axis=1)) / (size[1:] * size[:-1])
    change = np.abs(np.diff(between, prepend=between[:1]))
    regular = change <= np.maximum(TUNING.regular * between, 1.0)
    turns = regular & (between <= TUNING.most_between)
    turns &= (ratio > TUNING.alike) & (ratio < 1.0 / TUNING.alike) & (cosine > TUNING.along)
    runs = [rows[start : end + 1] + 1 for start, end in _runs(turns) if end - start >= in_turn]
    if sum(map(len, runs)) < at_least:
        return []
    both, rest = np.sum([_unevenness(t, run) for run in runs], axis=0)
    if (
        both[0] < TUNING.uneven * both[1]
        or both[0] * rest[1] < TUNING.unevenness * rest[0] * both[1]
    ):
        return []
    return [(float(t[run[0]]), float(t[run[-1]])) for run in runs]


def _unevenness(t: Array, run: NDArray[np.int64]) -> tuple[tuple[float, float], ...]:
    """Returns jitter and mean of sample intervals [s], with and without suspected samples.

    Of all samples around a run of rows, and of those that are not of the run's publisher.
    """
    # Where both stick out from each other, every second one is of the other.
    dense = len(run) > 0.75 * (run[-1] - run[0])
    part = t[run[0] - 1 : run[-1] + 2]
    own = np.delete(part, (run[::2] if dense else run) - (run[0] - 1))
    spacings = np.diff(part), np.diff(own)
    return tuple((float(np.mean(np.abs(np.diff(one)))), float(np.mean(one))) for one in spacings)


def _missing(t: Array, acceleration: Array) -> list[tuple[float, float]]:
    spacing = np.diff(t)
    longest = max(TUNING.gap, TUNING.gap_samples * float(np.median(spacing)))
    sizes = np.linalg.norm(acceleration, axis=1)
    return [
        (float(t[row]), float(t[row + 1]))
        for row in np.flatnonzero(spacing > longest).tolist()
        if max(sizes[row], sizes[row + 1]) > TUNING.fault_moving
    ]


def _runs(marked: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Returns the start and end index (exclusive) of each run of marked samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
