"""A library of generic terms for an unknown force on the liquid.

Each is a scalar times a vector, as an acceleration of the first mode's mass: q is its place, q̇ its
velocity, a the container's acceleration in the same axes, t the time since the start, and J turns
by 90° about z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.compiled.compilation import compiled

# label, exponents of the unit in m and s; the place is the code in `_scalar` and `_vector`.
_SCALARS = (
    ("", 0, 0),
    ("‖q‖² ", 2, 0),
    ("‖q̇‖² ", 2, -2),
    ("(q·q̇) ", 2, -1),
    ("a_z ", 1, -2),
    ("t ", 0, 1),
)
_VECTORS = (
    ("q", 1, 0),
    ("q̇", 1, -1),
    ("J q", 1, 0),
    ("J q̇", 1, -1),
    ("a", 1, -2),
    ("q_x x̂", 1, 0),
    ("q_y ŷ", 1, 0),
    ("q̇_x x̂", 1, -1),
    ("q̇_y ŷ", 1, -1),
)
_ALONE = (
    ("x̂", 0, 0),
    ("ŷ", 0, 0),
    ("J a", 1, -2),
    ("q_x³ x̂", 3, 0),
    ("q_y³ ŷ", 3, 0),
    ("q̇_x³ x̂", 3, -3),
    ("q̇_y³ ŷ", 3, -3),
    ("‖q̇‖ q̇", 2, -2),
)


@dataclass(frozen=True, slots=True)
class Term:
    """A candidate for an unknown force in the equation of motion: a scalar times a vector.

    Attributes:
        label: for people.
        metres, seconds: exponents of its unit.
        scalar, vector: codes for `term_value`.
    """

    label: str
    metres: int
    seconds: int
    scalar: int
    vector: int

    @property
    def unit(self) -> str:
        """Unit of the term's coefficient."""
        powers = (("m", 1 - self.metres), ("s", -2 - self.seconds))
        above = [_power(name, power) for name, power in powers if power > 0]
        below = [_power(name, -power) for name, power in powers if power < 0]
        if not below:
            return " ".join(above) or "1"
        divisor = below[0] if len(below) == 1 else f"({' '.join(below)})"
        return f"{' '.join(above) or '1'}/{divisor}"


def _power(name: str, power: int) -> str:
    return name if power == 1 else name + "⁰¹²³⁴⁵⁶⁷⁸⁹"[power]


LIBRARY: tuple[Term, ...] = (
    *(
        Term(s[0] + v[0], s[1] + v[1], s[2] + v[2], scalar, vector)
        for scalar, s in enumerate(_SCALARS)
        for vector, v in enumerate(_VECTORS)
    ),
    *(Term(*entry, 0, len(_VECTORS) + k) for k, entry in enumerate(_ALONE)),
)
"""Every term: products of a scalar and a vector, constants along an axis, cubes."""


@compiled
def _scalar(code, t, q, a):  # type: ignore[no-untyped-def]
    if code == 0:
        return 1.0
    if code == 1:
        return q[0] * q[0] + q[1] * q[1]
    if code == 2:
        return q[2] * q[2] + q[3] * q[3]
    if code == 3:
        return q[0] * q[2] + q[1] * q[3]
    return a[2] if code == 4 else t


@compiled
def _plain(code, q, a):  # type: ignore[no-untyped-def]
    if code == 0:
        return q[0], q[1]
    if code == 1:
        return q[2], q[3]
    if code == 2:
        return -q[1], q[0]
    if code == 3:
        return -q[3], q[2]
    return a[0], a[1]


@compiled
def _one_axis(code, q):  # type: ignore[no-untyped-def]
    if code == 5:
        return q[0], 0.0
    if code == 6:
        return 0.0, q[1]
    return (q[2], 0.0) if code == 7 else (0.0, q[3])


@compiled
def _alone(code, q, a):  # type: ignore[no-untyped-def]
    if code == 9:
        return 1.0, 0.0
    if code == 10:
        return 0.0, 1.0
    if code == 11:
        return -a[1], a[0]
    speed = math.hypot(q[2], q[3])
    return speed * q[2], speed * q[3]


@compiled
def _cube(code, q):  # type: ignore[no-untyped-def]
    if code == 12:
        return q[0] ** 3, 0.0
    if code == 13:
        return 0.0, q[1] ** 3
    return (q[2] ** 3, 0.0) if code == 14 else (0.0, q[3] ** 3)


@compiled
def term_value(scalar, vector, t, q, a):  # type: ignore[no-untyped-def]
    """Returns the x and y component of a generic term of the equation of motion.

    Args:
        scalar, vector: the term's codes.
        t: time since the start [s].
        q: (x, y, vx, vy) [m, m/s].
        a: (ax, ay, az) [m/s²].
    """
    size = _scalar(scalar, t, q, a)
    if vector < 5:
        x, y = _plain(vector, q, a)
    elif vector < 9:
        x, y = _one_axis(vector, q)
    elif 12 <= vector <= 15:
        x, y = _cube(vector, q)
    else:
        x, y = _alone(vector, q, a)
    return size * x, size * y
