"""Checks what an input claims to be: gravity, units, frames and mountings, as samples come.

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
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_model.constants import GRAVITY
from slosh_report.constancy import (
    BIN,
    BIN_NS,
    MOST,
    STRETCH_MEMORY,
    TOLERANCE,
    TOP_SPEED,
    Bin,
    Bins,
    Stretch,
    Vector,
)
from slosh_report.constant_meaning import (
    FINE,
    WRONG_POSE,
    Doubt,
    Matrix,
    acceleration_doubt,
    angle,
    attitude_doubt,
    force_doubt,
)

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

REST = 0.4
"""So long an input hardly changes before it counts as constant [s]."""
STANDING = 0.05
"""Below this a pose stands [m/s]: what a tracker's noise of 1 mm leaves."""
UP_TOLERANCE = 0.02
"""The same for the direction of up [rad]."""
FORGETTING = 30.0
"""Time constant with which the integral forgets [s]: a bias below 0.16 m/s² never passes."""
DEPARTURE = 0.25
"""What lies so far from a constant is a motion [m/s²]."""
FOLLOWED = math.radians(5.0)
"""So far the turned gravity and the measured one may lie apart at rest."""
SOMERSAULT, FELT = 2.1, 1.0
"""Where the rates turn gravity by 120°, and it lies within 60° of +z, they are no rad/s [rad]."""
LEANING, TRUSTING = 20.0, 60.0
"""Time constants with which turned gravity follows the measured one [s]: a gyroscope has a bias.
The longer one is of gravity as it is where the container stood upright at the beginning."""
IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_NONE, _CONSTANT, _DEGREES, _SPEED = range(4)
_ZERO: Vector = (0.0, 0.0, 0.0)
_UP: Vector = (0.0, 0.0, 1.0)


class ConstantFinder:
    """Finds what stays in an acceleration while the container rests."""

    def __init__(self) -> None:
        self.stretch = Stretch(TOLERANCE, MOST)
        self.restart()

    def restart(self) -> None:
        """Nothing links what follows to what came."""
        self.stretch.restart()
        self._earlier: Vector | None = None
        self._departed = False
        self.bias: Vector = _ZERO
        self._speed, self._time, self._last = _ZERO, 0.0, -(2**62)

    def take(self, number: int, mean: Vector, felt: Vector | None = None) -> Vector | None:
        """Takes a bin; returns the constant of a rest, None where nobody knows.

        Args:
            number: of the bin.
            mean: of the input [m/s²].
            felt: what moves the container, as far as it is known; None: the input [m/s²].
        """
        felt = felt or mean
        steps = number - self._last if self._time else 1
        self._last = number
        seconds = BIN * steps
        kept = math.exp(-seconds / FORGETTING)
        speed, bias = self._speed, self.bias
        self._speed = (
            kept * speed[0] + seconds * (felt[0] - bias[0]),
            kept * speed[1] + seconds * (felt[1] - bias[1]),
            kept * speed[2] + seconds * (felt[2] - bias[2]),
        )
        self._time = kept * self._time + seconds
        before, lasted = self.stretch.mean, self.stretch.seconds
        if not self.stretch.take(number, mean) and lasted >= REST and math.hypot(*before) > FINE:
            self._earlier, self._departed = before, False
        if self._earlier is not None:
            self._departed |= math.dist(mean, self._earlier) > DEPARTURE
        if self.stretch.seconds < REST:
            return None
        constant = self.stretch.mean
        if math.hypot(*constant) <= FINE:
            self._earlier, self._departed, self.bias = None, False, constant
            return constant
        return constant if self._is_no_acceleration(constant) else None

    def _is_no_acceleration(self, constant: Vector) -> bool:
        """Whether the integral shows that a constant cannot be the container's."""
        left = math.dist(constant, self.bias)
        if left * self.stretch.seconds > TOP_SPEED:
            return True
        reached = math.hypot(*self._speed)
        whole = tuple(self._time * (constant[i] - self.bias[i]) for i in range(3))
        rest = math.dist(self._speed, whole)
        if reached > TOP_SPEED and rest <= TOP_SPEED:
            return True
        again = self._departed and self._earlier is not None
        if not again or math.dist(constant, self._earlier or constant) > 0.1 + 0.02 * reached:
            return False
        return reached >= 0.5 * TOP_SPEED and rest <= 0.25 * left * self._time

    def memory(self, base: int) -> list[float]:
        """What the next bins depend on; numbers of bins count from `base`."""
        last = float(self._last - base) if self._time else math.nan
        earlier = self._earlier or (math.nan,) * 3
        own = [*self._speed, self._time, last, *earlier, float(self._departed), *self.bias]
        return [*own, *self.stretch.memory(base)]

    def take_up(self, memory: Sequence[float], base: int) -> None:
        """Takes up a `memory`."""
        vx, vy, vz, self._time, last, ex, ey, ez, departed, bx, by, bz, *stretch = memory
        self.bias = bx, by, bz
        self._speed = vx, vy, vz
        self._last = -(2**62) if math.isnan(last) else round(last) + base
        self._earlier = None if math.isnan(ex) else (ex, ey, ez)
        self._departed = bool(departed)
        self.stretch.take_up(stretch, base)


