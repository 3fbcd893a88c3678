"""Explains a constant acceleration at rest: gravity, wrong unit, mounting or bias.

Of an acceleration without gravity nothing is left at rest. Of a specific force +g along the
container's z axis is left. Of an attitude the direction of up, which is the container's +z.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slosh_model.constants import GRAVITY

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]

FINE = 0.15
"""A constant acceleration below this is a sensor's usual bias, or 0.9° of tilt [m/s²]."""
WRONG_TILT = math.radians(3.0)
"""From where on a sensor's tilt makes the estimate doubtful: 3° is 0.5 m/s² of gravity along the
floor, and 2 mm on the wall of a cup of 40 mm radius."""
TOLD_POSE, WRONG_POSE = math.radians(3.0), math.radians(20.0)
"""The same of a pose: its tilt is known, so less of it is a fault."""
SIZE = 0.08
"""By how much a sensor's gain may be off where gravity is to be recognised."""
RIGHT_SIZE = 0.03
"""By how much gravity's size may be off: 0.3 % of it is latitude, the rest the sensor's gain."""
NEAR_AXIS = math.radians(15.0)
_AXES = ("x", "y", "z")
_UPRIGHT: Vector = (0.0, 0.0, 1.0)


class Doubt(NamedTuple):
    """A suspected fault of an input, such as gravity in the acceleration or a wrong unit.

    Attributes:
        wrong: whether what follows from the input is wrong; else it is only worth a look.
    """

    text: str
    wrong: bool = True


def acceleration_doubt(c: Vector, what: str = "the acceleration at rest") -> Doubt | None:
    """Explains a constant acceleration at rest, or returns None if it is no fault.

    Args:
        c: gravity should be excluded [m/s²].
        what: it is, for the sentence.
    """
    size = math.hypot(*c)
    if size <= FINE:
        return None
    told = f"{what} is {_vector(c)} m/s², not 0"
    force = (c[0], c[1], c[2] + GRAVITY)
    if _near(math.hypot(*force), 1.0, 0.03) or (
        _near(math.hypot(*force), 1.0, SIZE) and not _near(size, GRAVITY, SIZE)
    ):
        return Doubt(
            f"{told}: 9.81 was subtracted from a sensor that reports g: multiply its values by "
            "9.81 first"
        )
    if _near(size, GRAVITY, SIZE):
        return Doubt(f"{told}: {_contained(c)}")
    if _near(size, 1.0, 0.05):
        return Doubt(
            f"{told}: gravity is contained in g, along {direction(c)}"
            f"{_or_tilt(c)}: multiply by 9.81 and subtract gravity"
        )
    tilt, excess = angle(force, _UPRIGHT), abs(math.hypot(*force) - GRAVITY)
    if excess <= 0.5 * size:
        return Doubt(
            f"{told}: the sensor is tilted by {math.degrees(tilt):.1f}° ({_roll_pitch(force)}), "
            "or has a bias of this size: level it, or set sensor_rotation and publish imu",
            tilt >= WRONG_TILT,
        )
    wrong = size >= GRAVITY * math.sin(WRONG_TILT)
    return Doubt(
        f"{told}: a bias, gravity of another size, or another unit: a container at rest has "
        "no acceleration; subtract it, or publish m/s² without gravity",
        wrong,
    )


def force_doubt(f: Vector, rotation: Matrix) -> Doubt | None:
    """Explains a constant specific force at rest, or returns None if it is no fault.

    Args:
        f: in the container's axes; right is +g along z [m/s²].
        rotation: container ← sensor that was used.
    """
    size = math.hypot(*f)
    if size < 0.3:
        return Doubt(
            f"the specific force at rest is {size:.2f} m/s²: gravity is left out; publish it as "
            "REP-145 says (+9.81 m/s² at rest), or use the input accel"
        )
    if _near(size, 1.0, 0.05):
        return Doubt(
            f"the specific force at rest is {size:.3f}: it is in g; publish m/s² (9.81 times as "
            f"much){_mounting(f, rotation, ', and')}"
        )
    told = f"the specific force at rest is {_vector(f)} m/s²"
    off = abs(size / GRAVITY - 1.0)
    if off > SIZE:
        return Doubt(
            f"{told}, of size {size:.3g} for {GRAVITY:g}: another unit, a clipped axis or a "
            "fault; publish m/s² with gravity, as REP-145 says"
        )
    tilt = angle(f, _UPRIGHT)
    if tilt > WRONG_TILT:
        return Doubt(f"{told}{_mounting(f, rotation, ':')}")
    if off > RIGHT_SIZE:
        return Doubt(f"{told}, {100.0 * off:.0f} % off {GRAVITY:g}: calibrate the sensor", False)
    return None


