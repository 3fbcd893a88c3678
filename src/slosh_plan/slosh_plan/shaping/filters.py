"""Input shapers: delay and average a motion so that residual waves cancel.

A filter replaces s(t) by Σ Aᵢ s(t − tᵢ) with Σ Aᵢ = 1. A mode with the poles −ζω ± iω_d is left at
rest where K(p) = Σ Aᵢ exp(−p tᵢ) is zero at its poles; a zero that is double stays small where the
frequency errs (Singer, Seering 1990). Continuous kernels are impulses, too: those of Gauss's
quadrature, exact to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from slosh_base.types import Array
from slosh_plan.errors import SloshPlanError

QUADRATURE = 32
"""Points of a continuous kernel: its zero at one period is exact to rounding."""


@dataclass(frozen=True, slots=True)
class Damped:
    """Frequency and damping of a mode, for the design of a filter.

    >>> round(Damped(frequency=2.0 * math.pi, damping_ratio=0.01).period, 3)  # s
    1.0

    Attributes:
        frequency: ω, undamped [rad/s].
        damping_ratio: ζ.

    Raises:
        SloshPlanError: no frequency, or a mode that does not swing.
    """

    frequency: float
    damping_ratio: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.frequency) and self.frequency > 0.0):
            raise SloshPlanError(f"frequency = {self.frequency!r} rad/s must be positive")
        if not 0.0 <= self.damping_ratio < 1.0:
            raise SloshPlanError(f"damping ratio = {self.damping_ratio!r} must lie in [0, 1)")

    @property
    def decay(self) -> float:
        """Decay rate ζω of the mode's oscillation [1/s]."""
        return self.damping_ratio * self.frequency

    @property
    def damped_frequency(self) -> float:
        """Damped natural frequency ω_d = ω √(1 − ζ²) [rad/s]."""
        return self.frequency * math.sqrt(1.0 - self.damping_ratio**2)

    @property
    def period(self) -> float:
        """Period 2π/ω_d of the damped oscillation [s]."""
        return 2.0 * math.pi / self.damped_frequency


@dataclass(frozen=True, slots=True, eq=False)
class Filter:
    """An input shaper: delayed and weighted copies of the motion are added.

    Attributes:
        name: for tables.
        times: (K,) delays from 0 [s].
        amplitudes: (K,) their weights; the sum is 1.
        length: by which a motion becomes longer [s].
    """

    name: str
    times: Array
    amplitudes: Array
    length: float

    def __call__(self, function: Callable[[Array], Array], t: Array) -> Array:
        """Applies the filter to a function of time, at times t (N,) [s].

        Args:
            function: (N,) times to (N, …) values.
            t: when.
        """
        pairs = zip(self.times, self.amplitudes, strict=True)
        return np.asarray(sum(amplitude * function(t - delay) for delay, amplitude in pairs))

    def then(self, other: Filter) -> Filter:
        """Returns the combination of this filter with another filter applied after it."""
        times = np.add.outer(self.times, other.times).ravel()
        weights = np.multiply.outer(self.amplitudes, other.amplitudes).ravel()
        name = self.name if self.name == other.name else f"{self.name}, {other.name}"
        return Filter(name, times, weights, self.length + other.length)

    def residual(self, mode: Damped) -> float:
        """Returns the residual wave of a filtered step, relative to the unfiltered step.

        Both at the time when the filtered step ends (Singer, Seering 1990).
        """
        pole = complex(-mode.decay, mode.damped_frequency)
        left = np.sum(self.amplitudes * np.exp(-pole * self.times))
        return float(abs(left) * math.exp(-mode.decay * self.length))


def zero_vibration(mode: Damped) -> Filter:
    """Creates the ZV shaper: two impulses, half a period apart.

    >>> shaper = zero_vibration(Damped(frequency=2.0 * math.pi, damping_ratio=0.0))
    >>> shaper.times.tolist(), shaper.amplitudes.tolist()
    ([0.0, 0.5], [0.5, 0.5])
    """
    k = math.exp(-mode.decay * mode.period / 2.0)
    return _impulses("zv", mode, [1.0, k])


def zero_vibration_derivative(mode: Damped) -> Filter:
    """Creates the ZVD shaper: three impulses, robust to small frequency errors.

    >>> shaper = zero_vibration_derivative(Damped(frequency=2.0 * math.pi, damping_ratio=0.0))
    >>> shaper.times.tolist(), shaper.amplitudes.tolist()
    ([0.0, 0.5, 1.0], [0.25, 0.5, 0.25])
    """
    k = math.exp(-mode.decay * mode.period / 2.0)
    return _impulses("zvd", mode, [1.0, 2.0 * k, k * k])


def moving_average(mode: Damped) -> Filter:
    """Creates a moving average over one period, a filter for an undamped mode.

    >>> mode = Damped(frequency=2.0 * math.pi, damping_ratio=0.0)
    >>> moving_average(mode).length  # s
    1.0

    It has zeros at all multiples of the frequency; of a damped mode it leaves about ζ.
    """
    times, weights = _quadrature(mode.period)
    return Filter("average", times, weights / weights.sum(), mode.period)


def exponential(mode: Damped) -> Filter:
    """Creates an average over one period whose weights decay like the mode's oscillation.

    >>> mode = Damped(frequency=2.0 * math.pi, damping_ratio=0.02)
    >>> exponential(mode).residual(mode) < 1e-6
    True

    Its zeros are those of the damped mode (Biagiotti, Melchiorri, Moriello 2016).
    """
    times, weights = _quadrature(mode.period)
    weights = weights * np.exp(-mode.decay * times)
    return Filter("exponential", times, weights / weights.sum(), mode.period)


FILTERS: Mapping[str, Callable[[Damped], Filter]] = MappingProxyType(
    {
        "zv": zero_vibration,
        "zvd": zero_vibration_derivative,
        "exponential": exponential,
        "average": moving_average,
    }
)
"""The filters by name."""


def _impulses(name: str, mode: Damped, weights: list[float]) -> Filter:
    times = 0.5 * mode.period * np.arange(len(weights), dtype=np.float64)
    amplitudes = np.array(weights) / sum(weights)
    return Filter(name, times, amplitudes, float(times[-1]))


def _quadrature(length: float) -> tuple[Array, Array]:
    points, weights = np.polynomial.legendre.leggauss(QUADRATURE)
    return 0.5 * length * (points + 1.0), 0.5 * length * weights
