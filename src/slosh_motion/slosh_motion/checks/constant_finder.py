"""Finds the constant part of an acceleration at standstill: gravity, tilt or bias."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slosh_motion.checks.constancy import (
    BIN,
    MOST,
    STRETCH_MEMORY,
    TOLERANCE,
    TOP_SPEED,
    Stretch,
    Vector,
)
from slosh_motion.checks.constant_meaning import FINE
from slosh_motion.tuning import TUNING

REST = TUNING.rest
DEPARTURE = TUNING.departure
_ZERO: Vector = (0.0, 0.0, 0.0)


class ConstantFinder:
    """Finds the constant part of an acceleration while the container is at rest."""

    def __init__(self) -> None:
        self.stretch = Stretch(TOLERANCE, MOST)
        self.restart()

    def restart(self) -> None:
        """Discards the present standstill and the integrated speed, after a gap in the input."""
        self.stretch.restart()
        self._earlier: Vector | None = None
        self._departed = False
        self.bias: Vector = _ZERO
        self._speed, self._time, self._last = _ZERO, 0.0, -(2**62)

    def take(self, number: int, mean: Vector, felt: Vector | None = None) -> Vector | None:
        """Adds a time bin; returns the constant acceleration at rest, or None if it is unknown.

        Args:
            number: of the bin.
            mean: of the input [m/s²].
            felt: what moves the container, as far as it is known; None: the input [m/s²].
        """
        felt = felt or mean
        steps = number - self._last if self._time else 1
        self._last = number
        seconds = BIN * steps
        kept = math.exp(-seconds / TUNING.forgetting)
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

    def adopt(self, constant: Vector) -> None:
        """Takes a constant acceleration as the input's bias, which is then subtracted."""
        self._earlier, self._departed, self.bias = None, False, constant
        self._speed, self._time = _ZERO, 0.0

    def _is_no_acceleration(self, constant: Vector) -> bool:
        """Returns whether a constant is no real acceleration, by the speed that it would cause."""
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
        """Returns the state as numbers for `take_up`; time bins are counted from `base`."""
        last = float(self._last - base) if self._time else math.nan
        earlier = self._earlier or (math.nan,) * 3
        own = [*self._speed, self._time, last, *earlier, float(self._departed), *self.bias]
        return [*own, *self.stretch.memory(base)]

    def take_up(self, memory: Sequence[float], base: int) -> None:
        """Restores the state that `memory` returned."""
        vx, vy, vz, self._time, last, ex, ey, ez, departed, bx, by, bz, *stretch = memory
        self.bias = bx, by, bz
        self._speed = vx, vy, vz
        self._last = -(2**62) if math.isnan(last) else round(last) + base
        self._earlier = None if math.isnan(ex) else (ex, ey, ez)
        self._departed = bool(departed)
        self.stretch.take_up(stretch, base)


FINDER_MEMORY = 12 + STRETCH_MEMORY
"""Numbers in the memory of a ConstantFinder."""
