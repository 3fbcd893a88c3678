"""The robot that a governor moves: kinematics, joint limits and initial joint positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from slosh_base.types import Array
from slosh_governor.core import layout
from slosh_governor.tuning import TUNING
from slosh_plan.errors import SloshPlanError
from slosh_plan.joints import Arm, Link
from slosh_plan.planning.joint_limits import JointLimits

NO_JOINTS = np.zeros((0, layout.JOINT))
"""Chain of a motion that is governed by x, y, z."""


@dataclass(frozen=True, slots=True, eq=False)
class GovernedArm:
    """A robot that carries the containers: kinematics, joint limits and initial positions.

    Attributes:
        arm: its kinematics; the link is the container, or the tray.
        limits: of the joints that carry the link, in this order; accelerations and jerks finite.
        start: (J,) their positions before the first step [rad or m].

    Raises:
        SloshPlanError: a start outside of the limits; an acceleration or jerk without a limit.
    """

    arm: Arm
    limits: JointLimits
    start: Array

    def __post_init__(self) -> None:
        limits = self.limits
        if not (np.isfinite(limits.acceleration).all() and np.isfinite(limits.jerk).all()):
            raise SloshPlanError(
                "the governor needs a limit of each joint's acceleration and jerk"
            )
        limits.check_positions(np.asarray(self.start)[np.newaxis], "joint states")

    def __deepcopy__(self, _: dict[int, object]) -> GovernedArm:
        """Returns the object itself, which is immutable and whose kinematics cannot be copied."""
        return self

    def at(self, start: Array) -> GovernedArm:
        """Returns a copy of the robot with other initial joint positions.

        Raises:
            SloshPlanError: it is outside of the limits.
        """
        return replace(self, start=start)

    @property
    def chain(self) -> Array:
        """Joints of the robot as array (J + 1, JOINT), the carried link last; see `layout`."""
        links, end = self.arm.chain()
        table = np.zeros((len(links) + 1, layout.JOINT))
        for row, link in zip(table, links, strict=False):
            _place(row, link)
            row[layout.COLUMN] = self.limits.names.index(link.joint)
        still = Link("", 0.0, 0.0, True, np.zeros(3), end)
        _place(table[-1], still)
        return table

    @property
    def bounds(self) -> Array:
        """Limits (5, J) of each joint: lower, upper, velocity, acceleration, jerk."""
        one = self.limits
        slack = 1e-6  # rounding of who reported the start
        return np.stack(
            [
                np.minimum(one.lower, self.start) - slack,
                np.maximum(one.upper, self.start) + slack,
                one.velocity, one.acceleration, one.jerk,
            ]
        )  # fmt: skip

    def usable(self, target: Sequence[float]) -> bool:
        """Whether joint positions are finite and at most slightly beyond the joint limits."""
        beyond = TUNING.beyond
        place = np.array(target, dtype=np.float64)
        inside = (place >= self.limits.lower - beyond) & (place <= self.limits.upper + beyond)
        return bool(np.isfinite(place).all() and inside.all())


def _place(row: Array, link: Link) -> None:
    """Stores a joint's axis, offset and rotation matrices in a row of the kinematic table."""
    row[layout.SLIDES] = link.slides
    row[layout.TIMES], row[layout.OFFSET] = link.multiplier, link.offset
    rotation, (x, y, z) = link.placement[:9].reshape(3, 3), link.axis
    row[layout.ALONG : layout.ALONG + 3] = rotation @ link.axis
    row[layout.STEP : layout.STEP + 3] = link.placement[9:]
    parts = [rotation, np.zeros((3, 3)), np.zeros((3, 3))]
    if not link.slides:
        along = np.outer(link.axis, link.axis)
        turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        parts = [rotation @ along, rotation @ (np.eye(3) - along), rotation @ turn]
    row[layout.FIXED :] = np.concatenate([part.ravel() for part in parts])


def with_defaults(limits: JointLimits, acceleration: float, jerk: float) -> JointLimits:
    """Returns joint limits in which missing acceleration and jerk limits have default values.

    Args:
        limits: of the description and of MoveIt's joint_limits.yaml.
        acceleration, jerk: of joints without such a limit [rad/s² or m/s², rad/s³ or m/s³].
    """
    return replace(
        limits,
        acceleration=np.where(np.isfinite(limits.acceleration), limits.acceleration, acceleration),
        jerk=np.where(np.isfinite(limits.jerk), limits.jerk, jerk),
    )
