"""Flags and texts for the limitations of an estimate."""

from __future__ import annotations

import math
from enum import IntFlag

from slosh_estimator.tuning import TUNING
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.effects.registry import EFFECTS
from slosh_model.model import Model

SLOWEST_DECAY = 1e-6
"""A wave that decays more slowly never does [1/s]."""


class EstimateFlag(IntFlag):
    """Limitations of an estimate; the values are those of SloshEstimate.msg."""

    NONE = 0
    PLANARITY_LOST = 1
    ACCELERATION_LIMIT = 2
    JERK_LIMIT = 4
    ABOVE_RIM = 8
    SETTLING = 16
    AFTER_GAP = 32
    DIVERGED = 64
    INPUT_DOUBTFUL = 128
    INPUT_CONTESTED = 256
    INPUT_TOO_SLOW = 512
    LINEAR_ONLY = 1024
    BEYOND_LINEAR = 2048
    INPUT_CONTRADICTED = 4096
    NO_CONTAINER = 8192


def validity_limits(model: Model) -> dict[str, float]:
    """Returns a model's limits of validity (DL22, §4.2) by their names in CHECKS."""
    limits, rim = model.limits, model.container.height_below_rim()
    return {
        "planar_acceleration": limits.planar_acceleration,
        "planar_jerk": limits.planar_jerk,
        "acceleration": limits.acceleration,
        "jerk": limits.jerk,
        "linear_height": model.container.linear_height,
        "rim": math.inf if rim is None else rim,
    }


def settling_seconds(model: Model) -> float:
    """Returns the time after which an unknown state of the liquid is forgotten [s]."""
    first = model.mode_constants()[0]
    slowest = min(first.along(axis).natural_frequency for axis in (X_AXIS, Y_AXIS))
    rate = first.damping_ratio * slowest
    return TUNING.settled / rate if rate > SLOWEST_DECAY else math.inf


def began_text(text: str, model: Model) -> str:
    """Returns what is told of an input that begins in motion, with the time that this matters."""
    return f"{text}: the first {settling_seconds(model):.0f} s with this model"


def attitude_warning(model: Model, kind: str) -> str:
    """Warns of modelled effects that need an attitude the input lacks; empty if none do.

    Args:
        model: the model.
        kind: what drives it: 'accel' tells no attitude, 'imu' and 'pose' do.
    """
    turning = [use.name for use in model.effects if EFFECTS[use.name].needs_rotation]
    if kind != "accel" or not turning:
        return ""
    have, need = ("has", "needs") if len(turning) == 1 else ("have", "need")
    return (
        f"{', '.join(turning)} {have} no effect with the input 'accel', which contains no "
        f"attitude: {need} the input 'pose' or 'imu'"
    )
