"""Mounting of a sensor or a tool on the container."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from slosh_motion.errors import SloshMotionError
from slosh_motion.inputs.rotation import Matrix, Vector, matrix_from_rpy

Quaternion = tuple[float, float, float, float]


class Base(NamedTuple):
    """A frame with a constant pose in the world.

    Attributes:
        frame: its name.
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
    """Converts poses of a tool to poses of the container that it carries.

    Args:
        transform: of the tool's frame.
    """

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
        vector: in the axes that stand so.
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
