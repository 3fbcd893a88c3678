"""Compiled inverse kinematics of a robot that carries the governed container.

The container's origin moves as it is governed; its orientation stays. Joint velocities are the
smallest that do so, q' = Jᵀ w with J Jᵀ w = x' (Nakamura, Advanced Robotics, 1991, ch. 4),
slightly damped; accelerations are their derivatives, and positions are corrected by one step of
Newton's method at each sample. The limits of the joints are kept by `governor.carried`.
"""

from __future__ import annotations

import math

import numpy as np
from numba.types import float64

from slosh_base.compiled.compilation import (
    CHANGED_1,
    GIVEN_1,
    GIVEN_2,
    compiled,
    compiled_apart,
    entry_point,
)
from slosh_governor.core.chain import cross, rotated, turned_by
from slosh_governor.core.layout import (
    ALONG,
    COLUMN,
    OFFSET,
    ORIGIN,
    PLACE,
    RATE,
    SLIDES,
    STEP,
    TIMES,
    VELOCITY,
)
from slosh_governor.tuning import TUNING

DAMPING = TUNING.damping**2
STRAY = TUNING.stray
LEFT = TUNING.unreached
TWIST = 6
"""Numbers of a velocity and an angular velocity."""


@compiled_apart
def _frames(chain, places, axes, origins):  # type: ignore[no-untyped-def]
    """Writes joint axes and origins; returns the container's rotation and origin (root axes)."""
    r, at = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    for number in range(chain.shape[0]):
        joint = chain[number]
        turn = joint[TIMES] * places[int(joint[COLUMN])] + joint[OFFSET]
        slid = turn * joint[SLIDES]
        axis = rotated(r, joint[ALONG], joint[ALONG + 1], joint[ALONG + 2])
        step = rotated(r, joint[STEP], joint[STEP + 1], joint[STEP + 2])
        at = (
            at[0] + step[0] + slid * axis[0],
            at[1] + step[1] + slid * axis[1],
            at[2] + step[2] + slid * axis[2],
        )
        for k in range(3):
            axes[number, k], origins[number, k] = axis[k], at[k]
        r = turned_by(r, joint, turn)
    return r, at


@compiled_apart
def _jacobian(chain, axes, origins, at, columns):  # type: ignore[no-untyped-def]
    """Computes the Jacobian, one row (velocity, angular velocity) for each joint."""
    columns[:] = 0.0
    for number in range(chain.shape[0]):
        column, factor = columns[int(chain[number, COLUMN])], chain[number, TIMES]
        axis = (factor * axes[number, 0], factor * axes[number, 1], factor * axes[number, 2])
        if chain[number, SLIDES] == 0.0:
            for k in range(3):
                column[3 + k] += axis[k]
            way = (
                at[0] - origins[number, 0], at[1] - origins[number, 1], at[2] - origins[number, 2]
            )  # fmt: skip
            axis = cross(axis, way)
        for k in range(3):
            column[k] += axis[k]


@compiled_apart
def _change(chain, axes, origins, rates, at, velocity, changes):  # type: ignore[no-untyped-def]
    """Writes the time derivative (D, TWIST) of the Jacobian.

    Args:
        chain, axes, origins: of the joints.
        rates: (D,) joint velocities.
        at, velocity: of the container's origin.
        changes: receives it.
    """
    changes[:] = 0.0
    spin, pace, before = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for number in range(chain.shape[0]):
        column, factor = int(chain[number, COLUMN]), chain[number, TIMES]
        axis = (axes[number, 0], axes[number, 1], axes[number, 2])
        here = (origins[number, 0], origins[number, 1], origins[number, 2])
        rate = factor * rates[column]
        carried = cross(spin, (here[0] - before[0], here[1] - before[1], here[2] - before[2]))
        turn = cross(spin, axis)
        slid = rate * chain[number, SLIDES]
        pace = (
            pace[0] + carried[0] + slid * axis[0],
            pace[1] + carried[1] + slid * axis[1],
            pace[2] + carried[2] + slid * axis[2],
        )
        if chain[number, SLIDES] == 0.0:
            one = cross(turn, (at[0] - here[0], at[1] - here[1], at[2] - here[2]))
            other = cross(
                axis, (velocity[0] - pace[0], velocity[1] - pace[1], velocity[2] - pace[2])
            )
            for k in range(3):
                changes[column, k] += factor * (one[k] + other[k])
                changes[column, 3 + k] += factor * turn[k]
            spin = (
                spin[0] + rate * axis[0], spin[1] + rate * axis[1], spin[2] + rate * axis[2]
            )  # fmt: skip
        else:
            for k in range(3):
                changes[column, k] += factor * turn[k]
        before = here


