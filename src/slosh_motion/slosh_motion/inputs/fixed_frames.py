"""Derives a sensor's mounting on the container from fixed transforms (/tf_static)."""

from __future__ import annotations

import math
from collections.abc import Iterable

from slosh_motion.inputs.mounting import Quaternion, SensorTransform, composed, rotated
from slosh_motion.inputs.rotation import Vector
from slosh_motion.inputs.transform_poses import Transform

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

        Args:
            frame: in which.
            of: whose pose.

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
