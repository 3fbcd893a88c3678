"""Tells whether an input begins while the container moves.

The models start from still liquid. Where the first samples move already, the wave that was there
before is not known. Poses and velocities show the speed at their first moment: a motion that
begins with the recording has none, however fast it starts. Accelerations show none; of them the
first ones must be small, or be constant, as those of a tilted or biased sensor are.
"""

from __future__ import annotations

import math

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_motion.checks.constancy import BIN_NS, Vector
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.tuning import TUNING

BEGAN = "begins in motion"
"""Part of what is told, by which others find it."""


def began_doubt(shown: str) -> Doubt:
    """Returns what is told of an input that begins in motion.

    Args:
        shown: its speed or acceleration, with the unit.
    """
    return Doubt(
        f"the input {BEGAN} ({shown}): the liquid's state is not known there, and heights are "
        "wrong until the wave from before has decayed; begin while the container rests"
    )


def speed_at_start(t: Array, values: Array, derivative: int) -> float:
    """Returns the speed at the first of some moments [m/s]; 0 if the values do not show one.

    It is that of a parabola along the way. A motion that begins at the first moment, or later,
    bends away from a parabola such that its speed there is none, or leads back.

    Args:
        t: (N,) rising [s].
        values: (N, 3) positions [m], or velocities [m/s].
        derivative: of the values that the speed is: 1 of positions, 0 of velocities.
    """
    freedom = len(t) - 3
    along = values[-1] - values[0] if derivative else values[0]
    size = float(np.linalg.norm(along))
    if freedom < 1 or size == 0.0:
        return 0.0
    length = float(t[-1] - t[0])
    way = (values - values[0] if derivative else values) @ along / size
    powers = np.vander((t - t[0]) / length, 3, increasing=True)
    inverse = np.linalg.pinv(powers)
    terms = inverse @ way
    variance = float(np.sum((way - powers @ terms) ** 2)) / freedom
    noises = TUNING.began_noises * (1.0 + TUNING.began_few / (freedom * freedom))
    scale = length**-derivative
    error = scale * math.sqrt(variance) * float(np.linalg.norm(inverse[derivative]))
    speed = scale * float(terms[derivative])
    return speed if speed > max(TUNING.began_speed, noises * error) else 0.0


class Beginning:
    """Tells by the first accelerations of an input whether it begins in motion.

    Attributes:
        open: whether that is not decided yet.
        size: the first acceleration along the floor, where it is one of a motion [m/s²]; 0: none.
    """

    def __init__(self) -> None:
        self.open = True
        self.size = 0.0
        self._first_ns: int | None = None
        self._number = 0
        self._first: list[Vector] = []
        self._newest: list[Vector] = []
        self._all: list[Vector] = []

    def take(self, stamp_ns: int, acceleration: Vector) -> bool:
        """Adds an acceleration, gravity excluded [m/s²]; returns whether it shows a motion.

        That is told once.
        """
        if not self.open:
            return False
        if self._first_ns is None:
            self._first_ns, self._first = stamp_ns, self._newest
        number = (stamp_ns - self._first_ns) // BIN_NS
        if number != self._number:
            self._judge()
            self._newest, self._number = [], number
            self.open = self.open and number * BIN_NS <= TUNING.rest * SECOND
        self._newest.append(acceleration)
        self._all.append(acceleration)
        return self.size > 0.0

    def _judge(self) -> None:
        """Compares the newest time bin with the first."""
        first, last = _line(self._first, 0.0), _line(self._newest, 0.5)
        size, apart = float(np.hypot(*first)), float(np.hypot(*(last - first)))
        # Of what changes smoothly the second differences are small.
        bends = np.diff(np.array(self._all)[:, :2], 2, axis=0)
        noise = math.sqrt(float(np.mean(bends**2)) / 6.0) if len(bends) else 0.0
        if size <= max(TUNING.began_acceleration, TUNING.began_shakes * noise):
            self.open = False
        elif len(bends) >= TUNING.began_poses and apart > max(
            TUNING.departure, TUNING.began_noises * noise
        ):
            self.open, self.size = False, size


def _line(samples: list[Vector], share: float) -> Array:
    """Returns the value (2,) of a line through accelerations along the floor [m/s²].

    Args:
        samples: evenly spaced.
        share: part of their time at which it is wanted.
    """
    values = np.array(samples)[:, :2]
    if len(values) < 4:
        found: Array = values.mean(axis=0)
        return found
    powers = np.vander(np.linspace(0.0, 1.0, len(values)), 2, increasing=True)
    terms = np.linalg.pinv(powers) @ values
    value: Array = terms[0] + share * terms[1]
    return value
