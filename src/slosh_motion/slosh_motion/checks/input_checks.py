"""Checks gravity, units, frames and mounting of an input stream.

Every check also watches for what sensors and drivers do to samples; see `input_faults`.

The checks rest on what is physically possible. No motion changes the speed of a container by more
than TOP_SPEED. So a constant that is found where the input hardly changes, and whose integral
passes TOP_SPEED, is no acceleration: it is gravity, a unit, a tilt or a bias, and its size and
direction tell which (`constant_meaning`). A long honest acceleration passes: its integral stays
below TOP_SPEED, and braking takes it back.

Each check is a streaming object: the same samples give the same answers, one by one or in blocks,
and its memory is a list of numbers. What cannot be told: an acceleration without gravity in axes
that are turned, or in g. Only a camera, or a sensor that feels gravity, shows that.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array, Integers
from slosh_motion.checks.constancy import (
    BIN,
    BIN_NS,
    FINDER_MEMORY,
    REST,
    STRETCH_MEMORY,
    TOP_SPEED,
    Bin,
    Bins,
    ConstantFinder,
    Stretch,
    Vector,
)
from slosh_motion.checks.constant_meaning import (
    WRONG_POSE,
    Doubt,
    Matrix,
    acceleration_doubt,
    attitude_doubt,
)
from slosh_motion.checks.input_faults import FaultWatch

_Part = TypeVar("_Part", float, Array)
"""Of one quaternion, or of many."""

STANDING = 0.05
"""Below this a pose stands [m/s]: what a tracker's noise of 1 mm leaves."""
UP_TOLERANCE = 0.02
"""The same for the direction of up [rad]."""
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
NONE, CONSTANT, DEGREES, SPEED = range(4)
"""Kinds of causes of a doubt."""
_ZERO: Vector = (0.0, 0.0, 0.0)


class Cause(NamedTuple):
    """Suspected cause of an input fault, with the vector that shows it."""

    kind: int = NONE
    vector: Vector = _ZERO


class Check(ABC):
    """Base class of the input checks: time bins, suspected faults, saved state.

    Attributes:
        doubt: what is wrong now; None: nothing is known to be.
        doubtful: whether what follows from the input is wrong.
        raised: what was wrong at any time, the last of each kind.
        faults: of the samples: clipped, frozen, mixed, missing. They are no part of the memory:
            what is estimated does not depend on them.
    """

    WIDTH = 3
    MEMORY = 0
    """Numbers in the memory."""

    def __init__(self, rotation: Matrix, *, has_gravity: bool = False) -> None:
        self.faults = FaultWatch(has_gravity=has_gravity)
        self.doubt: Doubt | None = None
        self.doubtful = False
        self.raised: dict[int, Doubt] = {}
        self._rotation = rotation
        self._cause = Cause()
        self._bins = Bins(self.WIDTH)

    def memory(self, stamp_ns: int) -> list[float]:
        """Returns the check's state as numbers, after the sample with this stamp [ns]."""
        base = stamp_ns // BIN_NS
        cause = [float(self._cause.kind), *self._cause.vector]
        return [*cause, *self._bins.memory(base), *self._remembered(base)]

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Restores a state that `memory` returned, after the sample with this stamp [ns]."""
        base, bins = stamp_ns // BIN_NS, 6 + self.WIDTH
        kind, x, y, z = memory[:4]
        self._blame(Cause(round(kind), (x, y, z)))
        self._bins.take_up(memory[4:bins], base)
        self._remember(memory[bins:], base)

    def finish(self) -> None:
        """Processes the remaining samples at the end of the input."""
        self.faults.finish()
        closed = self._bins.close()
        if closed is not None:
            self._take(closed)

    def _restart(self) -> None:
        self._bins.close()

    def _blame(self, cause: Cause) -> None:
        if cause == self._cause:
            return
        self._cause = cause
        self.doubt = self._doubt_of(cause)
        self.doubtful = self.doubt is not None and self.doubt.wrong
        if self.doubt is not None:
            self.raised[2 * cause.kind + self.doubt.wrong] = self.doubt

    @abstractmethod
    def _doubt_of(self, cause: Cause) -> Doubt | None:
        """Returns the suspected fault for a cause, or None if it is no fault."""

    @abstractmethod
    def _take(self, closed: Bin) -> None:
        """Checks the mean input of a completed time bin."""

    @abstractmethod
    def _remembered(self, base: int) -> list[float]:
        """Returns a subclass's state as numbers; time bins are counted from `base`."""

    @abstractmethod
    def _remember(self, memory: Sequence[float], base: int) -> None:
        """Restores the state that `_remembered` of the subclass returned."""


