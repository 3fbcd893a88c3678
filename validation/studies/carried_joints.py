"""Computes the joints of an arm that carries a cup along a governed motion, with Pinocchio."""

from __future__ import annotations

import importlib
import math
from typing import Any, NamedTuple

import numpy as np
from six_axes import CUP, urdf_of

from slosh_base.types import Array
from slosh_governor.core import GovernedArm

pinocchio: Any = importlib.import_module("pinocchio")
PARTS = 4
"""Moments of a step that are looked at."""
EXACT, TRIED = 1e-10, 12
"""Error of a pose [m or rad] that is none, after at most so many iterations."""
SINGULAR = 1e-7
"""Part of the largest singular value below which one counts as 0."""


class Joints(NamedTuple):
    """Positions, velocities and accelerations (N, J) of the arm's joints."""

    place: Array
    velocity: Array
    acceleration: Array


def joints_of(
    arm: GovernedArm, velocity: Array, acceleration: Array, place: Array, period: float
) -> Joints | None:
    """Returns the joints at PARTS times of each step; None if the motion is out of reach.

    Args:
        arm: at the start, with the cup upright; of `six_axes.py`.
        velocity, acceleration, place: (N, 3) of the cup; accelerations are linear in a step.
        period: of a step [s].
    """
    model = pinocchio.buildModelFromXML(urdf_of(arm.start))
    data, frame, world = model.createData(), model.getFrameId(CUP), pinocchio.LOCAL_WORLD_ALIGNED
    q = np.array(arm.start)
    pinocchio.framesForwardKinematics(model, data, q)
    begin = data.oMf[frame].copy()
    found: list[tuple[Array, Array, Array]] = []
    for step in range(len(place) - 1):
        change = acceleration[step + 1] - acceleration[step]
        for part in range(PARTS):
            u = part / PARTS
            s = u * period
            a = acceleration[step] + u * change
            v = velocity[step] + s * (acceleration[step] + 0.5 * u * change)
            x = place[step] + s * velocity[step]
            x = x + s * s * (0.5 * acceleration[step] + u * change / 6.0)
            for _ in range(TRIED):
                jacobian = pinocchio.computeFrameJacobian(model, data, q, frame, world)
                pose = pinocchio.updateFramePlacement(model, data, frame)
                turn = pinocchio.log3(begin.rotation @ pose.rotation.T)
                missed = np.concatenate([begin.translation + x - pose.translation, turn])
                if np.abs(missed).max() < EXACT:
                    break
                q = q + _solved(jacobian, missed)
            else:
                return None
            rate = _solved(jacobian, np.concatenate([v, np.zeros(3)]))
            pinocchio.forwardKinematics(model, data, q, rate, np.zeros(len(q)))
            drift = pinocchio.getFrameClassicalAcceleration(model, data, frame, world).vector
            push = _solved(jacobian, np.concatenate([a, np.zeros(3)]) - drift)
            found.append((q, rate, push))
    return Joints(*(np.array(column) for column in zip(*found, strict=True)))


def _solved(jacobian: Array, vector: Array) -> Array:
    solved: Array = np.linalg.lstsq(jacobian, vector, rcond=SINGULAR)[0].astype(float)
    return solved


def carried_use(
    arm: GovernedArm, velocity: Array, acceleration: Array, place: Array, period: float
) -> float:
    """Returns the largest fraction of a joint limit: position, velocity, acceleration or jerk.

    Infinite where the joints do not reach the cup; arguments as of `joints_of`.
    """
    joints, limits = joints_of(arm, velocity, acceleration, place, period), arm.limits
    if joints is None:
        return math.inf
    middle, half = 0.5 * (limits.upper + limits.lower), 0.5 * (limits.upper - limits.lower)
    jerk = np.diff(joints.acceleration[::PARTS], axis=0) / period
    parts = (
        (joints.place - middle) / half, joints.velocity / limits.velocity,
        joints.acceleration / limits.acceleration, jerk / limits.jerk,
    )  # fmt: skip
    return max(float(np.abs(part).max()) for part in parts)