_FINDER_MEMORY = 12 + STRETCH_MEMORY


class _Cause(NamedTuple):
    """Why an input is doubted, and the vector that shows it."""

    kind: int = _NONE
    vector: Vector = _ZERO


class _Check:
    """What all checks share: the bins, the doubt, the memory.

    Attributes:
        doubt: what is wrong now; None: nothing is known to be.
        doubtful: whether what follows from the input is wrong.
        raised: what was wrong at any time, the last of each kind.
    """

    WIDTH = 3
    MEMORY = 0
    """Numbers in the memory."""

    def __init__(self, rotation: Matrix) -> None:
        self.doubt: Doubt | None = None
        self.doubtful = False
        self.raised: dict[int, Doubt] = {}
        self._rotation = rotation
        self._cause = _Cause()
        self._bins = Bins(self.WIDTH)

    def memory(self, stamp_ns: int) -> list[float]:
        """What the next samples depend on, behind the sample of this stamp [ns]."""
        base = stamp_ns // BIN_NS
        cause = [float(self._cause.kind), *self._cause.vector]
        return [*cause, *self._bins.memory(base), *self._remembered(base)]

    def take_up(self, stamp_ns: int, memory: Sequence[float]) -> None:
        """Goes on behind the sample of this stamp [ns], with MEMORY numbers of another check."""
        base, bins = stamp_ns // BIN_NS, 6 + self.WIDTH
        kind, x, y, z = memory[:4]
        self._blame(_Cause(round(kind), (x, y, z)))
        self._bins.take_up(memory[4:bins], base)
        self._remember(memory[bins:], base)

    def finish(self) -> None:
        """Takes what is left; no samples follow."""
        closed = self._bins.close()
        if closed is not None:
            self._take(closed)

    def _restart(self) -> None:
        self._bins.close()

    def _blame(self, cause: _Cause) -> None:
        if cause == self._cause:
            return
        self._cause = cause
        self.doubt = self._doubt_of(cause)
        self.doubtful = self.doubt is not None and self.doubt.wrong
        if self.doubt is not None:
            self.raised[2 * cause.kind + self.doubt.wrong] = self.doubt

    def _doubt_of(self, cause: _Cause) -> Doubt | None:
        raise NotImplementedError

    def _take(self, closed: Bin) -> None:
        raise NotImplementedError

    def _remembered(self, base: int) -> list[float]:
        raise NotImplementedError

    def _remember(self, memory: Sequence[float], base: int) -> None:
        raise NotImplementedError


