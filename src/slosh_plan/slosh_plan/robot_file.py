"""Reads the description of a robot (URDF) and its joint limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from slosh_estimator.errors import SloshEstimatorError
from slosh_model.containers import Container
from slosh_motion.inputs.robot import read_urdf
from slosh_plan.errors import SloshPlanError
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import (
    SHARES,
    GivenLimits,
    JointLimits,
    limits_of,
    read_joint_limits,
)
from slosh_plan.planning.joint_path import joint_path
from slosh_plan.planning.path import Path
from slosh_plan.planning.progress import never
from slosh_plan.planning.waypoints import JointWaypoints
from slosh_plan.robot_group import Group, read_group

MOVED = 1e-4
"""By which a joint that is held may move [rad or m]: the noise of its sensor."""


@dataclass(frozen=True, slots=True, eq=False)
class CarryingRobot:
    """A robot that carries the container, with the user's joint limits.

    Attributes:
        arm: the robot.
        given: limits in place of those of the description, and shares of them.
        group: joints that move; None: all that carry the container.
    """

    arm: Arm
    given: GivenLimits = field(default_factory=GivenLimits)
    group: Group | None = None

    @property
    def remarks(self) -> tuple[str, ...]:
        """What of the limits does not count or is not known; empty if nothing."""
        moving = tuple(joint for joint in self.arm.carrying if joint not in self.arm.held)
        return (*self.file_remarks, *self.unlimited(moving))

    @property
    def file_remarks(self) -> tuple[str, ...]:
        """What of the user's limits does not count, or counts as a share; empty if nothing."""
        names = list(self.given.joints)
        strange = [one for one, known in zip(names, self.arm.known(names), strict=True)
                   if not known]  # fmt: skip
        shares = [f"{SHARES[name]} {share:g}" for name, share in self.given.shares.items()]
        found = (
            (strange, "joint limits of {}: no such joint in the URDF"),
            (shares, "{}: plans use this share unless another one is given"),
            (self.given.unused, "not used: {}"),
        )
        return tuple(words.format(", ".join(what)) for what, words in found if what)

    def unlimited(self, joints: Sequence[str]) -> tuple[str, ...]:
        """Returns which of the named joints have no known limit of velocity or acceleration.

        Joints that are not in the robot's description are passed over.
        """
        limits = self.limits(joints)
        free: dict[tuple[str, ...], list[str]] = {}
        for place, (joint, known) in enumerate(zip(joints, self.arm.known(joints), strict=True)):
            kinds = {
                "velocity": limits.velocity[place],
                "acceleration": limits.acceleration[place],
            }
            missing = tuple(name for name, most in kinds.items() if not np.isfinite(most))
            if known and missing:
                free.setdefault(missing, []).append(joint)
        return tuple(
            f"{', '.join(names)}: no limit of the {' and of the '.join(missing)} is known, and "
            "none is kept; the file of joint limits gives it"
            for missing, names in free.items()
        )

    def limits(self, joints: Sequence[str]) -> JointLimits:
        """Returns the position, velocity and other limits of the named joints."""
        return limits_of(self.arm, joints, self.given.joints)

    def path(
        self,
        waypoints: JointWaypoints,
        container: Container,
        name: str,
        stopped: Callable[[], bool] = never,
    ) -> Path:
        """Creates the container's path from joint waypoints.

        Raises:
            SloshPlanError, StoppedError: as `joint_path`.
        """
        self.check_group(waypoints, name)
        times, points = waypoints.points(name)
        # The liquid in a round one does not turn with it.
        return joint_path(
            self.arm, self.limits(waypoints.names), points,
            follows_yaw=container.follows_yaw, name=name, stopped=stopped, times=times,
        )  # fmt: skip

    def check_group(self, waypoints: JointWaypoints, name: str) -> None:
        """Raises SloshPlanError unless exactly the group's joints move the container.

        Others that do not carry it, such as a gripper's, move along.
        """
        if self.group is None:
            return
        missing = [joint for joint in self.group.joints if joint not in waypoints.names]
        if missing:
            raise SloshPlanError(
                f"{name}: joint {missing[0]!r} of the group {self.group.name!r} is missing"
            )
        for place, joint in enumerate(waypoints.names):
            if joint in self.arm.held and np.ptp(waypoints.position[:, place]) > MOVED:
                raise SloshPlanError(
                    f"{name}: joint {joint!r} carries the container and moves, but is not in the "
                    f"group {self.group.name!r}"
                )

    def held(self, joints: Sequence[str]) -> tuple[str, ...]:
        """Returns those carrying joints that are missing in `joints` and so held at 0."""
        return tuple(joint for joint in self.arm.held if joint not in joints)


def read_robot(
    urdf: str | FilePath,
    tool_frame: str,
    joint_limits: str | FilePath = "",
    srdf: str | FilePath = "",
    group: str = "",
) -> CarryingRobot | None:
    """Reads the files of the robot, or returns None if no file is named.

    Args:
        urdf: its description; empty: none.
        tool_frame: link that is the container.
        joint_limits: MoveIt's joint_limits.yaml; empty: none.
        srdf, group: MoveIt's semantic description, and the group of joints in it that move;
            empty: all joints that carry the container move.

    Raises:
        SloshEstimatorError, SloshPlanError, SloshFileError: a file cannot be read.
    """
    if bool(str(srdf)) != bool(group):
        raise SloshEstimatorError("srdf and group must be given together")
    if not str(urdf):
        if group:
            raise SloshEstimatorError(f"group {group!r}: needs the robot: its URDF and tool frame")
        return None
    given = read_joint_limits(FilePath(joint_limits)) if str(joint_limits) else GivenLimits()
    moving = read_group(srdf, group, read_urdf(urdf)) if group else None
    joints = moving.joints if moving else ()
    return CarryingRobot(read_arm(urdf, tool_frame, joints), given, moving)


def read_arm(path: str | FilePath, tool_frame: str, group: Sequence[str] = ()) -> Arm:
    """Reads a robot's kinematics from a URDF file.

    Args:
        path: the file.
        tool_frame: link that is the container.
        group: joints that move; empty: all that carry the container.

    Raises:
        SloshEstimatorError: the file cannot be read, or no link is named.
        SloshPlanError: Pinocchio is missing, no URDF, no such link.
    """
    if not tool_frame:
        raise SloshEstimatorError(
            f"{path}: give the link that holds the container: the tool frame"
        )
    return Arm(read_urdf(path), tool_frame, str(path), group)


def robot_of(parameters: Mapping[str, Any]) -> CarryingRobot | None:
    """Reads the robot from the files that a node's parameters name; None if no file is named.

    Raises:
        SloshEstimatorError, SloshPlanError, SloshFileError: as of `read_robot`.
    """
    names = ("urdf", "tool_frame", "joint_limits", "srdf", "group")
    return read_robot(*(parameters.get(name, "") for name in names))
