"""Reads the container's motion from the input messages of a bag."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from slosh_bag.errors import SloshBagError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array, Integers
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.inputs.frames import matrix_from_rpy
from slosh_motion.inputs.inputs import WINDOWED, InputSettings
from slosh_motion.inputs.sampling import Samples
from slosh_motion.recorded.inputs import STAMP, InputReader, fields, stamps_of

LASTING = 20
"""So many stamps in order before the newest one are no strays: time itself was set back."""


class StrayFilter:
    """Excludes single messages whose stamps are far ahead of their neighbours.

    Args:
        gap: so far ahead of the one before [ns].
    """

    def __init__(self, gap: int) -> None:
        self.count = 0
        self._gap = gap
        self._before: int | None = None
        self._held: tuple[Integers, Columns] | None = None

    def add(self, stamps: Integers, columns: Columns) -> tuple[Integers, Columns]:
        """Adds consecutive messages; returns those that are known to be in sequence.

        One that may be astray waits for the next one, which tells.

        Args:
            stamps: (N,) [ns].
            columns: their fields, (N,) each.
        """
        if self._held is not None:
            stamps = np.concatenate((self._held[0], stamps))
            columns = {
                name: np.concatenate((self._held[1][name], c)) for name, c in columns.items()
            }
        kept = ~strays_ahead(stamps, self._gap, self._before)
        self.count += len(kept) - int(np.count_nonzero(kept))
        stamps, columns = stamps[kept], {name: c[kept] for name, c in columns.items()}
        decided = len(stamps) - self._is_open(stamps)
        self._held = None
        if decided < len(stamps):
            self._held = (stamps[decided:], {name: c[decided:] for name, c in columns.items()})
        if decided:
            self._before = int(stamps[decided - 1])
        return stamps[:decided], {name: c[:decided] for name, c in columns.items()}

    def _is_open(self, stamps: Integers) -> bool:
        """Returns whether the last stamp can only be judged with its successor."""
        before = stamps[-2] if len(stamps) > 1 else self._before
        return bool(len(stamps) and before is not None and stamps[-1] - before > self._gap)

    def rest(self) -> tuple[Integers, Columns]:
        """Returns the last message if its stamp could not be judged before; else no message."""
        held, self._held = self._held, None
        return held if held is not None else (np.empty(0, dtype=np.int64), {})


def strays_ahead(stamps: Integers, gap: int, before: int | None = None) -> NDArray[np.bool_]:
    """Returns a mask of stamps far ahead of both neighbours, between which there is no gap.

    Args:
        stamps: (N,) in the order in which they came [ns].
        gap: so far ahead of the one before them [ns].
        before: the stamp before the first; None: there is none.

    Returns:
        (N,); the last one is none, as what follows it is not known.
    """
    found = np.zeros(len(stamps), dtype=bool)
    around = stamps if before is None else np.concatenate(([before], stamps))
    left, own, right = around[:-2], around[1:-1], around[2:]
    shift = 1 if before is None else 0
    goes_on = (left < right) & (right - left <= gap)
    found[shift : shift + len(own)] = goes_on & (own > right) & (own - left > gap)
    return found


def set_backs(stamps: Iterable[int]) -> list[int]:
    """Returns the indices of stamps at which time was set back permanently.

    Args:
        stamps: in the order in which they came [ns].
    """
    found: list[int] = []
    newest: int | None = None
    early: int | None = None
    begin = count = 0
    for index, stamp in enumerate(stamps):
        if newest is None or stamp > newest:
            newest, early = stamp, None
            continue
        if early is None or stamp <= early:
            begin, count = index, 0
        early, count = stamp, count + 1
        if count >= LASTING:
            found.append(begin)
            newest, early = stamp, None
    return found


Stamps = NDArray[np.int64]
Columns = Mapping[str, NDArray[Any]]

FRAME: Final = "header.frame_id"
NOT_REPORTED: Final = -1.0
"""First entry of a covariance of what an Imu message does not tell."""
ORIENTATION: Final = tuple(f"orientation.{axis}" for axis in "xyzw")
TURNING: Final = tuple(f"angular_velocity.{axis}" for axis in "xyz")
_ORIENTATION_KNOWN, _TURNING_KNOWN = (
    f"{name}_covariance[0]" for name in ("orientation", "angular_velocity")
)


@dataclass(frozen=True, slots=True)
class RecordedMotion:
    """Recorded motion of the container, at the stamps of its samples.

    Attributes:
        stamps: (N,) [ns], strictly increasing.
        acceleration: (N, 3) in the world's axes, gravity excluded [m/s²].
        attitude: (N, 4) quaternion x, y, z, w, world ← container; None: not known.
        angular_velocity: (N, 3) in the container's frame [rad/s]; None: not known.
    """

    stamps: Stamps
    acceleration: Array
    attitude: Array | None = None
    angular_velocity: Array | None = None


class MotionCollector:
    """Collects the messages of one input topic, to compute the motion.

    Attributes:
        in_world: whether all accelerations so far were in the world's frame.
    """

    def __init__(self, kind: str, settings: InputSettings) -> None:
        self.fields = fields(kind)
        self.in_world = True
        self._kind = kind
        self._settings = settings
        self._reader = InputReader(kind, settings)
        self._filter = StrayFilter(self._reader.max_gap_ns)
        self._samples: list[Samples] = []
        self._stamps: list[Stamps] = []
        self._turns: list[Array] = []

    def add(self, columns: Columns) -> None:
        """Adds consecutive messages of the input topic."""
        self._take(*self._filter.add(stamps_of(columns), columns))

    def _take(self, stamps: Stamps, columns: Columns) -> None:
        if not len(stamps):
            return
        self._samples.append(self._reader.samples(stamps, columns, np.arange(len(stamps))))
        if self._kind == "accel":
            self.in_world &= bool((columns[FRAME] == self._settings.frames[0]).all())
            return
        if self._kind == "imu":
            self._stamps.append(stamps)
            self._turns.append(_reported(columns, TURNING, _TURNING_KNOWN))

    def motion(self, path: Path, topic: str, clocks: Sequence[InputDoubt] = ()) -> RecordedMotion:
        """Returns the container's motion from all added messages.

        Args:
            clocks: what its stamps show, in case that nothing is usable.

        Raises:
            SloshBagError: nothing usable, or the stamps go back.
        """
        self._take(*self._filter.rest())
        stamps = np.concatenate([_NO_STAMPS, *(part.stamps for part in self._samples)])
        if not len(stamps):
            why = next(iter((*clocks, *self._reader.warnings())), "")
            raise SloshBagError(
                f"{path}: holds no usable message of {topic}{self._reader.refusal}"
                f"{f'; {why}' if why else ''}"
            )
        self._reader.finish()
        late = np.flatnonzero(np.diff(stamps) <= 0)
        if len(late):
            raise SloshBagError(
                f"{path}: the stamps of {topic} go back at {stamps[late[0]] / SECOND:.3f} s; "
                f"split the bag there with `slosh recover --split {path} -o NEW`"
            )
        motion = RecordedMotion(
            stamps, np.concatenate([part.accelerations for part in self._samples])
        )
        if self._kind == "accel":
            return motion
        if self._kind in WINDOWED:
            poses = np.concatenate([p.poses for p in self._samples if p.poses is not None])
            return replace(motion, attitude=poses[:, :4], angular_velocity=poses[:, 4:7])
        turns = at_stamps(stamps, np.concatenate(self._stamps), np.concatenate(self._turns))
        if turns is None:
            return motion
        return replace(motion, attitude=self._yawed(), angular_velocity=self._in_container(turns))

    @property
    def doubts(self) -> tuple[InputDoubt, ...]:
        """Suspected faults of the input, one sentence each."""
        return self._reader.doubts

    def notes(self) -> list[str]:
        """Remarks on data that a table cannot contain, one line each."""
        counters = self._reader.counters
        notes: list[str] = [*self.doubts, *self._reader.faults]
        if self._filter.count:
            notes.append(
                f"{self._filter.count} samples of {self._kind} with out-of-sequence stamps "
                "left out"
            )
        if counters["samples_dropped"]:
            notes.append(
                f"{counters['samples_dropped']} samples of {self._kind} left out, as the "
                "estimator does: repeated, out of order, not finite or in another frame"
            )
        if counters["gaps"]:
            notes.append(
                f"{counters['gaps']} gaps in {self._kind}: a simulation of the table "
                "integrates across them, the estimator restarts after them"
            )
        return notes

    def _yawed(self) -> Array:
        """Returns attitudes from yaw only, since the forces already include tilt."""
        half = 0.5 * np.concatenate([part.yaws for part in self._samples])
        zero = np.zeros_like(half)
        return np.column_stack([zero, zero, np.sin(half), np.cos(half)])

    def _in_container(self, turns: Array) -> Array:
        mount = self._settings.transform
        turned: Array = turns @ np.array(matrix_from_rpy(mount.roll, mount.pitch, mount.yaw)).T
        return turned


class AttitudeCollector:
    """Collects the attitude from an IMU in the container frame, in addition to accelerations."""

    fields = (*STAMP, FRAME, *ORIENTATION, *TURNING, _ORIENTATION_KNOWN, _TURNING_KNOWN)

    def __init__(self, frame: str) -> None:
        self._frame = frame
        self._stamps: list[Stamps] = []
        self._attitudes: list[Array] = []
        self._turnings: list[Array] = []

    def add(self, columns: Columns) -> None:
        """Adds consecutive Imu messages, from which the attitude is taken."""
        here = columns[FRAME] == self._frame
        self._stamps.append(stamps_of(columns)[here])
        self._attitudes.append(_reported(columns, ORIENTATION, _ORIENTATION_KNOWN)[here])
        self._turnings.append(_reported(columns, TURNING, _TURNING_KNOWN)[here])

    def added_to(self, motion: RecordedMotion) -> RecordedMotion:
        """Returns the motion with attitude and angular velocity, if every sample has them."""
        if not self._stamps:
            return motion
        stamps = np.concatenate(self._stamps)
        attitude, turning = (
            at_stamps(motion.stamps, stamps, np.concatenate(parts))
            for parts in (self._attitudes, self._turnings)
        )
        return replace(motion, attitude=attitude, angular_velocity=turning)


_NO_STAMPS = np.empty(0, dtype=np.int64)


def at_stamps(wanted: Stamps, stamps: Stamps, values: Array) -> Array | None:
    """Returns the first row of values at each stamp; None if there is no row at one of them.

    Args:
        stamps: (M,) of the values, in any order.
        values: (M, K), NaN where not known.

    Returns:
        None where a wanted one is not there, or its value is not known.
    """
    if not len(stamps):
        return None
    order = np.argsort(stamps, kind="stable")
    place = np.searchsorted(stamps, wanted, sorter=order)
    rows = order[np.minimum(place, len(order) - 1)]
    if (stamps[rows] != wanted).any():
        return None
    found: Array = values[rows]
    return found if np.isfinite(found).all() else None


def _stacked(columns: Columns, names: tuple[str, ...]) -> Array:
    return np.column_stack([columns[name] for name in names])


def _reported(columns: Columns, names: tuple[str, ...], known: str) -> Array:
    """Returns values with NaN where the Imu message says 'not reported'."""
    return np.where(
        (columns[known] == NOT_REPORTED)[:, np.newaxis], np.nan, _stacked(columns, names)
    )
