"""One input sample, as every input adapter gives it to the estimator."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple


class Start(IntEnum):
    """How a sample continues the one before."""

    CONTINUES = 0
    FIRST = 1
    AFTER_GAP = 2


class Sample(NamedTuple):
    """Acceleration that drives the models.

    Attributes:
        stamp_ns: moment [ns].
        ax, ay, az: acceleration without gravity [m/s²], in axes parallel to the container's that
            do not follow its yaw.
        yaw: the container's yaw against these axes [rad].
        start: how the sample continues the one before.
    """

    stamp_ns: int
    ax: float
    ay: float
    az: float
    yaw: float = 0.0
    start: Start = Start.CONTINUES


def wrap(angle: float) -> float:
    """The angle in (-π, π]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped <= -math.pi else wrapped
