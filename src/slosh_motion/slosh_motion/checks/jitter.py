"""Finds stamps that scatter about the moments of measurement, as those of late messages do.

A controller or a camera measures evenly. Where its messages are stamped as they are sent or
arrive, the motion is smoother at even times, in the order of arrival, than at the stamps. Where
it measures unevenly and stamps rightly the stamps are smoother, and with noise both are alike. The
filter of poses finds the even times itself, unless stamps are nearer to another tick.

A scatter σ of the stamps is an error vσ of each position. As white noise it makes waves: for the
wave of frequency ω their mean square is (1.82 ω σ)² dt/2 ∫v²dt, without damping. 1.82 is the
height of a deep round container's first mode for its displacement (DL22, table 1).
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median

from slosh_base.files.nanoseconds import SECOND
from slosh_motion.checks.constancy import Vector
from slosh_motion.checks.constant_meaning import Doubt
from slosh_motion.tuning import TUNING

HEIGHT_GAIN = 1.82
"""Height at the wall for a displacement of the sloshing mass, of a deep round container."""
_SCATTER = 1.4826 / math.sqrt(1.5)
"""Standard deviation of single stamps for the median of their distances to their neighbours'."""


class JitterCheck:
    """Compares how smooth a motion is at its stamps and at even times.

    Args:
        noun: what comes, in the plural.
        order: 2 for positions, 1 for velocities.

    Attributes:
        scatter: of the stamps, where the motion shows one [s]; else 0.
    """

    def __init__(self, noun: str, order: int = 2) -> None:
        self.scatter = 0.0
        self._noun, self._order = noun, order
        self._least = TUNING.jitter_speed if order == 2 else TUNING.jitter_acceleration
        self._one: tuple[int, Vector] | None = None
        self._two: tuple[int, Vector] | None = None
        self._off: tuple[Vector, Vector] | None = None  # from even times, from the stamps
        self._rows: deque[tuple[float, float, float]] = deque(maxlen=TUNING.jitter_rows)
        self._count = self._all = self._astray = 0
        self._squares = 0.0  # of the rate of the values, over time

    def take(self, stamp_ns: int, values: Vector) -> None:
        """Adds a position [m] or a velocity [m/s], in order of arrival, with its stamp [ns]."""
        one, two = self._one, self._two
        self._one, self._two = two, (stamp_ns, values)
        if one is None or two is None:
            return
        seconds = (stamp_ns - one[0]) / SECOND
        off, self._off = self._off, None
        self._all += 1
        self._astray += seconds <= 0.0
        if not 0.0 < seconds < TUNING.jitter_gap:
            return
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = one[1], two[1], values
        dx, dy, dz = cx - ax, cy - ay, cz - az
        even = bx - ax - 0.5 * dx, by - ay - 0.5 * dy, bz - az - 0.5 * dz
        share = (two[0] - one[0]) / SECOND / seconds - 0.5
        self._astray += abs(share) > TUNING.jitter_astray
        stamped = even[0] - share * dx, even[1] - share * dy, even[2] - share * dz
        self._off = even, stamped
        rate = math.sqrt(dx * dx + dy * dy + dz * dz) / seconds
        self._squares += 0.5 * seconds * rate * rate
        if off is not None and rate > self._least:
            self._add(math.dist(even, off[0]), math.dist(stamped, off[1]), abs(share) * seconds)

    def _add(self, even: float, stamped: float, aside: float) -> None:
        """Adds how far a value is off at even times and at the stamps, and a stamp's scatter."""
        self._rows.append((even, stamped, aside))
        self._count += 1
        if self._count % TUNING.jitter_least:
            return
        smooth, rough, scatter = (median(column) for column in zip(*self._rows, strict=True))
        if smooth < TUNING.jitter_ratio * rough:
            self.scatter = max(self.scatter, _SCATTER * scatter)

    def error(self, frequency: float, interval: float) -> float:
        """Returns the standard deviation of a wave's height by the scatter [m].

        Args:
            frequency: of the wave [rad/s].
            interval: between two messages [s].
        """
        gain = HEIGHT_GAIN * (frequency if self._order == 2 else 1.0)
        return gain * self.scatter * math.sqrt(0.5 * interval * self._squares)

    def doubt(self, frequency: float, interval: float) -> Doubt | None:
        """Returns what is told of stamps that scatter; None if that does not matter.

        Args:
            frequency: of the wave [rad/s].
            interval: between two messages [s].
        """
        error = self.error(frequency, interval)
        if error < TUNING.jitter_error or self._astray < TUNING.jitter_share * self._all:
            return None
        return Doubt(
            f"the stamps of the {self._noun} scatter by {1e3 * self.scatter:.2g} ms about the "
            f"moments of measurement: heights are uncertain by {2e3 * error:.2g} mm, or more "
            "where stamps go back; let the driver stamp each message with the time of measurement"
        )