def attitude_doubt(up: Vector, rotation: Matrix, *, first: bool = False) -> Doubt | None:
    """Explains the attitude of a container at rest, or returns None if it is no fault.

    Args:
        up: the world's z axis in the container's axes.
        rotation: container ← tool that was used.
        first: whether the quaternion would be upright if it were w, x, y, z.
    """
    tilt = angle(up, _UPRIGHT)
    if tilt <= TOLD_POSE:
        return None
    order = "; or the quaternion is in the order w, x, y, z: publish x, y, z, w" if first else ""
    where = (
        "points down"
        if tilt > math.radians(160.0)
        else f"is {math.degrees(tilt):.1f}° off the vertical"
    )
    return Doubt(
        f"the container's z axis at rest {where}: the attitude is a tool's, mounted otherwise: "
        "publish the container's own, or set sensor_rotation to "
        f"{_numbers(upright_rotation(up, rotation))}{order}",
        tilt > WRONG_POSE,
    )


def direction(v: Vector) -> str:
    """Describes a vector by its nearest axis and the frame convention that it suggests."""
    place = max(range(3), key=lambda axis: abs(v[axis]))
    sign = "+" if v[place] > 0.0 else "-"
    axis = tuple(math.copysign(float(i == place), v[i]) for i in range(3))
    off = angle(v, (axis[0], axis[1], axis[2]))
    if off > NEAR_AXIS:
        return f"a direction {math.degrees(angle(v, _UPRIGHT)):.0f}° off +z"
    frame = {"-z": " (z down, as in NED)", "-y": " (y down, as in an optical frame)"}
    name = f"{sign}{_AXES[place]}"
    return f"{name}{frame.get(name, '')}"


def angle(a: Vector, b: Vector) -> float:
    """Returns the angle between two vectors [rad]; 0 for a zero vector."""
    cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    return math.atan2(math.hypot(*cross), a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def upright_rotation(up: Vector, rotation: Matrix) -> Vector:
    """Returns roll, pitch, yaw [rad] of the sensor mounting that turns `up` to +z.

    Args:
        up: what should be +z, in the container's axes with the rotation so far.
        rotation: container ← sensor so far.
    """
    turn = _shortest_turn(up)
    m = [[sum(turn[i][k] * rotation[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    pitch = math.atan2(-m[2][0], math.hypot(m[2][1], m[2][2]))
    if math.hypot(m[2][1], m[2][2]) < 1e-9:
        return math.atan2(-m[1][2], m[1][1]), pitch, 0.0
    return math.atan2(m[2][1], m[2][2]), pitch, math.atan2(m[1][0], m[0][0])


def _shortest_turn(up: Vector) -> Matrix:
    """Returns the smallest rotation matrix that turns a direction to +z (Rodrigues)."""
    size = math.hypot(*up)
    x, y, z = up[0] / size, up[1] / size, up[2] / size
    if z < -1.0 + 1e-12:
        return (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)
    k = 1.0 / (1.0 + z)
    return (1.0 - k * x * x, -k * x * y, -x), (-k * x * y, 1.0 - k * y * y, -y), (x, y, z)


def _contained(c: Vector) -> str:
    """Returns the remedy for an acceleration that contains gravity."""
    where = direction(c)
    if where.startswith("+z"):
        return "gravity is contained, along +z: subtract 9.81 from the z axis"
    if where.startswith("-z"):
        return (
            f"gravity is contained, along {where}: turn the axes so that z points up and subtract "
            "gravity; or it was subtracted twice (a sensor in free fall)"
        )
    return (
        f"gravity is contained, along {where}: turn the axes so that z points up, and subtract "
        "gravity"
    )


def _mounting(f: Vector, rotation: Matrix, link: str) -> str:
    """Describes wrong sensor axes and the remedy; empty if they are right."""
    tilt = angle(f, _UPRIGHT)
    if tilt <= WRONG_TILT:
        return ""
    return (
        f"{link} gravity points along {direction(f)}, {math.degrees(tilt):.1f}° off the "
        "container's +z: if the container stands upright, set sensor_rotation to "
        f"{_numbers(upright_rotation(f, rotation))}"
    )


def _or_tilt(c: Vector) -> str:
    """Returns the remark that a constant horizontal acceleration may also come from a tilt."""
    if abs(c[2]) > 0.5 * math.hypot(*c):
        return ""
    return f", or the sensor is tilted by {math.degrees(math.asin(1.0 / GRAVITY)):.1f}°"


def _roll_pitch(f: Vector) -> str:
    roll, pitch = math.atan2(f[1], f[2]), math.atan2(-f[0], math.hypot(f[1], f[2]))
    return f"roll {math.degrees(roll):.1f}°, pitch {math.degrees(pitch):.1f}°"


def _near(value: float, right: float, share: float) -> bool:
    return abs(value - right) <= share * right


def _vector(v: Vector) -> str:
    return "({:.2f}, {:.2f}, {:.2f})".format(*(value + 0.0 for value in v))


def _numbers(v: Vector) -> str:
    return "[{:.4f}, {:.4f}, {:.4f}]".format(*(value + 0.0 for value in v))
