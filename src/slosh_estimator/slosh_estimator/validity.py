"""What limits an estimate."""

from __future__ import annotations

import math
from enum import IntFlag

from slosh_model.model import Model


class EstimateFlag(IntFlag):
    """What limits an estimate; the values of SloshEstimate.msg."""

    NONE = 0
    PLANARITY_LOST = 1
    ACCELERATION_LIMIT = 2
    JERK_LIMIT = 4
    ABOVE_RIM = 8
    SETTLING = 16
    AFTER_GAP = 32
    DIVERGED = 64


def validity_limits(model: Model) -> tuple[float, float, float, float, float]:
    """What the motion is judged by (DL22, §4.2).

    Returns:
        acceleration [m/s²] and jerk [m/s³] beyond which the surface is no plane, those beyond the
        validated range, and the height from the still surface to the rim [m].
    """
    limits, freeboard = model.limits, model.container.freeboard
    return (
        limits.planar_acceleration,
        limits.planar_jerk,
        limits.acceleration,
        limits.jerk,
        math.inf if freeboard is None else freeboard,
    )
