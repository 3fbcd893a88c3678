"""Waypoints of a path, of the container or of joints, as given by the user."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_plan.joints import joint_curve
from slosh_plan.trajectory import PEAK_SPACING, dense

TURNED = 1e-3
"""By which an attitude may differ from the first one [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Waypoints:
    """Waypoints of the container as given by the user.

    Attributes:
        t: (N,) times, a proposal [s].
        position: (N, 3) of the container's origin in the world's axes [m].
        attitude: (4,) quaternion x, y, z, w, world ← container, kept all along; None: not given.
    """

    t: Array
    position: Array
    attitude: Array | None


@dataclass(frozen=True, slots=True, eq=False)
class JointWaypoints:
    """Waypoints of the joints as given by the user.

    Attributes:
        names: (J,) of the joints.
        t: (N,) times, a proposal [s].
        position: (N, J) [rad or m].
        velocity: (N, J) [rad/s or m/s]; None: not given.
        acceleration: (N, J) [rad/s² or m/s²], with velocities only; None: not given.
    """

    names: tuple[str, ...]
    t: Array
    position: Array
    velocity: Array | None = None
    acceleration: Array | None = None

    def points(self, name: str) -> tuple[Array, Array]:
        """Returns times (M,) [s] and points (M, J) of the path as a controller interpolates it.

        Without velocities only the points are known, and the path is smooth between them.

        Args:
            name: for messages.

        Raises:
            SloshPlanError: points that no curve joins.
        """
        given = (self.position, self.velocity, self.acceleration)
        columns = [one for one in given if one is not None]
        if len(columns) == 1:
            return self.t, self.position
        curve, t = joint_curve(self.t, columns, name), dense(self.t, PEAK_SPACING)
        return t, np.asarray(curve(t))