class AccelCheck(_Check):
    """Checks accelerations, gravity excluded, in axes with z up."""

    MEMORY = 4 + 5 + _FINDER_MEMORY

    def __init__(self, rotation: Matrix = IDENTITY) -> None:
        super().__init__(rotation)
        self._finder = ConstantFinder()

    def add(self, stamp_ns: int, acceleration: Vector, *, restarted: bool = False) -> bool:
        """Takes a sample [m/s²]; returns whether it is doubtful."""
        if restarted:
            self._restart()
        closed = self._bins.add(stamp_ns, acceleration)
        if closed is not None:
            self._take(closed)
        return self.doubtful

    def add_many(
        self, stamps: Integers, accelerations: Array, restarted: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Takes samples; returns (N,) which of them are doubtful: the bits that `add` gives.

        Args:
            stamps: (N,) [ns].
            accelerations: (N, 3) [m/s²].
            restarted: (N,) whether nothing links a sample to those before.
        """
        found = np.zeros(len(stamps), dtype=bool)
        if not len(stamps):
            return found
        edges = sorted({0, *np.flatnonzero(restarted).tolist(), len(stamps)})
        for start, end in zip(edges, edges[1:], strict=False):
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
            self._blame(_Cause(_SPEED, (x, y, z)))
        elif constant is not None:
            doubtful = acceleration_doubt(constant) is not None
            self._blame(_Cause(_CONSTANT, constant) if doubtful else _Cause())

    def _doubt_of(self, cause: _Cause) -> Doubt | None:
        if cause.kind == _SPEED:
            return _too_fast(math.hypot(*cause.vector))
        return acceleration_doubt(cause.vector) if cause.kind else None

    def _remembered(self, base: int) -> list[float]:
        return self._finder.memory(base)

    def _remember(self, memory: Sequence[float], base: int) -> None:
        self._finder.take_up(memory, base)


class ImuCheck(_Check):
    """Checks specific forces and angular velocities.

    Args:
        rotation: container ← sensor that was used.
    """

    WIDTH = 6
    MEMORY = 4 + 8 + 9 + _FINDER_MEMORY

    def __init__(self, rotation: Matrix = IDENTITY) -> None:
        super().__init__(rotation)
        self._finder = ConstantFinder()
        self._yaw = 0.0
        self._last = -(2**62)
        self._was_upright = self._turns = False
        self._up, self._stood = _UP, _UP

    def add(
        self,
        stamp_ns: int,
        acceleration: Vector,
        rate: Vector | None,
        yaw: float,
        *,
        restarted: bool = False,
    ) -> bool:
        """Takes a sample; returns whether it is doubtful.

        Args:
            stamp_ns: the moment [ns].
            acceleration: specific force in axes that do not follow the yaw, less gravity [m/s²].
            rate: angular velocity in the container's axes [rad/s]; None: not known.
            yaw: of the container in these axes [rad].
            restarted: whether nothing links the sample to those before.
        """
        if restarted:
            self._restart()
        self._yaw, self._turns = yaw, rate is not None
        closed = self._bins.add(stamp_ns, (*acceleration, *(rate or _ZERO)))
        if closed is not None:
            self._take(closed)
        return self.doubtful

    def _restart(self) -> None:
        super()._restart()
        self._finder.restart()
        self._last = -(2**62)

    def _take(self, closed: Bin) -> None:
        ax, ay, az, wx, wy, wz = closed.mean
        force = self._in_container((ax, ay, az + GRAVITY))
        self._turn(closed.number, (wx, wy, wz), force)
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        x, y, z = self._stood
        felt = (
            ax - GRAVITY * (c * x - s * y),
            ay - GRAVITY * (s * x + c * y),
            az + GRAVITY * (1.0 - z),
        )
        constant = self._finder.take(closed.number, (ax, ay, az), felt)
        if math.hypot(ax, ay, az) * BIN > TOP_SPEED:
            self._blame(_Cause(_SPEED, (ax, ay, az)))
        elif self._finder.stretch.seconds >= REST:
            x, y, z = self._finder.stretch.mean
            self._rest(self._in_container((x, y, z + GRAVITY)), certain=constant is not None)
        elif self._turns and angle(force, self._up) > SOMERSAULT and angle(force, _UP) < FELT:
            self._blame(_Cause(_DEGREES, (angle(force, self._up), 0.0, 0.0)))

    def _rest(self, force: Vector, *, certain: bool) -> None:
        """Takes a constant specific force, in the container's axes; certain: of a rest."""
        if force_doubt(force, self._rotation) is None:
            self._finder.bias = self._finder.stretch.mean
            if self._cause.kind != _DEGREES:
                self._blame(_Cause())
        elif not certain:
            return
        elif not self._is_honest(force):
            self._blame(_Cause(_CONSTANT, force))
            return
        self._was_upright = True  # or it was turned from there
        self._up = self._stood = _unit(force)

    def _is_honest(self, force: Vector) -> bool:
        """Whether a force that is not that of an upright rest may be right.

        A container that was upright, or that has been turned by its rates, may stand or move
        tilted. What is left of the force beside gravity as it was turned accelerates it.
        """
        turned = self._turns and angle(self._stood, _UP) > 0.5 * angle(force, _UP)
        if not (self._was_upright or turned):
            return False
        up = self._up if self._turns else _unit(force)
        away = math.dist(force, tuple(GRAVITY * part for part in up))
        return away * self._finder.stretch.seconds <= TOP_SPEED or away <= GRAVITY * FOLLOWED

    def _turn(self, number: int, rate: Vector, force: Vector) -> None:
        """Turns up as the container turns; slowly it follows the force that is measured.

        So it is twice: from the first force on, and from upright on.
        """
        felt = _unit(force)
        if self._last == -(2**62):
            self._up, self._stood = felt, _UP
        seconds = BIN * (number - self._last) if self._last > -(2**62) else BIN
        self._last = number
        self._up = _leant(_turned_back(self._up, rate, seconds), felt, seconds / LEANING)
        self._stood = _leant(_turned_back(self._stood, rate, seconds), felt, seconds / TRUSTING)

    def _in_container(self, v: Vector) -> Vector:
        c, s = math.cos(self._yaw), math.sin(self._yaw)
        return c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]

    def _doubt_of(self, cause: _Cause) -> Doubt | None:
        if cause.kind == _SPEED:
            return _too_fast(math.hypot(*cause.vector))
        if cause.kind == _DEGREES:
            told = math.degrees(cause.vector[0])
            return Doubt(
                f"by the angular velocity the container has tilted by {told:.0f}°, by gravity it "
                "has not: it is in degrees/s; publish rad/s"
            )
        return force_doubt(cause.vector, self._rotation) if cause.kind else None

    def _remembered(self, base: int) -> list[float]:
        last = float(self._last - base) if self._last > -(2**62) else math.nan
        own = [self._yaw, last, float(self._was_upright), *self._up, *self._stood]
        return [*own, *self._finder.memory(base)]

    def _remember(self, memory: Sequence[float], base: int) -> None:
        self._yaw, last, upright, ux, uy, uz, tx, ty, tz, *finder = memory
        self._last = -(2**62) if math.isnan(last) else round(last) + base
        self._was_upright = bool(upright)
        self._up, self._stood = (ux, uy, uz), (tx, ty, tz)
        self._finder.take_up(finder, base)


