"""Checks whether a motion is within the models' range of validity."""

from __future__ import annotations

from enum import IntFlag

import numpy as np

from slosh_model.interpolation import columns_at
from slosh_model.least_wave import growth_text
from slosh_model.model import Model
from slosh_model.simulate import Inputs
from slosh_plan.trajectory import Trajectory

JERK_TIME = 0.02
"""The jerk is the change of the acceleration over so long [s]: noise of samples is no jerk."""


class MotionFlag(IntFlag):
    """Limitations of a prediction; the values are those of SloshEstimate.msg."""

    NONE = 0
    PLANARITY_LOST = 1
    ACCELERATION_LIMIT = 2
    JERK_LIMIT = 4
    ABOVE_RIM = 8
    DIVERGED = 64
    LINEAR_ONLY = 1024
    BEYOND_LINEAR = 2048


def validity_words(flags: MotionFlag, growth: float) -> list[str]:
    """Describes where a motion leaves what the models were validated for.

    >>> validity_words(MotionFlag.JERK_LIMIT | MotionFlag.BEYOND_LINEAR, 1.0)
    ['jerk limit', 'beyond linear']

    Args:
        flags: of the motion.
        growth: by which vertical acceleration makes the smallest wave grow; 1: not visibly.
    """
    told = [growth_text(growth)] if growth > 1.0 else []
    return told + [(flag.name or "").lower().replace("_", " ") for flag in flags]


def motion_flags(model: Model, trajectory: Trajectory, peak: float) -> MotionFlag:
    """Returns the validity flags of a motion with a peak height [m]."""
    limits, rim = model.limits, model.container.height_below_rim()
    acceleration, jerk = greatest(trajectory)
    flags = MotionFlag.NONE
    if acceleration > limits.planar_acceleration or jerk > limits.planar_jerk:
        flags |= MotionFlag.PLANARITY_LOST
    if acceleration > limits.acceleration:
        flags |= MotionFlag.ACCELERATION_LIMIT
    if jerk > limits.jerk:
        flags |= MotionFlag.JERK_LIMIT
    if rim is not None and peak > rim:
        flags |= MotionFlag.ABOVE_RIM
    if np.isfinite(model.container.linear_height):
        flags |= MotionFlag.LINEAR_ONLY
        if peak > model.container.linear_height:
            flags |= MotionFlag.BEYOND_LINEAR
    if peak == np.inf:
        flags |= MotionFlag.DIVERGED
    return flags


def greatest(motion: Trajectory | Inputs) -> tuple[float, float]:
    """Returns the greatest acceleration [m/s²] and jerk [m/s³] of a motion."""
    t, acceleration = motion.t, motion.acceleration
    before = columns_at(t - JERK_TIME, t, acceleration)
    jerk = np.linalg.norm(acceleration - before, axis=1) / JERK_TIME
    return float(np.linalg.norm(acceleration, axis=1).max()), float(jerk.max())
