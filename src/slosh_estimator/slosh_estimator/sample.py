"""An input sample of the estimator, however it was measured."""

from __future__ import annotations

from typing import NamedTuple

SECONDS = 1e-9  # of a nanosecond


class Sample(NamedTuple):
    """What drives the models at one moment.

    A named tuple, because a thousand are made each second.

    Attributes:
        stamp_ns: the moment [ns].
        ax, ay, az: acceleration, gravity excluded [m/s²], in axes that are parallel to the
            container's but do not follow its yaw: the liquid in a round one does not either.
        yaw: angle of the container's x axis in these axes [rad].
        restarted: True for the first sample and after a gap: nothing links it to those before.
    """

    stamp_ns: int
    ax: float
    ay: float
    az: float
    yaw: float = 0.0
    restarted: bool = False