class AccelCheck(Check):
    """Checks accelerations without gravity in axes whose z points up."""

    MEMORY = 4 + 5 + FINDER_MEMORY

    def __init__(self, rotation: Matrix = IDENTITY) -> None:
        super().__init__(rotation)
        self._finder = ConstantFinder()

    def add(self, stamp_ns: int, acceleration: Vector, *, restarted: bool = False) -> bool:
        """Adds an acceleration [m/s²] to the check; returns whether the input is doubtful."""
        if restarted:
            self._restart()
        self.faults.take(stamp_ns, acceleration)
        closed = self._bins.add(stamp_ns, acceleration)
        if closed is not None:
            self._take(closed)
        return self.doubtful

    def add_many(
        self, stamps: Integers, accelerations: Array, restarted: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Adds accelerations to the check; returns at which of them (N,) the input is doubtful.

        Args:
            stamps: (N,) [ns].
            accelerations: (N, 3) [m/s²].
            restarted: (N,) whether nothing links a sample to those before.
        """
        found = np.zeros(len(stamps), dtype=bool)
        if not len(stamps):
            return found
        self.faults.add(stamps, accelerations)
        edges = sorted({0, *np.flatnonzero(restarted).tolist(), len(stamps)})
        for start, end in pairwise(edges):
            if restarted[start]:
                self._restart()
            found[start:end] = self.doubtful
            rows = slice(start, end)
            for row, closed in self._bins.add_many(stamps[rows], accelerations[rows]):
                self._take(closed)
                found[start + row : end] = self.doubtful
        return found

    def _restart(self) -> None:
        super()._restart()
        self._finder.restart()

    def _take(self, closed: Bin) -> None:
        x, y, z = closed.mean
        constant = self._finder.take(closed.number, (x, y, z))
        if math.hypot(x, y, z) * BIN > TOP_SPEED:
            self._blame(Cause(SPEED, (x, y, z)))
        elif constant is not None:
            doubtful = acceleration_doubt(constant) is not None
            self._blame(Cause(CONSTANT, constant) if doubtful else Cause())

    def _doubt_of(self, cause: Cause) -> Doubt | None:
        if cause.kind == SPEED:
            return too_fast(math.hypot(*cause.vector))
        return acceleration_doubt(cause.vector) if cause.kind else None

    def _remembered(self, base: int) -> list[float]:
        return self._finder.memory(base)

    def _remember(self, memory: Sequence[float], base: int) -> None:
        self._finder.take_up(memory, base)


class PoseCheck(Check):
    """Checks poses of the container: unit, attitude at rest, order of the quaternion.

    Args:
        rotation: container ← tool that was used.
    """

    WIDTH = 7
    MEMORY = 4 + 9 + 6 + STRETCH_MEMORY

    def __init__(self, rotation: Matrix = IDENTITY) -> None:
        super().__init__(rotation)
        self._stretch = Stretch(UP_TOLERANCE, 5.0 * UP_TOLERANCE)
        self._was_upright = False
        self._place: Bin | None = None
        self._stood = 0.0

    def add(
        self,
        stamp_ns: int,
        position: Vector,
        quaternion: tuple[float, float, float, float],
        *,
        restarted: bool = False,
    ) -> bool:
        """Adds a pose of the container to the check; returns whether the input is doubtful."""
        if restarted:
            self._restart()
        x, y, z, w = quaternion
        # As if w, x, y, z had been given: its up is (…, 1 - 2 (y² + z²)).
        other = 1.0 - 2.0 * (y * y + z * z) / (x * x + y * y + z * z + w * w)
        closed = self._bins.add(stamp_ns, (*up_of(x, y, z, w), *position, other))
        if closed is not None:
            self._take(closed)
        return self.doubtful

    def add_many(self, stamps: Integers, position: Array, quaternion: Array) -> None:
        """Adds consecutive poses: stamps (N,) [ns], positions (N, 3) [m], quaternions (N, 4)."""
        x, y, z, w = quaternion.T
        # As in `add`.
        other = 1.0 - 2.0 / (x * x + y * y + z * z + w * w) * (y * y + z * z)
        values = np.column_stack((*up_of(x, y, z, w), position, other))
        for _, closed in self._bins.add_many(stamps, values):
            self._take(closed)

    def _restart(self) -> None:
        super()._restart()
        self._stretch.restart()
        self._place, self._stood = None, 0.0

    def _take(self, closed: Bin) -> None:
        x, y, z, *position, other = closed.mean
        before, self._place = self._place, Bin(closed.number, tuple(position))
        speed, seconds = 0.0, BIN
        if before is not None:
            seconds = BIN * (closed.number - before.number)
            speed = math.dist(before.mean, position) / seconds
        self._stood = self._stood + seconds if speed <= STANDING else 0.0
        if speed > 2.0 * TOP_SPEED:  # a jump of a tracker has half of its speed in two bins
            self._blame(Cause(SPEED, (speed, 0.0, 0.0)))
            return
        self._stretch.take(closed.number, (x, y, z))
        if self._stretch.seconds < REST or self._was_upright:
            return
        up = self._stretch.mean
        if attitude_doubt(up, self._rotation) is None:
            self._was_upright = True
            self._blame(Cause())
        elif self._stood >= REST and self._cause.kind != SPEED:
            scaled = 2.0 if other > math.cos(WRONG_POSE) else 1.0
            self._blame(Cause(CONSTANT, (scaled * up[0], scaled * up[1], scaled * up[2])))

    def _doubt_of(self, cause: Cause) -> Doubt | None:
        if cause.kind == SPEED:
            return Doubt(
                f"the pose moves at {cause.vector[0]:.3g} m/s: are its positions in mm? They must "
                "be m"
            )
        first = math.hypot(*cause.vector) > 1.5
        return attitude_doubt(cause.vector, self._rotation, first=first) if cause.kind else None

    def _remembered(self, base: int) -> list[float]:
        place = [math.nan] * 4
        if self._place is not None:
            place = [float(self._place.number - base), *self._place.mean]
        return [float(self._was_upright), self._stood, *place, *self._stretch.memory(base)]

    def _remember(self, memory: Sequence[float], base: int) -> None:
        upright, self._stood, number, x, y, z, *stretch = memory
        self._was_upright = bool(upright)
        self._place = None if math.isnan(number) else Bin(round(number) + base, (x, y, z))
        self._stretch.take_up(stretch, base)


def too_fast(size: float) -> Doubt:
    """Returns the suspected fault for an acceleration [m/s²] that no robot arm can reach."""
    return Doubt(
        f"an acceleration of {size:.4g} m/s² for {BIN:g} s changes the speed by "
        f"{size * BIN:.3g} m/s, and no arm moves faster than {TOP_SPEED:g} m/s: is it in mm/s²? "
        "It must be m/s²"
    )


def up_of(x: _Part, y: _Part, z: _Part, w: _Part) -> tuple[_Part, _Part, _Part]:
    """Returns the world's z axis in container axes, for quaternions world ← container."""
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    return scale * (x * z - w * y), scale * (y * z + w * x), 1.0 - scale * (x * x + y * y)
