"""A pose with its stamp, as derived from joints, transforms and trackers."""

from __future__ import annotations

from typing import NamedTuple

from slosh_estimator.mounting import Quaternion
from slosh_estimator.rotation import Vector


class TimedPose(NamedTuple):
    """A frame's pose in the world.

    Attributes:
        stamp_ns: the moment [ns].
        position: [m].
        quaternion: x, y, z, w, world ← frame.
    """

    stamp_ns: int
    position: Vector
    quaternion: Quaternion
