"""Rotates single vectors with plain floats, which is faster than NumPy."""

from __future__ import annotations

import math

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


def matrix_from_rpy(roll: float, pitch: float, yaw: float) -> Matrix:
    """Returns Rz(yaw) Ry(pitch) Rx(roll) for REP-103's fixed-axis angles [rad]."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def rotate(matrix: Matrix, v: Vector) -> Vector:
    """Returns the product of a 3 x 3 matrix and a vector as plain floats."""
    a, b, c = matrix
    return (
        a[0] * v[0] + a[1] * v[1] + a[2] * v[2],
        b[0] * v[0] + b[1] * v[1] + b[2] * v[2],
        c[0] * v[0] + c[1] * v[1] + c[2] * v[2],
    )


def cross(a: Vector, b: Vector) -> Vector:
    """Returns the cross product of two 3D vectors as plain floats."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Returns the rotation about z [rad] of a quaternion, in (-π, π] (swing-twist).

    x and y belong to the swing and do not matter.
    """
    return math.atan2(2.0 * w * z, w * w - z * z)
