"""Heights that the monitor compares, and the difference between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from slosh_estimator.tuning import TUNING
from slosh_motion.inputs.frames import Vector


class Condition(IntEnum):
    """State of the monitor; the values are those of SloshComparison.msg.

    >>> Condition.WARN < Condition.ERROR
    True
    """

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3
    BLIND = 4


class Expected(NamedTuple):
    """Heights [m] that a sensor should measure at one time, according to the models.

    Attributes:
        linear, nonlinear: heights as it reads them [m].
        flags: bits of EstimateFlag.
        wave: the liquid's nonlinear height as a vector in the direction of its azimuth [m].
    """

    linear: float = math.nan
    nonlinear: float = math.nan
    flags: int = 0
    wave: complex = complex(math.nan, math.nan)

    def towards(self, other: Expected, share: float) -> Expected:
        """Interpolates linearly to another predicted measurement; `share` is in [0, 1]."""
        return Expected(
            self.linear + share * (other.linear - self.linear),
            self.nonlinear + share * (other.nonlinear - self.nonlinear),
            self.flags | other.flags,
            self.wave + share * (other.wave - self.wave),
        )


class EstimatePoint(NamedTuple):
    """An estimate that the monitor stores until measurements of its time arrive.

    Attributes:
        stamp_ns: [ns].
        linear, nonlinear: the liquid's heights [m], by which the limit is watched.
        flags: bits of EstimateFlag.
        acceleration: what drove it [m/s²]; it tells motions apart. None: not known.
        reading: what a sensor reads of the two heights [m], to be compared with what it read;
            None: the heights themselves.
        delay_ns: by how much a measurement comes late [ns].
        azimuth: of the nonlinear height [rad]; NaN: unknown.
        tray: nonlinear height of each container of a tray [m]; empty: there is none.
    """

    stamp_ns: int
    linear: float
    nonlinear: float
    flags: int = 0
    acceleration: Vector | None = None
    reading: tuple[float, float] | None = None
    delay_ns: int = 0
    azimuth: float = math.nan
    tray: Sequence[float] = ()

    @property
    def expected(self) -> Expected:
        """Returns the measurement that a sensor should make at the time of this estimate."""
        linear, nonlinear = self.reading or (self.linear, self.nonlinear)
        wave = complex(
            self.nonlinear * math.cos(self.azimuth), self.nonlinear * math.sin(self.azimuth)
        )
        return Expected(linear, nonlinear, self.flags, wave)


class MeasuredPoint(NamedTuple):
    """A measured height of the free surface, with stamp and flags.

    Attributes:
        stamp_ns: [ns].
        msh, stddev: maximum height and its standard deviation [m].
        flags: of FreeSurface.msg.
        wave: the wave as a vector [m], and
        axis: the image plane's right, of side views [rad]; see `azimuth.measured_waves`.
        level: mean height at the left and right edge [m]; NaN: unknown.
    """

    stamp_ns: int
    msh: float
    stddev: float = math.nan
    flags: int = 0
    wave: complex = complex(math.nan, math.nan)
    axis: float = math.nan
    level: float = math.nan


class Waiting(NamedTuple):
    """A measurement that waits for the estimate of its stamp, with its arrival time [ns]."""

    point: MeasuredPoint
    arrival_ns: int

    def is_over(self, now_ns: int) -> bool:
        """Whether a measurement has waited too long, or the clock was set back meanwhile."""
        return not 0 <= now_ns - self.arrival_ns < TUNING.patience_ns


class Comparison(NamedTuple):
    """Measured and estimated height at one time; the fields of SloshComparison.msg."""

    stamp_ns: int
    measured: float
    measured_stddev: float
    estimated_linear: float
    estimated_nonlinear: float
    residual_linear: float
    residual_nonlinear: float
    sigma_linear: float
    sigma_nonlinear: float
    epsilon_linear: float
    epsilon_nonlinear: float
    count: int  # type: ignore[assignment]  # the message's name, over tuple.count
    state: Condition
    measured_stale: bool
    estimate_stale: bool
    measured_flags: int
    estimate_flags: int
    without_camera: bool = False
    sides_disagree: bool = False
