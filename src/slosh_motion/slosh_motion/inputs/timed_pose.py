"""A pose with a stamp, computed from joints, transforms or trackers."""

from __future__ import annotations

from typing import NamedTuple

from slosh_motion.inputs.mounting import Quaternion
from slosh_motion.inputs.rotation import Vector


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