@compiled_apart
def _factorised(columns, lower):  # type: ignore[no-untyped-def]
    """Writes the Cholesky factor of J Jᵀ + DAMPING, with inverted diagonal entries."""
    for i in range(TWIST):
        for j in range(i + 1):
            total = DAMPING if i == j else 0.0
            for k in range(columns.shape[0]):
                total += columns[k, i] * columns[k, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = 1.0 / math.sqrt(total) if i == j else total * lower[j, j]


@compiled_apart
def _solve(lower, vector):  # type: ignore[no-untyped-def]
    """Solves (J Jᵀ + DAMPING) x = vector in place, with the factor from `_factorised`."""
    for i in range(TWIST):
        for k in range(i):
            vector[i] -= lower[i, k] * vector[k]
        vector[i] *= lower[i, i]
    for i in range(TWIST - 1, -1, -1):
        for k in range(i + 1, TWIST):
            vector[i] -= lower[k, i] * vector[k]
        vector[i] *= lower[i, i]


@compiled
def _product(row, vector):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(TWIST):
        total += row[k] * vector[k]
    return total


@compiled
def _missed(goal, r, at, place, vector):  # type: ignore[no-untyped-def]
    """Writes the container's pose error; returns its largest component [m or rad].

    Args:
        goal: (12,) rotation by rows that it keeps, and its origin before the first step.
        r, at: its pose.
        place: (3,) of its origin since then [m].
        vector: (TWIST,) receives it.
    """
    vector[3:] = 0.0
    for k in range(3):
        vector[k] = goal[ORIGIN + k] + place[k] - at[k]
        one = (r[k], r[3 + k], r[6 + k])
        turn = cross(one, (goal[k], goal[3 + k], goal[6 + k]))
        for n in range(3):
            vector[3 + n] += 0.5 * turn[n]
    most = 0.0
    for k in range(TWIST):
        most = max(most, abs(vector[k]))
    return most


@compiled
def scratch(chain, size):  # type: ignore[no-untyped-def]
    """Returns work arrays for `carry`, sized for a kinematic chain and its number of joints."""
    return (
        np.empty((chain.shape[0], 3)), np.empty((chain.shape[0], 3)), np.empty((size, TWIST)),
        np.empty((size, TWIST)), np.empty((TWIST, TWIST)), np.empty(TWIST),
    )  # fmt: skip


@compiled_apart
def carry(chain, goal, motion, interval, joints, space):  # type: ignore[no-untyped-def]
    """Advances the joints by an interval so that the container follows its governed motion.

    Args:
        chain: see `chain.felt_at`.
        goal: see `_missed`.
        motion: (3, 3) of the container's origin at the end of the interval.
        interval: [s].
        joints: (3, D) their velocities, accelerations and positions; changed.
        space: of `scratch`.

    Returns:
        whether they reach it.
    """
    axes, origins, columns, changes, lower, vector = space
    size = joints.shape[1]
    for k in range(size):
        joints[PLACE, k] += interval * (joints[VELOCITY, k] + 0.5 * interval * joints[RATE, k])
    r, at = _frames(chain, joints[PLACE], axes, origins)
    reached = _missed(goal, r, at, motion[PLACE], vector) <= STRAY
    _jacobian(chain, axes, origins, at, columns)
    _factorised(columns, lower)
    _solve(lower, vector)
    for k in range(size):
        joints[PLACE, k] += _product(columns[k], vector)
    speed = weight = 0.0
    for k in range(3):
        vector[k], vector[3 + k] = motion[VELOCITY, k], 0.0
        speed += motion[VELOCITY, k] ** 2
    _solve(lower, vector)
    for k in range(size):
        joints[VELOCITY, k] = _product(columns[k], vector)
    for k in range(TWIST):
        weight += vector[k] ** 2
    reached = reached and DAMPING * DAMPING * weight <= LEFT * LEFT * speed
    velocity = (motion[VELOCITY, 0], motion[VELOCITY, 1], motion[VELOCITY, 2])
    _change(chain, axes, origins, joints[VELOCITY], at, velocity, changes)
    # q'' = Jᵀ w' + J'ᵀ w, with J q'' = x'' - J' q'.
    for k in range(size):
        joints[RATE, k] = _product(changes[k], vector)
    for k in range(TWIST):
        vector[k] = motion[RATE, k] if k < 3 else 0.0
        for n in range(size):
            vector[k] -= changes[n, k] * joints[VELOCITY, n] + columns[n, k] * joints[RATE, n]
    _solve(lower, vector)
    for k in range(size):
        joints[RATE, k] += _product(columns[k], vector)
    return reached


@compiled_apart
def effort(chain, places, fastest, space):  # type: ignore[no-untyped-def]
    """Returns the largest use of a joint velocity limit per container speed [s/m], and the joint.

    In s/m. Directions in which no joint can move the container at all take nothing.

    Args:
        chain, space: see `carry`.
        places: (D,) joint positions.
        fastest: (D,) velocity limits.
    """
    axes, origins, columns, _, lower, vector = space
    _, at = _frames(chain, places, axes, origins)
    _jacobian(chain, axes, origins, at, columns)
    _factorised(columns, lower)
    most, joint = 0.0, 0
    for axis in range(3):
        vector[:] = 0.0
        vector[axis] = 1.0
        _solve(lower, vector)
        for k in range(places.shape[0]):
            part = abs(_product(columns[k], vector)) / fastest[k]
            if part > most:
                most, joint = part, k
    return most, joint


@entry_point(float64(GIVEN_2, GIVEN_1, GIVEN_1, CHANGED_1))
def pose(chain, places, fastest, goal):  # type: ignore[no-untyped-def]
    """Writes the container's rotation and origin (12,); returns the joints' `effort` there.

    Args:
        chain: see `carry`.
        places, fastest: (D,) positions and velocity limits of the joints.
        goal: receives them.
    """
    r, at = _frames(chain, places, np.empty((chain.shape[0], 3)), np.empty((chain.shape[0], 3)))
    for k in range(ORIGIN):
        goal[k] = r[k]
    for k in range(3):
        goal[ORIGIN + k] = at[k]
    return effort(chain, places, fastest, scratch(chain, places.shape[0]))[0]
