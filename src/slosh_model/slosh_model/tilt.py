"""Finds the tilt of a container in a motion, and whether a model includes its effect."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from slosh_base.types import Array
from slosh_model.model import TILT, Model
from slosh_model.pose import integrated

TILT_THRESHOLD = math.radians(0.5)
"""A motion that tilts by more than this [rad] is not answered without gravity's share."""


class Turning(Protocol):
    """Interface of motions that may contain the attitude of the container."""

    @property
    def t(self) -> Array:
        """Times (N,) in increasing order [s]."""

    @property
    def attitude(self) -> Array | None:
        """Attitude (N, 4) as quaternion x, y, z, w, world ← container, or None if unknown."""

    @property
    def angular_velocity(self) -> Array | None:
        """Angular velocity (N, 3) in the container's frame [rad/s], or None if unknown."""


def attitude_of(motion: Turning) -> Array | None:
    """Returns the attitude (N, 4), world ← container, that the models use; None if upright.

    Without a given one its angular velocity is integrated from upright; None: it stays upright.
    """
    rate = motion.angular_velocity
    if motion.attitude is not None or rate is None or not rate[:, :2].any():
        return motion.attitude
    return integrated(motion.t, rate)


def largest_tilt(attitude: Array | None) -> float:
    """Returns the largest angle [rad] between the container's z axis and the vertical.

    Args:
        attitude: (N, 4) quaternion x, y, z, w, world ← container, of any length but zero.
    """
    if attitude is None or len(attitude) == 0:
        return 0.0
    x, y, z, w = np.asarray(attitude, dtype=np.float64).T
    # Of the half angle: exact for small tilts, where a cosine is not.
    return float(np.max(2.0 * np.arctan2(np.hypot(x, y), np.hypot(z, w))))


def ignored_tilt(model: Model, attitude: Array | None) -> float:
    """Returns the largest tilt that a model ignores [rad], or 0 if it ignores none."""
    tilt = 0.0 if model.has(TILT) else largest_tilt(attitude)
    return tilt if tilt > TILT_THRESHOLD else 0.0


def with_tilt(model: Model, attitude: Array | None) -> Model:
    """Returns the model for a motion; adds the effect `gravity_tilt` if the container tilts."""
    return model.with_gravity_tilt() if ignored_tilt(model, attitude) else model


def added_text(model: Model, attitude: Array | None) -> str:
    """Returns a note if the effect `gravity_tilt` was added to the model, else an empty text."""
    tilt = ignored_tilt(model, attitude)
    if not tilt:
        return ""
    return f"tilts by up to {math.degrees(tilt):.1f} deg: the effect {TILT} is added to the model"


def ignored_text(model: Model, attitude: Array | None) -> str:
    """Warns in one line of a tilt that the model ignores; empty if there is none."""
    tilt = ignored_tilt(model, attitude)
    if not tilt:
        return ""
    return (
        f"the container tilts by up to {math.degrees(tilt):.1f} deg, but the model lacks "
        f"{TILT}: gravity along the tilted floor is ignored; add the effect to model.yaml"
    )