class PoseCheck(_Check):
    """Checks poses of the container: metres, upright at rest, order of the quaternion.

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
        """Takes a pose of the container [m]; returns whether it is doubtful."""
        if restarted:
            self._restart()
        x, y, z, w = quaternion
        # As if w, x, y, z had been given: its up is (…, 1 - 2 (y² + z²)).
        other = 1.0 - 2.0 * (y * y + z * z) / (x * x + y * y + z * z + w * w)
        closed = self._bins.add(stamp_ns, (*up_of(x, y, z, w), *position, other))
        if closed is not None:
            self._take(closed)
        return self.doubtful

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
            self._blame(_Cause(_SPEED, (speed, 0.0, 0.0)))
            return
        self._stretch.take(closed.number, (x, y, z))
        if self._stretch.seconds < REST or self._was_upright:
            return
        up = self._stretch.mean
        if attitude_doubt(up, self._rotation) is None:
            self._was_upright = True
            self._blame(_Cause())
        elif self._stood >= REST and self._cause.kind != _SPEED:
            scaled = 2.0 if other > math.cos(WRONG_POSE) else 1.0
            self._blame(_Cause(_CONSTANT, (scaled * up[0], scaled * up[1], scaled * up[2])))

    def _doubt_of(self, cause: _Cause) -> Doubt | None:
        if cause.kind == _SPEED:
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


InputCheck = AccelCheck | ImuCheck | PoseCheck


def up_of(x: float, y: float, z: float, w: float) -> Vector:
    """The world's z axis in the container's axes, of a quaternion world ← container."""
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    return scale * (x * z - w * y), scale * (y * z + w * x), 1.0 - scale * (x * x + y * y)


def _too_fast(size: float) -> Doubt:
    return Doubt(
        f"an acceleration of {size:.4g} m/s² for {BIN:g} s changes the speed by "
        f"{size * BIN:.3g} m/s, and no arm moves faster than {TOP_SPEED:g} m/s: is it in mm/s²? "
        "It must be m/s²"
    )


def _leant(v: Vector, to: Vector, share: float) -> Vector:
    """A direction that follows another by a share."""
    share = min(share, 1.0)
    return _unit(
        (
            v[0] + share * (to[0] - v[0]),
            v[1] + share * (to[1] - v[1]),
            v[2] + share * (to[2] - v[2]),
        )
    )


def _unit(v: Vector) -> Vector:
    size = math.hypot(*v)
    return (v[0] / size, v[1] / size, v[2] / size) if size > 0.0 else _UP


def _turned_back(v: Vector, rate: Vector, seconds: float) -> Vector:
    """A fixed vector in axes that have turned at a rate for some time (Rodrigues)."""
    speed = math.hypot(*rate)
    if speed == 0.0:
        return v
    kx, ky, kz = rate[0] / speed, rate[1] / speed, rate[2] / speed
    c, s = math.cos(speed * seconds), -math.sin(speed * seconds)
    along = (1.0 - c) * (kx * v[0] + ky * v[1] + kz * v[2])
    return (
        c * v[0] + s * (ky * v[2] - kz * v[1]) + along * kx,
        c * v[1] + s * (kz * v[0] - kx * v[2]) + along * ky,
        c * v[2] + s * (kx * v[1] - ky * v[0]) + along * kz,
    )
