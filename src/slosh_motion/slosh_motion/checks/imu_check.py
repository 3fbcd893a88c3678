"""Checks an inertial sensor: gravity, mounting and unit of the angular velocity."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slosh_model.constants import GRAVITY
from slosh_motion.checks.constancy import (
    BIN,
    FINDER_MEMORY,
    REST,
    TOP_SPEED,
    Bin,
    ConstantFinder,
    Vector,
)
from slosh_motion.checks.constant_meaning import Doubt, Matrix, angle, force_doubt
from slosh_motion.checks.input_checks import (
    CONSTANT,
    DEGREES,
    IDENTITY,
    SPEED,
    Cause,
    Check,
    too_fast,
)

FOLLOWED = math.radians(5.0)
"""So far the turned gravity and the measured one may lie apart at rest."""
SOMERSAULT, FELT = 2.1, 1.0
"""Where the rates turn gravity by 120°, and it lies within 60° of +z, they are no rad/s [rad]."""
LEANING, TRUSTING = 20.0, 60.0
"""Time constants with which turned gravity follows the measured one [s]: a gyroscope has a bias.
The longer one is of gravity as it is where the container stood upright at the beginning."""
WEIGHT = 0.01 * GRAVITY
"""A sensor that nothing accelerates feels gravity, to this [m/s²]."""
SPINS, ALONG, SPUN = 0.3, math.radians(1.5), 8
"""A container that spins so fast [rad/s] upright has its rates along z; along the force, to this
angle [rad], for so many bins in a row, they are those of a sensor mounted askew."""
_ZERO: Vector = (0.0, 0.0, 0.0)
_UP: Vector = (0.0, 0.0, 1.0)


class ImuCheck(Check):
    """Checks specific forces and angular velocities of an inertial sensor.

    Args:
        rotation: container ← sensor that was used.
    """

    WIDTH = 6
    MEMORY = 4 + 8 + 9 + FINDER_MEMORY

    def __init__(self, rotation: Matrix = IDENTITY) -> None:
        super().__init__(rotation, has_gravity=True)
        self._finder = ConstantFinder()
        self._yaw = 0.0
        self._last = -(2**62)
        self._was_upright = self._turns = False
        self._spun = 0
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
        """Adds a sample to the check; returns whether the input is doubtful so far.

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
            self._blame(Cause(SPEED, (ax, ay, az)))
        elif self._finder.stretch.seconds >= REST:
            x, y, z = self._finder.stretch.mean
            self._rest(self._in_container((x, y, z + GRAVITY)), certain=constant is not None)
        elif self._turns and angle(force, self._up) > SOMERSAULT and angle(force, _UP) < FELT:
            self._blame(Cause(DEGREES, (angle(force, self._up), 0.0, 0.0)))
        elif self._spins_askew((wx, wy, wz), force):
            self._blame(Cause(CONSTANT, force))

    def _spins_askew(self, rate: Vector, force: Vector) -> bool:
        """Returns whether the measured axis of a rotation shows that the sensor is tilted.

        It has not been upright in the sensor's eyes, and spins about what it takes for vertical.
        """
        along = angle(rate, force)
        askew = (
            not self._was_upright
            and math.hypot(*rate) > SPINS
            and min(along, math.pi - along) < ALONG
            and _is_weight(force)
            and force_doubt(force, self._rotation) is not None
        )
        self._spun = self._spun + 1 if askew else 0
        return self._spun >= SPUN

    def _rest(self, force: Vector, *, certain: bool) -> None:
        """Checks a constant specific force in container axes at rest.

        One of gravity's size from the first sample on is that of a rest, too.
        """
        if force_doubt(force, self._rotation) is None:
            self._finder.bias = self._finder.stretch.mean
            if self._cause.kind != DEGREES:
                self._blame(Cause())
        elif not certain and not (self._finder.stretch.unbroken and _is_weight(force)):
            return
        elif not self._is_honest(force):
            self._blame(Cause(CONSTANT, force))
            return
        self._was_upright = True  # or it was turned from there
        self._up = self._stood = _unit(force)

    def _is_honest(self, force: Vector) -> bool:
        """Returns whether a specific force that shows a tilted container may be correct.

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
        """Integrates the vertical in container axes from the rate; specific force corrects it.

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

    def _doubt_of(self, cause: Cause) -> Doubt | None:
        if cause.kind == SPEED:
            return too_fast(math.hypot(*cause.vector))
        if cause.kind == DEGREES:
            told = math.degrees(cause.vector[0])
            return Doubt(
                f"by the angular velocity the container has tilted by {told:.0f}°, by gravity it "
                "has not: the velocity is in degrees/s; publish rad/s"
            )
        return force_doubt(cause.vector, self._rotation) if cause.kind else None

    def _remembered(self, base: int) -> list[float]:
        last = float(self._last - base) if self._last > -(2**62) else math.nan
        upright = 1.0 if self._was_upright else -float(self._spun)
        own = [self._yaw, last, upright, *self._up, *self._stood]
        return [*own, *self._finder.memory(base)]

    def _remember(self, memory: Sequence[float], base: int) -> None:
        self._yaw, last, upright, ux, uy, uz, tx, ty, tz, *finder = memory
        self._last = -(2**62) if math.isnan(last) else round(last) + base
        self._was_upright, self._spun = upright > 0.0, max(round(-upright), 0)
        self._up, self._stood = (ux, uy, uz), (tx, ty, tz)
        self._finder.take_up(finder, base)


def _turned_back(v: Vector, rate: Vector, seconds: float) -> Vector:
    """Rotates a fixed vector into a frame that turned at a constant rate (Rodrigues)."""
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


def _is_weight(force: Vector) -> bool:
    """Returns whether a specific force has the magnitude of gravity.

    A container that accelerates level feels g / cos(lean): it must be nearer to g than to that.
    """
    size = math.hypot(*force)
    level = GRAVITY * (size / max(abs(force[2]), 1e-9) - 1.0)
    return abs(size - GRAVITY) <= min(WEIGHT, 0.5 * level)


def _leant(v: Vector, to: Vector, share: float) -> Vector:
    """Moves a unit vector by a fraction of the way to a second one, and normalises it."""
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
