"""Frames: rotations of vectors, poses, mountings, and frames that stand still in each other."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_motion.errors import SloshMotionError

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


class TimedPose(NamedTuple):
    """Position and attitude of a frame in the world at a stamp.

    Attributes:
        stamp_ns: the moment [ns].
        position: [m].
        quaternion: x, y, z, w, world ← frame.
    """

    stamp_ns: int
    position: Vector
    quaternion: Quaternion


Quaternion = tuple[float, float, float, float]


class Base(NamedTuple):
    """A frame with a constant pose in the world.

    Attributes:
        pose: position [m] and quaternion x, y, z, w in the world.
    """

    frame: str
    pose: tuple[Vector, Quaternion]


@dataclass(frozen=True, slots=True)
class SensorTransform:
    """Position [m] and orientation of a sensor, or another frame, on the container.

    Attributes:
        roll, pitch, yaw: rotation container ← sensor, fixed axes [rad].
        to_origin: from the sensor to the container's origin, in the container's axes [m].

    Raises:
        SloshMotionError: a value is not finite.
    """

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    to_origin: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.roll, self.pitch, self.yaw, *self.to_origin))):
            raise SloshMotionError(f"sensor transform {self} must be finite")

    @property
    def matrix(self) -> Matrix:
        """Rotation matrix from sensor axes to container axes."""
        return matrix_from_rpy(self.roll, self.pitch, self.yaw)

    @property
    def turns(self) -> bool:
        """Whether the sensor's axes differ from the container's."""
        return (self.roll, self.pitch, self.yaw) != (0.0, 0.0, 0.0)


class ToolPose:
    """Converts poses of a tool to poses of the container that it carries."""

    def __init__(self, transform: SensorTransform) -> None:
        self._is_container = not transform.turns and not any(transform.to_origin)
        self._turn = sensor_from_container(transform)
        self._to_origin = transform.to_origin

    def container(self, position: Vector, quaternion: Quaternion) -> tuple[Vector, Quaternion]:
        """Returns position [m] and attitude (x, y, z, w) of the container.

        Args:
            position: of the tool in the world [m].
            quaternion: x, y, z, w, world ← tool, of any length but zero.
        """
        if self._is_container:
            return position, quaternion
        x, y, z, w = quaternion
        bx, by, bz, bw = self._turn
        x, y, z, w = (
            w * bx + x * bw + y * bz - z * by,
            w * by - x * bz + y * bw + z * bx,
            w * bz + x * by - y * bx + z * bw,
            w * bw - x * bx - y * by - z * bz,
        )
        rx, ry, rz = self._to_origin
        scale = 2.0 / (x * x + y * y + z * z + w * w)
        tx, ty, tz = y * rz - z * ry, z * rx - x * rz, x * ry - y * rx
        return (
            position[0] + rx + scale * (w * tx + y * tz - z * ty),
            position[1] + ry + scale * (w * ty + z * tx - x * tz),
            position[2] + rz + scale * (w * tz + x * ty - y * tx),
        ), (x, y, z, w)


def composed(
    outer: tuple[Vector, Quaternion], inner: tuple[Vector, Quaternion]
) -> tuple[Vector, Quaternion]:
    """Composes two poses; `inner` is relative to the frame whose pose is `outer`.

    Args:
        outer, inner: position [m] and quaternion x, y, z, w, of any length but zero.
    """
    (x, y, z, w), (bx, by, bz, bw), (rx, ry, rz) = outer[1], inner[1], inner[0]
    size = x * x + y * y + z * z + w * w
    scale = 2.0 / size if size else 0.0
    tx, ty, tz = y * rz - z * ry, z * rx - x * rz, x * ry - y * rx
    return (
        outer[0][0] + rx + scale * (w * tx + y * tz - z * ty),
        outer[0][1] + ry + scale * (w * ty + z * tx - x * tz),
        outer[0][2] + rz + scale * (w * tz + x * ty - y * tx),
    ), (
        w * bx + x * bw + y * bz - z * by,
        w * by - x * bz + y * bw + z * bx,
        w * bz + x * by - y * bx + z * bw,
        w * bw - x * bx - y * by - z * bz,
    )


def rotated(quaternion: Quaternion, vector: Vector) -> Vector:
    """Rotates a vector by a quaternion.

    Args:
        quaternion: x, y, z, w, of any length but zero.
    """
    nowhere: Vector = (0.0, 0.0, 0.0)
    return composed((nowhere, quaternion), (vector, (0.0, 0.0, 0.0, 1.0)))[0]


def sensor_from_container(transform: SensorTransform) -> Quaternion:
    """Returns the quaternion (x, y, z, w) that rotates container axes to sensor axes."""
    cr, sr = math.cos(0.5 * transform.roll), math.sin(0.5 * transform.roll)
    cp, sp = math.cos(0.5 * transform.pitch), math.sin(0.5 * transform.pitch)
    cy, sy = math.cos(0.5 * transform.yaw), math.sin(0.5 * transform.yaw)
    return (
        -(sr * cp * cy - cr * sp * sy),
        -(cr * sp * cy + sr * cp * sy),
        -(cr * cp * sy - sr * sp * cy),
        cr * cp * cy + sr * sp * sy,
    )


def stamp_of(message: Any) -> int:
    """Returns the stamp in the header of a message of any reader [ns]."""
    stamp = message.header.stamp
    return int(stamp.sec) * SECOND + int(stamp.nanosec)


class Transform(NamedTuple):
    """Transform from a child frame to its parent frame at a stamp.

    Attributes:
        stamp_ns: the moment [ns].
        position: of the child's origin in the parent [m].
        quaternion: x, y, z, w.
    """

    parent: str
    child: str
    stamp_ns: int
    position: Vector
    quaternion: Quaternion

    @classmethod
    def of_message(cls, message: Any) -> Transform:
        """Returns the transform that a TransformStamped message of any reader holds."""
        place, turn = message.transform.translation, message.transform.rotation
        return cls(
            message.header.frame_id, message.child_frame_id, stamp_of(message),
            (place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w),
        )  # fmt: skip


Pose = tuple[Vector, Quaternion]
_HERE: Pose = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


class FixedFrames:
    """Frames whose poses relative to each other are constant."""

    def __init__(self) -> None:
        self._parents: dict[str, Transform] = {}

    def take(self, transforms: Iterable[Transform]) -> None:
        """Adds fixed transforms to those already stored."""
        for one in transforms:
            self._parents[one.child.lstrip("/")] = one

    @property
    def links(self) -> list[Transform]:
        """Returns all fixed transforms that were added."""
        return list(self._parents.values())

    def pose(self, frame: str, of: str) -> Pose | None:
        """Returns the pose of one frame relative to another, or None if they are not connected.

        Returns:
            position [m] and quaternion x, y, z, w, of length 1; None: nothing fixed connects them.
        """
        own, other = self._to_root(of.lstrip("/")), self._to_root(frame.lstrip("/"))
        if own[0] != other[0]:
            return None
        position, quaternion = composed(_inverse(other[1]), own[1])
        length = math.hypot(*quaternion)
        x, y, z, w = (part / length for part in quaternion)
        return position, (x, y, z, w)

    def mounting(self, container: str, sensor: str) -> SensorTransform | None:
        """Returns the sensor's pose on the container; None if no transforms connect the two."""
        found = self.pose(container, sensor)
        if found is None:
            return None
        (x, y, z), turn = found
        return SensorTransform(*_rpy(turn), (-x, -y, -z))

    def _to_root(self, frame: str) -> tuple[str, Pose]:
        """Returns the root frame of a frame's tree, and the frame's pose in the root frame."""
        pose, seen = _HERE, {frame}
        while frame in self._parents:
            link = self._parents[frame]
            frame = link.parent.lstrip("/")
            if frame in seen or not any(link.quaternion):
                break
            seen.add(frame)
            pose = composed((link.position, link.quaternion), pose)
        return frame, pose


def _inverse(pose: Pose) -> Pose:
    x, y, z, w = pose[1]
    turn = (-x, -y, -z, w)
    px, py, pz = rotated(turn, pose[0])
    return (-px, -py, -pz), turn


def _rpy(quaternion: Quaternion) -> Vector:
    """Converts a unit quaternion to roll, pitch and yaw about fixed axes [rad]."""
    x, y, z, w = quaternion
    sine = 2.0 * (w * y - z * x)
    if abs(sine) > 1.0 - 1e-12:  # upright: roll and yaw turn about one axis
        return (
            0.0,
            math.copysign(0.5 * math.pi, sine),
            -math.copysign(2.0, sine) * math.atan2(x, w),
        )
    return (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(sine),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )
