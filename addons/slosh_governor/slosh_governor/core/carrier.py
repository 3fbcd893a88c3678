"""Joints of a robot that carries the governed container, as arrays for compiled code."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.types import Array
from slosh_governor.core import carried, inverse, layout
from slosh_governor.core.robot_arm import NO_JOINTS, GovernedArm
from slosh_governor.tuning import TUNING
from slosh_plan.errors import SloshPlanError

NAMED = {
    carried.BY_POSITION: "position", carried.BY_VELOCITY: "velocity",
    carried.BY_ACCELERATION: "acceleration", carried.BY_JERK: "jerk",
    carried.BY_REACH: "reach or singularity",
}  # fmt: skip
ROUNDING = 1e-6
"""By which computed positions may differ from those that were given [rad or m]."""


class Carrier:
    """State of the joints that carry the container, and the joint limit met last.

    Args:
        arm: the robot, at the start; None: its joints are not known.

    Attributes:
        arm: as given.
        joints: (3, J) present velocities, accelerations and positions [rad or m, per second, …].
        arrays: links, limits, pose to keep, `joints`, and the refusal, of `carried.joints_keep`.

    Raises:
        SloshPlanError: the container is tilted at the start.
    """

    def __init__(self, arm: GovernedArm | None) -> None:
        self.arm = arm
        size = 0 if arm is None else len(arm.start)
        self._links = NO_JOINTS if arm is None else arm.chain
        self._ranges, self._goal = np.zeros((5, size)), np.zeros(layout.ORIGIN + 3)
        self.joints, self._refused = np.zeros((3, size)), np.zeros(layout.REFUSED)
        self.arrays = (self._links, self._ranges, self._goal, self.joints, self._refused)
        if arm is not None:
            doubt = self._doubt_at_rest(arm.start)
            if doubt:
                raise SloshPlanError(doubt)
            self.start_at(arm.start, np.zeros(3))

    def start_at(self, places: Array, origin: Array) -> None:
        """Sets the joints to measured positions at rest, and holds the container's pose there.

        Args:
            places: (J,) [rad or m]; without a `doubt`.
            origin: (3,) of the container by its governor [m].
        """
        assert self.arm is not None
        self._ranges[:] = _ranges(self.arm.at(places))
        self.joints[:] = 0.0
        self.joints[layout.PLACE] = places
        fastest = self._ranges[layout.FASTEST]
        effort = inverse.pose(self._links, self.joints[layout.PLACE], fastest, self._goal)
        # Who starts near a singular position may stop as near to one.
        self._refused[layout.HEAVIEST] = max(effort, 1.0 / TUNING.slowest)
        self._goal[layout.ORIGIN :] -= origin

    def way_to(self, places: Array) -> float:
        """Returns the way [m] of the container's origin from the present to joint positions."""
        ends = []
        for own in (self.joints[layout.PLACE], places):
            pose = np.zeros(layout.ORIGIN + 3)
            inverse.pose(self._links, own.copy(), self._ranges[layout.FASTEST], pose)
            ends.append(pose[layout.ORIGIN :])
        return float(np.linalg.norm(ends[1] - ends[0]))

    def differs(self, places: Array) -> bool:
        """Whether measured joint positions differ from the computed ones beyond a tolerance."""
        apart = np.abs(places - self.joints[layout.PLACE])
        return bool(apart.max() > TUNING.measured)

    def doubt(self, places: Array, *, rests: bool) -> str:
        """Returns why measured joint positions forbid further motion; empty if they do not.

        Args:
            places: (J,) [rad or m].
            rests: whether the container is at rest: then it may have been moved.
        """
        assert self.arm is not None
        if rests:
            return self._doubt_at_rest(places)
        apart = np.abs(places - self.joints[layout.PLACE])
        joint = int(apart.argmax())
        if apart[joint] <= TUNING.strayed:
            return ""
        return (
            f"joint {self.arm.limits.names[joint]!r} is at {places[joint]:.4g}, but was to be at "
            f"{self.joints[layout.PLACE, joint]:.4g}"
        )

    def _doubt_at_rest(self, places: Array) -> str:
        assert self.arm is not None
        try:
            self.arm.at(places)
        except SloshPlanError as error:
            return str(error)
        pose = np.zeros(layout.ORIGIN + 3)
        own = np.array(places, dtype=np.float64)
        inverse.pose(self._links, own, self._ranges[layout.FASTEST], pose)
        tilt = math.acos(min(float(pose[layout.ORIGIN - 1]), 1.0))
        return (
            f"the robot holds the container tilted by {math.degrees(tilt):.1f}°: commands of "
            "velocities and poses need it upright; turn it, or command the joints"
        ) * (tilt > TUNING.upright)

    def refused_by(self, share: float) -> str:
        """Returns the joint and limit that reduced the command in this step; empty for none.

        Args:
            share: of the command that was followed in the step.
        """
        limit = int(self._refused[layout.REFUSED_LIMIT])
        if self.arm is None or not limit or (share == 1.0 and not self._refused[layout.EASED]):
            return ""
        joint = int(self._refused[layout.REFUSED_JOINT])
        return f"{self.arm.limits.names[joint]}: {NAMED[limit]}"


def _ranges(arm: GovernedArm) -> Array:
    """Returns the joints' limits (5, J), reduced by a margin for peaks between two samples."""
    found, room = arm.bounds, TUNING.carried_place
    found[layout.LOWER] = np.minimum(found[layout.LOWER] + room, arm.start - ROUNDING)
    found[layout.UPPER] = np.maximum(found[layout.UPPER] - room, arm.start + ROUNDING)
    found[layout.FASTEST] *= 1.0 - TUNING.carried
    found[layout.HARDEST :] *= 1.0 - TUNING.carried_change
    return found
