"""Finds the nearest rotation of a mounting and describes its axes in words."""

from __future__ import annotations

import itertools
import math

import numpy as np

from slosh_base.types import Array

_NAMES = ("x", "y", "z")


def nearest(matrix: Array, handed: float = 1.0) -> Array:
    """Returns the orthogonal matrix (3, 3) with determinant `handed` nearest to a matrix.

    By singular values (Kabsch 1976).
    """
    left, _, right = np.linalg.svd(matrix)
    sign = handed * np.sign(np.linalg.det(left) * np.linalg.det(right))
    found: Array = left @ np.diag([1.0, 1.0, sign]) @ right
    return found


def rotation_vector(matrix: Array) -> Array:
    """Returns the rotation vector (3,) of a rotation matrix, with an angle in [0, π]."""
    skew = 0.5 * np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    sine, cosine = float(np.linalg.norm(skew)), 0.5 * (float(np.trace(matrix)) - 1.0)
    angle = math.atan2(sine, cosine)
    if sine > 1e-6:
        along: Array = skew * (angle / sine)
        return along
    if cosine > 0.0:
        return np.asarray(skew)
    # Half a turn: the axis is the column of (M + 1) / 2 that is longest.
    axes = 0.5 * (matrix + np.eye(3))
    column = axes[:, int(np.argmax(np.diag(axes)))]
    half: Array = column / np.linalg.norm(column) * math.pi
    return half


def exponential(turn: Array) -> Array:
    """Returns the rotation matrix (3, 3) of a rotation vector (3,) (Rodrigues)."""
    angle = float(np.linalg.norm(turn))
    x, y, z = turn
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine = math.sin(angle) / angle if angle > 1e-12 else 1.0
    half = 2.0 * (math.sin(0.5 * angle) / angle) ** 2 if angle > 1e-12 else 0.5
    found: Array = np.eye(3) + sine * cross + half * cross @ cross
    return found


def axis_rotations() -> list[Array]:
    """Returns the 24 rotation matrices (3, 3) that map coordinate axes to coordinate axes."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            if np.linalg.det(matrix) > 0.0:
                found.append(matrix)
    return found


def snapped(rotation: Array, within: float) -> Array:
    """Returns the nearest of the 24 axis rotations if within an angle [rad], else the input."""
    near = max(axis_rotations(), key=lambda one: float(np.sum(one * rotation)))
    away = float(np.linalg.norm(rotation_vector(near.T @ rotation)))
    return near if away <= within else rotation


def axes_in_words(rotation: Array) -> str:
    """Describes along which axes of the container the axes of the sensor point.

    Args:
        rotation: (3, 3) sensor ← container, each row one of the sensor's axes.
    """
    found = []
    for row in rotation:
        place = int(np.argmax(np.abs(row)))
        found.append(f"{'+' if row[place] > 0.0 else '-'}{_NAMES[place]}")
    return ", ".join(found)


def axis_in_words(direction: Array) -> str:
    """Describes a line's direction by the axis within 25° of it, or else by its components."""
    place = int(np.argmax(np.abs(direction)))
    if abs(direction[place]) > math.cos(math.radians(25.0)) * float(np.linalg.norm(direction)):
        return _NAMES[place]
    told = direction / np.linalg.norm(direction) * math.copysign(1.0, direction[place])
    return "({:.1f}, {:.1f}, {:.1f})".format(*(told + 0.0))


def roll_pitch_yaw(matrix: Array) -> tuple[float, float, float]:
    """Returns the fixed-axis angles roll, pitch, yaw [rad] of Rz(yaw) Ry(pitch) Rx(roll)."""
    sine = -float(matrix[2, 0])
    if abs(sine) > 1.0 - 1e-9:  # upright: roll and yaw turn about one axis
        turn = math.atan2(-float(matrix[0, 1]), float(matrix[1, 1]))
        return 0.0, math.copysign(0.5 * math.pi, sine), _short(turn)
    return (
        _short(math.atan2(float(matrix[2, 1]), float(matrix[2, 2]))),
        math.asin(sine),
        _short(math.atan2(float(matrix[1, 0]), float(matrix[0, 0]))),
    )


def _short(angle: float) -> float:
    """Returns an angle with -π replaced by π."""
    return math.pi if math.isclose(angle, -math.pi, abs_tol=1e-9) else angle
