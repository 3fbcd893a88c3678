"""What the monitor holds against each other, and what comes of it."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from slosh_estimator.rotation import Vector


class Condition(IntEnum):
    """State of the monitor; the values of SloshComparison.msg."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3
    BLIND = 4


class EstimatePoint(NamedTuple):
    """An estimate as the monitor keeps it.

    Attributes:
        stamp_ns: [ns].
        linear, nonlinear: the liquid's heights [m], by which the limit is watched.
        flags: bits of EstimateFlag.
        acceleration: what drove it [m/s²]; it tells motions apart. None: not known.
        reading: what a sensor reads of the two heights [m], to be compared with what it read;
            None: the heights themselves.
        delay_ns: by how much a measurement comes late [ns].
    """

    stamp_ns: int
    linear: float
    nonlinear: float
    flags: int = 0
    acceleration: Vector | None = None
    reading: tuple[float, float] | None = None
    delay_ns: int = 0


class MeasuredPoint(NamedTuple):
    """A measurement: stamp [ns], maximum height and its standard deviation [m], flags."""

    stamp_ns: int
    msh: float
    stddev: float = math.nan
    flags: int = 0


class Comparison(NamedTuple):
    """Measured against estimated at one moment; the fields of SloshComparison.msg."""

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
