"""Compares replayed messages with recorded ones, bit by bit."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_base.types import Integers
from slosh_estimator.comparison import Comparison
from slosh_estimator.estimator import Estimates
from slosh_estimator.tray_estimator import TrayEstimates

Columns = Mapping[str, NDArray[Any]]

ORDER_UNKNOWN = "recorded before journals: order unknown"
"""Why messages may differ where no journal tells in which order a node took its inputs."""
COMPARED = ("measured", "estimated_linear", "estimated_nonlinear")
"""Heights of a comparison; MAE and ε depend on when the live monitor had started."""
STALE = "measured_stale"
_HEIGHTS = ("msh", "azimuth", "sh_x", "sh_y")
_MODAL = ("modal_position", "modal_position", "modal_velocity", "modal_velocity")
_HIGHER_MODE = re.compile(r"modal_\w+\[([2-9]|\d\d)")


@dataclass(frozen=True, slots=True)
class Difference:
    """A number that differs between a recorded and a replayed message.

    Attributes:
        stamp_ns: of the message [ns].
        field: of the message, e.g. 'nonlinear.msh'.
        recorded, replayed: the numbers, in the field's unit.
    """

    stamp_ns: int
    field: str
    recorded: float
    replayed: float

    @property
    def units_in_the_last_place(self) -> int:
        """Number of double-precision values between the two numbers."""
        return abs(_ordinal(self.recorded) - _ordinal(self.replayed))

    def __str__(self) -> str:
        return (
            f"{self.field} at {self.stamp_ns * 1e-9:.6f} s: recorded {self.recorded!r}, replayed "
            f"{self.replayed!r}, {self.replayed - self.recorded:+.3g} "
            f"({self.units_in_the_last_place} units in the last place)"
        )


@dataclass(frozen=True, slots=True)
class Verification:
    """Result of comparing replayed messages with recorded ones.

    Attributes:
        topic: of the recorded messages.
        recorded: recorded messages that were compared.
        identical: those whose every number is the same bits.
        missing: recorded messages for which the replay has none.
        extra: replayed messages between the first and the last recorded one that were not
            recorded.
        first: the first difference; None: there is none.
        largest: largest absolute difference by field, of the fields that differ.
        counts: messages by field, of the fields that differ.
        unchecked: recorded messages that were not compared, by why they could not be.
        causes: what is known to differ: model, code, arithmetic.
        rounds_otherwise: this machine's elementary functions round otherwise than those of the
            recording one.
    """

    topic: str
    recorded: int
    identical: int
    missing: int
    extra: int
    first: Difference | None
    largest: Mapping[str, float]
    counts: Mapping[str, int]
    unchecked: Mapping[str, int] = field(default_factory=dict)
    causes: tuple[str, ...] = ()
    rounds_otherwise: bool = False

    @property
    def total(self) -> int:
        """Number of recorded messages that were looked for in the replay."""
        return self.recorded + self.missing

    @property
    def exact(self) -> bool:
        """Whether every compared message was reproduced exactly."""
        return self.recorded > 0 and self.identical == self.recorded and not self.missing

    def within(self, tolerance: float) -> bool:
        """Returns whether every message was reproduced within a tolerance [SI units]."""
        return not self.missing and all(value <= tolerance for value in self.largest.values())

    @property
    def unchecked_lines(self) -> tuple[str, ...]:
        """Says how many messages were not compared, and why."""
        return tuple(
            f"{self.topic}: {count} not checked: {why}" for why, count in self.unchecked.items()
        )

    def lines(self) -> tuple[str, ...]:
        """Returns the result of the comparison as lines of text."""
        total, unchecked = self.total, self.unchecked_lines
        if not total:
            return unchecked
        if self.exact:
            return (f"{self.topic}: {self.identical} of {total} messages bit for bit", *unchecked)
        lines = [
            f"{self.topic}: {self.identical} of {total} messages bit for bit, "
            f"{self.recorded - self.identical} differ, {self.missing} missing",
            *unchecked,
        ]
        if self.missing:
            lines.append(f"{self.topic}: for the missing ones the recording has no usable input")
        if self.first is not None:
            lines.append(f"{self.topic}: first difference: {self.first}")
        if self.largest:
            name, value = max(self.largest.items(), key=lambda item: item[1])
            lines.append(f"{self.topic}: largest difference: {name} by {value:.3g}")
        return (*lines, *(f"{self.topic}: {cause}" for cause in self.causes))


class Tally:
    """Counts how recorded and replayed messages of one topic compare.

    Args:
        topic: of the recorded messages.
    """

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._counts = {"recorded": 0, "identical": 0, "missing": 0, "extra": 0}
        self._first: Difference | None = None
        self._largest: dict[str, float] = {}
        self._differing: dict[str, int] = {}
        self._unchecked: dict[str, int] = {}

    def count(self, **more: int) -> None:
        """Adds to the counts of `Verification` by their names."""
        for name, number in more.items():
            self._counts[name] += number

    def leave_out(self, count: int, why: str) -> None:
        """Counts recorded messages that are not compared."""
        if count:
            self._unchecked[why] = self._unchecked.get(why, 0) + count

    def pairs(self, recorded: Messages, replayed: Messages) -> None:
        """Compares N recorded messages with the N replayed ones, field by field."""
        self._counts["recorded"] += len(recorded.stamps)
        same = np.ones(len(recorded.stamps), dtype=bool)
        first: tuple[int, str, float, float] | None = None
        for name, column in replayed.columns.items():
            known = _column(self.topic, recorded.columns, name)
            differing = ~same_bits(known, column)
            if _HIGHER_MODE.search(name):
                # A model with fewer modes was recorded: there is nothing to compare with.
                differing &= ~np.isnan(known)
            differs = np.flatnonzero(differing)
            if not len(differs):
                continue
            same[differs] = False
            self._note_largest(name, known[differs], column[differs])
            row = int(differs[0])
            if first is None or row < first[0]:
                first = (row, name, _number(known[row]), _number(column[row]))
        self._counts["identical"] += int(np.count_nonzero(same))
        if self._first is None and first is not None:
            self._first = Difference(int(recorded.stamps[first[0]]), *first[1:])

    def _note_largest(self, name: str, known: NDArray[Any], column: NDArray[Any]) -> None:
        self._differing[name] = self._differing.get(name, 0) + len(known)
        largest = math.inf
        if np.issubdtype(known.dtype, np.number) and np.issubdtype(column.dtype, np.number):
            with np.errstate(invalid="ignore"):
                gap = np.abs(column.astype(float) - known.astype(float))
            largest = float(np.max(np.where(np.isnan(gap), math.inf, gap)))
        self._largest[name] = max(self._largest.get(name, 0.0), largest)

    def result(self, causes: Sequence[str] = (), rounds_otherwise: bool = False) -> Verification:
        """Returns the result of comparing recorded and replayed messages so far.

        Args:
            causes, rounds_otherwise: see Verification.
        """
        return Verification(
            self.topic, first=self._first, largest=dict(self._largest),
            counts=dict(self._differing), unchecked=dict(self._unchecked), causes=tuple(causes),
            rounds_otherwise=rounds_otherwise, **self._counts,
        )  # fmt: skip


class Verifier:
    """Compares recorded with replayed messages of equal stamps, as they arrive.

    Args:
        topic: of the recorded messages.

    Attributes:
        tally: counts how they compare.
    """

    def __init__(self, topic: str) -> None:
        self.tally = Tally(topic)
        self._recorded: list[Messages] = []
        self._replayed: list[Messages] = []
        self._unknown: list[_Unknown] = []
        self._unmatched = np.empty(0, dtype=np.int64)  # behind the last recorded one
        self._first_ns: int | None = None  # of the first recorded one

    def add_recorded(self, stamps: Integers, columns: Columns) -> None:
        """Adds recorded messages: stamps (N,) [ns], and fields (N,) by dotted name."""
        if len(stamps):
            self._recorded.append(Messages(stamps, columns))

    def add_replayed(self, stamps: Integers, columns: Columns) -> None:
        """Adds replayed messages; fields that they lack are not compared."""
        if len(stamps):
            self._replayed.append(Messages(stamps, columns))

    def lose(self, after_ns: int, why: str) -> None:
        """Suspends the comparison after a stamp [ns], until `find` resumes it."""
        self._unknown.append(_Unknown(after_ns, 2**62, why))

    def find(self, until_ns: int) -> None:
        """Resumes the comparison for messages after a stamp [ns]."""
        if self._unknown:
            self._unknown[-1] = self._unknown[-1]._replace(until_ns=until_ns)

    def compare(self, settled: int = -(2**62), *, final: bool = False) -> None:
        """Compares the messages that are available both recorded and replayed.

        Args:
            settled: what has no counterpart up to this stamp never will have one [ns].
            final: nothing follows.
        """
        ends = [
            int(batches[-1].stamps[-1]) for batches in (self._recorded, self._replayed) if batches
        ]
        if not ends:
            return
        common = min(ends) if len(ends) == 2 else settled
        until = max(ends) if final else max(common, settled)
        recorded, self._recorded = split(self._recorded, until)
        replayed, self._replayed = split(self._replayed, until)
        recorded, replayed = self._known(recorded, count=True), self._known(replayed)
        self._unknown = [span for span in self._unknown if span.until_ns > until]
        _, left, right = np.intersect1d(recorded.stamps, replayed.stamps, return_indices=True)
        self.tally.count(missing=len(recorded.stamps) - len(left))
        self._count_extra(recorded.stamps, np.delete(replayed.stamps, right))
        if len(left):
            self.tally.pairs(recorded.rows(left), replayed.rows(right))

    def _count_extra(self, recorded: Integers, unmatched: Integers) -> None:
        """Counts replayed messages between the first and the last recorded one."""
        self._unmatched = np.concatenate((self._unmatched, unmatched))
        if len(recorded):
            inside = self._unmatched <= recorded[-1]
            first = recorded[0] if self._first_ns is None else self._first_ns
            self._first_ns = int(first)
            self.tally.count(extra=int(np.count_nonzero(self._unmatched[inside] > first)))
            self._unmatched = self._unmatched[~inside]

    def result(self, causes: Sequence[str] = (), rounds_otherwise: bool = False) -> Verification:
        """Returns the result of comparing recorded and replayed messages so far.

        Args:
            causes, rounds_otherwise: see Verification.
        """
        return self.tally.result(causes, rounds_otherwise)

    def _known(self, batch: Messages, *, count: bool = False) -> Messages:
        """Returns the messages that can be compared; optionally counts those that cannot."""
        for span in self._unknown:
            inside = (batch.stamps > span.after_ns) & (batch.stamps <= span.until_ns)
            found = int(np.count_nonzero(inside))
            if found and count:
                self.tally.leave_out(found, span.why)
            batch = batch.rows(~inside) if found else batch
        return batch


class _Unknown(NamedTuple):
    """A range of stamps [ns] in which messages are not compared."""

    after_ns: int
    until_ns: int
    why: str


class Messages(NamedTuple):
    """Consecutive messages: stamps (N,) [ns], and fields (N,) by dotted name."""

    stamps: Integers
    columns: Columns

    def rows(self, chosen: NDArray[Any] | slice) -> Messages:
        """Returns the messages selected by indices, a mask or a slice."""
        return Messages(self.stamps[chosen], {n: c[chosen] for n, c in self.columns.items()})


def split(batches: Sequence[Messages], until: int) -> tuple[Messages, list[Messages]]:
    """Splits batches at a stamp [ns]: one batch up to the stamp and one after it."""
    due = [batch.rows(batch.stamps <= until) for batch in batches if batch.stamps[0] <= until]
    rest = [batch.rows(batch.stamps > until) for batch in batches if batch.stamps[-1] > until]
    return joined_messages(due), [batch for batch in rest if len(batch.stamps)]


def joined_messages(batches: Sequence[Messages]) -> Messages:
    """Concatenates batches, with the fields that all of them have."""
    if len(batches) == 1:
        return batches[0]
    if not batches:
        return Messages(np.empty(0, dtype=np.int64), {})
    shared = set.intersection(*(set(batch.columns) for batch in batches))
    columns = {
        name: np.concatenate([batch.columns[name] for batch in batches])
        for name in batches[0].columns
        if name in shared
    }
    return Messages(np.concatenate([batch.stamps for batch in batches]), columns)


def estimate_columns(estimates: Estimates) -> Columns:
    """Returns the numbers of estimates by dotted field name of SloshEstimate.msg, (N,) each."""
    columns: dict[str, NDArray[Any]] = {}
    for model, name in enumerate(("linear", "nonlinear")):
        for index, height in enumerate(_HEIGHTS):
            columns[f"{name}.{height}"] = estimates.heights[:, model, index]
        for mode in range(estimates.modal.shape[2]):
            for index, kind in enumerate(_MODAL):
                key = f"{name}.{kind}[{2 * mode + index % 2}]"
                columns[key] = estimates.modal[:, model, mode, index]
    for axis in range(3):
        columns[f"acceleration[{axis}]"] = estimates.accelerations[:, axis]
    return {**columns, "jerk": estimates.jerk, "yaw": estimates.yaws, "flags": estimates.flags}


def estimate_fields(modes: int) -> tuple[str, ...]:
    """Returns the column names of estimates for a model with a number of modes."""
    none, whole = np.empty(0), np.empty(0, dtype=np.int64)
    empty = Estimates(
        whole, none.reshape(0, 2, 4), none.reshape(0, 2, modes, 4), none, whole,
        none.reshape(0, 3), none,
    )  # fmt: skip
    return tuple(estimate_columns(empty))


def tray_columns(tray: TrayEstimates) -> Columns:
    """Returns the numbers of tray estimates by dotted field name, (N,) each."""
    columns: dict[str, NDArray[Any]] = {"worst": tray.worst}
    for name in ("msh", "azimuth", "flags"):
        for index, column in enumerate(getattr(tray, name).T):
            columns[f"{name}[{index}]"] = column
    return columns


def tray_fields(count: int) -> tuple[str, ...]:
    """Returns the column names of tray estimates for a number of containers."""
    none, whole = np.empty((0, count)), np.empty((0, count), dtype=np.int64)
    worst, readings = np.empty(0, dtype=np.int64), np.empty((0, count, 2))
    return tuple(tray_columns(TrayEstimates(none, none, whole, worst, none, readings, whole)))


def comparison_columns(comparisons: Sequence[Comparison]) -> Messages:
    """Returns stamps and heights of SloshComparison messages with a camera measurement."""
    rows = [row for row in comparisons if not row.measured_stale]
    stamps = np.fromiter((row.stamp_ns for row in rows), np.int64, len(rows))
    columns = {
        name: np.fromiter((getattr(row, name) for row in rows), np.float64, len(rows))
        for name in COMPARED
    }
    return Messages(stamps, columns)


def _column(topic: str, columns: Columns, field: str) -> NDArray[Any]:
    try:
        return columns[field]
    except KeyError:
        raise SloshBagError(
            f"{topic}: its messages have no field {field}; they were recorded with another number "
            "of modes or another version of slosh_msgs"
        ) from None


def same_bits(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    """Returns which of N values, or rows of values, are the same bits in two columns.

    What is masked in both is the same.
    """
    if a.shape != b.shape:
        return np.zeros(len(a), dtype=bool)
    same = _same_elements(np.ma.getdata(a), np.ma.getdata(b))
    if np.ma.isMaskedArray(a) or np.ma.isMaskedArray(b):
        hidden, other = np.ma.getmaskarray(a), np.ma.getmaskarray(b)
        same = np.asarray((hidden & other) | (same & (hidden == other)))
    return same if same.ndim == 1 else np.asarray(same.reshape(len(a), -1).all(axis=1))


def _same_elements(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    if a.dtype.kind == "f" and a.dtype == b.dtype:
        a, b = (np.ascontiguousarray(one).view(f"i{one.itemsize}") for one in (a, b))
    return np.asarray(a == b)


def _number(value: Any) -> float:
    """Returns a value as a number; NaN for text and for rows of values."""
    return float(value) if np.ndim(value) == 0 and not isinstance(value, str) else math.nan


def _ordinal(value: float) -> int:
    """Returns the position of a double in the order of all double-precision values."""
    bits = int(np.float64(value).view(np.int64))
    return bits if bits >= 0 else -(bits & 0x7FFFFFFFFFFFFFFF)
