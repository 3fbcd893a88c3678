"""Compiled forward kinematics: acceleration of containers on a robot's last link (governor).

Of a chain of joints without branches; velocities and accelerations go from link to link (Siciliano
et al., Robotics, 2009, ch. 7.2). Vectors and rotations (by rows) are tuples, which stay in the
processor's registers.
"""

from __future__ import annotations

import math

import numpy as np
from numba.types import void

from slosh_base.compiled.compilation import CHANGED_2, GIVEN_2, compiled, entry_point
from slosh_governor.core.layout import (
    ALONG,
    COLUMN,
    COSINE,
    FIXED,
    OFFSET,
    PLACE,
    RATE,
    SINE,
    SLIDES,
    STEP,
    TIMES,
    TURNS,
    VELOCITY,
)
from slosh_model.constants import GRAVITY

UPSIDE = 1e-6
"""Least 1 + cosine of a tilt."""


@compiled
def rotated(r, x, y, z):  # type: ignore[no-untyped-def]
    """Rotates a vector (x, y, z) by the rotation matrix `r`, given by rows."""
    return (
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
    )


@compiled
def cross(a, b):  # type: ignore[no-untyped-def]
    """Returns the cross product of two vectors."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def _carried(force, spin, change, r):  # type: ignore[no-untyped-def]
    """Returns the acceleration [m/s²] of a rigid link's point at offset r from a reference point.

    Args:
        force: the known one [m/s²].
        spin, change: angular velocity and its derivative [rad/s, rad/s²].
        r: [m].
    """
    turned = cross(change, r)
    along = spin[0] * r[0] + spin[1] * r[1] + spin[2] * r[2]
    square = spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]
    return (
        force[0] + turned[0] + spin[0] * along - r[0] * square,
        force[1] + turned[1] + spin[1] * along - r[1] * square,
        force[2] + turned[2] + spin[2] * along - r[2] * square,
    )


@compiled
def _column(joint, s, c, k):  # type: ignore[no-untyped-def]
    """Returns column k of a joint's rotation matrix, from sine `s` and cosine `c` of its angle."""
    a, b, d = FIXED + k, COSINE + k, SINE + k
    return (
        joint[a] + c * joint[b] + s * joint[d],
        joint[a + 3] + c * joint[b + 3] + s * joint[d + 3],
        joint[a + 6] + c * joint[b + 6] + s * joint[d + 6],
    )


@compiled
def turned_by(r, joint, angle):  # type: ignore[no-untyped-def]
    """Returns the rotation (by rows) of the link behind a joint, given that of the link before."""
    s, c = math.sin(angle), math.cos(angle)
    x0, x1, x2 = _column(joint, s, c, 0)
    y0, y1, y2 = _column(joint, s, c, 1)
    z0, z1, z2 = _column(joint, s, c, 2)
    x, y, z = rotated(r, x0, x1, x2), rotated(r, y0, y1, y2), rotated(r, z0, z1, z2)
    return x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]


@compiled
def _felt(r, force, point, felt):  # type: ignore[no-untyped-def]
    """Stores the acceleration of an upright container whose liquid would move equally [m/s²]."""
    fx, fy, fz = force[0], force[1], force[2] + GRAVITY
    if point[TURNS] != 0.0:
        felt[0] = r[0] * fx + r[3] * fy + r[6] * fz
        felt[1] = r[1] * fx + r[4] * fy + r[7] * fz
        felt[2] = r[2] * fx + r[5] * fy + r[8] * fz - GRAVITY
    else:
        # A liquid in a round wall does not turn with it: the tilt alone, by the shortest way.
        ux, uy, uz = r[2], r[5], r[8]
        part = (ux * fx + uy * fy) / max(1.0 + uz, UPSIDE)
        felt[0], felt[1] = fx - ux * (part + fz), fy - uy * (part + fz)
        felt[2] = ux * fx + uy * fy + uz * fz - GRAVITY


@compiled
def _joint_step(r, joint, motion):  # type: ignore[no-untyped-def]
    """Returns a joint's axis and offset [m] in the root's axes, its position and its rate."""
    column, factor = int(joint[COLUMN]), joint[TIMES]
    at, rate = factor * motion[PLACE, column] + joint[OFFSET], factor * motion[VELOCITY, column]
    axis = rotated(r, joint[ALONG], joint[ALONG + 1], joint[ALONG + 2])
    step = rotated(r, joint[STEP], joint[STEP + 1], joint[STEP + 2])
    slid = at * joint[SLIDES]
    step = (step[0] + slid * axis[0], step[1] + slid * axis[1], step[2] + slid * axis[2])
    return axis, step, at, rate


@compiled
def felt_at(joints, points, motion, felt, moved):  # type: ignore[no-untyped-def]
    """Computes accelerations of points on a robot's last link from its joint motion [m/s²].

    Args:
        joints: (J + 1, JOINT) from the root on; the last is the moving link, fixed to the joint
            before it.
        points: (P, 4) of the containers in that link's frame.
        motion: (3, D) rates, accelerations and positions of the coordinates.
        felt: (P, 3) receives accelerations in axes that tilt with the container [m/s²].
        moved: (3,) receives the acceleration of the frame's origin in the world [m/s²].
    """
    r = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    spin, change, force = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for number in range(joints.shape[0]):
        joint = joints[number]
        axis, step, at, v = _joint_step(r, joint, motion)
        a = joint[TIMES] * motion[RATE, int(joint[COLUMN])]
        force = _carried(force, spin, change, step)
        across = cross(spin, axis)
        if joint[SLIDES] != 0.0:
            force = (
                force[0] + 2.0 * v * across[0] + a * axis[0],
                force[1] + 2.0 * v * across[1] + a * axis[1],
                force[2] + 2.0 * v * across[2] + a * axis[2],
            )
        else:
            change = (
                change[0] + v * across[0] + a * axis[0],
                change[1] + v * across[1] + a * axis[1],
                change[2] + v * across[2] + a * axis[2],
            )
            spin = (spin[0] + v * axis[0], spin[1] + v * axis[1], spin[2] + v * axis[2])
        r = turned_by(r, joint, at)
    for k in range(3):
        moved[k] = force[k]
    for number in range(points.shape[0]):
        point = points[number]
        there = rotated(r, point[0], point[1], point[2])
        _felt(r, _carried(force, spin, change, there), point, felt[number])


@entry_point(void(GIVEN_2, GIVEN_2, CHANGED_2))
def tip(joints, motion, found):  # type: ignore[no-untyped-def]
    """Computes velocity, acceleration and position of a robot's last link from its joint motion.

    Args:
        joints, motion: see `felt_at`.
        found: (3, 3) receives them by rows, in the axes of the robot's root [m/s, m/s², m].
    """
    felt_at(joints, np.empty((0, 4)), motion, np.empty((0, 3)), found[RATE])
    r, spin = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    found[VELOCITY], found[PLACE] = 0.0, 0.0
    for number in range(joints.shape[0]):
        joint = joints[number]
        axis, step, at, rate = _joint_step(r, joint, motion)
        slides = joint[SLIDES]
        carried = cross(spin, step)
        for k in range(3):
            found[VELOCITY, k] += carried[k] + slides * rate * axis[k]
            found[PLACE, k] += step[k]
        rate *= 1.0 - slides
        spin = (spin[0] + rate * axis[0], spin[1] + rate * axis[1], spin[2] + rate * axis[2])
        r = turned_by(r, joint, at)
