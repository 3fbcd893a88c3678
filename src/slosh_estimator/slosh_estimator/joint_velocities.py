"""Compares the velocities in joint states with the change of the positions.

Drivers report commanded, filtered, late or missing velocities, in other units, or zeros. So over
stretches of time the mean velocity is compared with what the positions did: only what agrees there
is a velocity. The estimator uses the positions alone, and tells what it found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from slosh_estimator.sample import SECONDS_PER_NS
from slosh_estimator.tuning import TUNING


class JointVelocities:
    """Compares joint velocities with position changes over intervals of TUNING.stretch_ns."""

    def __init__(self) -> None:
        self._start: tuple[int, Sequence[float]] | None = None
        self._last: tuple[int, Sequence[float]] | None = None
        self._sums: list[float] = []
        self._moved = self._missed = self._along = self._told = 0.0

    def take(self, stamp_ns: int, positions: Sequence[float], velocities: Sequence[float]) -> None:
        """Adds a joint state's positions [rad or m] and velocities [rad/s or m/s]."""
        last = self._last
        self._last = stamp_ns, velocities
        if self._start is None or last is None or len(last[1]) != len(velocities):
            self._start, self._sums = (stamp_ns, positions), [0.0] * len(positions)
            return
        seconds = (stamp_ns - last[0]) * SECONDS_PER_NS
        if not 0.0 < seconds < 0.1:
            self._start = None
            return
        sums = self._sums
        for k, (before, now) in enumerate(zip(last[1], velocities, strict=True)):
            sums[k] += 0.5 * seconds * (before + now)
        start_ns, begin = self._start
        if stamp_ns - start_ns >= TUNING.stretch_ns:
            for total, one, other in zip(sums, begin, positions, strict=True):
                self._moved += (other - one) ** 2
                self._missed += (other - one - total) ** 2
                self._along += (other - one) * total
                self._told += total * total
            self._start, self._sums = (stamp_ns, positions), [0.0] * len(positions)

    @property
    def error(self) -> float:
        """Relative error of the velocities, or NaN if it is unknown."""
        enough = self._moved > TUNING.compared**2
        return math.sqrt(self._missed / self._moved) if enough else math.nan

    def remark(self) -> str:
        """Returns that positions and velocities differ by a constant factor; empty if not.

        Velocities that are late, filtered or zeros are none such: they are common and not used.
        """
        if math.isnan(self.error) or self.error <= TUNING.agreeing_velocity:
            return ""
        factor = self._along / self._moved
        left = self._told - factor * factor * self._moved
        if left >= (TUNING.agreeing_velocity * factor) ** 2 * self._moved:
            return ""
        return (
            f"the joint velocities are {factor:.3g} times the change of the positions: the unit "
            "or sign of one of them is wrong; the positions are used"
        )

    def facts(self) -> dict[str, str]:
        """Returns how well velocities agree with positions, for the diagnostics."""
        if math.isnan(self.error):
            return {}
        agree = self.error <= TUNING.agreeing_velocity
        text = "agree with the positions" if agree else "do not agree with the positions"
        return {"joint velocities": f"not used; they {text} ({1e2 * self.error:.0f} % off)"}
