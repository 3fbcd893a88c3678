"""Bounds the wave's envelope while the container is at rest and nothing is measured."""

from __future__ import annotations

import math
from typing import NamedTuple

from slosh_estimator.tuning import TUNING


class Envelope(NamedTuple):
    """The largest height that the wave can still reach, according to the Kalman filter.

    Attributes:
        stamp_ns: the moment [ns].
        height, stddev: the height and its standard deviation [m].
        noise: standard deviation of what the input's noise at rest adds to the height [m].
        worst, worst_stddev: the height and its standard deviation [m] with the worst frequency
            and damping that calm allows for; see `slosh_estimator.observer.envelope`.
        slowest: least plausible rate of the decay [1/s].
    """

    stamp_ns: int
    height: float
    stddev: float
    noise: float
    worst: float
    worst_stddev: float
    slowest: float

    def bound(self, deviations: float) -> float:
        """Returns an upper bound of the height [m], a number of standard deviations above it.

        The worst height has an error along the wave and one across it, which matters where there
        is hardly a wave.
        """
        error = deviations * self.worst_stddev
        return min(self.height + deviations * self.stddev, math.hypot(self.worst + error, error))


class EnvelopeBounds:
    """Upper bounds of the wave's envelope [m]: at 95 %, and with more margin to judge calmness.

    In motion, and at each measurement, a bound is a height and some of its deviations: those of
    the filter, or, where they are less, those of the worst model that calm allows for.
    At rest nothing gives the liquid energy, so that a bound decays from there with the least
    plausible damping. The filter itself does not tell that: an error of the frequency turns the
    phase of the wave by more and more, which in a linear filter grows beyond the wave, but changes
    no envelope. Only a vibration that the input shows above its own noise holds a bound up.
    """

    def __init__(self) -> None:
        self._bounds = (math.inf, math.inf)
        self._stamp_ns: int | None = None
        self._corrected_ns: int | None = None

    def update(
        self, envelope: Envelope, *, resting: bool, corrected_ns: int | None, contradicted: bool
    ) -> tuple[float, float]:
        """Returns two upper bounds of the envelope [m]: at 95 %, and the safer one for calmness.

        Args:
            envelope: of a newer moment.
            resting: whether the container rests.
            corrected_ns: stamp of the last measurement that was used [ns]; None: none.
            contradicted: whether the last measurement was rejected: then no bound decays.
        """
        height, deviations = envelope.height, (TUNING.bound, TUNING.surely_calm)
        filtered = [envelope.bound(by) for by in deviations]
        corrected = corrected_ns != self._corrected_ns
        known = math.isfinite(height) and math.isfinite(self._bounds[0])
        if self._stamp_ns is None or not resting or corrected or not known:
            bounds = filtered
        elif contradicted:
            bounds = [max(pair) for pair in zip(self._bounds, filtered, strict=True)]
        else:
            elapsed = max(envelope.stamp_ns - self._stamp_ns, 0) / 1e9
            faded = math.exp(-envelope.slowest * elapsed)
            shaken = height - TUNING.surely_calm * envelope.noise
            bounds = [max(before * faded, shaken) for before in self._bounds]
        self._bounds = (bounds[0], bounds[1])
        self._stamp_ns, self._corrected_ns = envelope.stamp_ns, corrected_ns
        return self._bounds
