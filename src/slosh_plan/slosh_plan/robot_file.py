"""Reads the description of a robot (URDF) and its joint limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.robot import read_urdf
from slosh_model.containers import Container
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import JointLimits, limits_of, read_joint_limits
from slosh_plan.planning.joint_path import joint_path
from slosh_plan.planning.path import Path
from slosh_plan.planning.progress import never
from slosh_plan.planning.waypoints import JointWaypoints


@dataclass(frozen=True, slots=True, eq=False)
class CarryingRobot:
    """A robot that carries the container, with the user's joint limits.

    Attributes:
        arm: the robot.
        given: limits by joint and name, in place of those of the description.
    """

    arm: Arm
    given: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def limits(self, joints: Sequence[str]) -> JointLimits:
        """Returns the limits of the named joints."""
        return limits_of(self.arm, joints, self.given)

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
        # The liquid in a round one does not turn with it.
        return joint_path(
            self.arm, self.limits(waypoints.names), waypoints.points(name),
            follows_yaw=container.follows_yaw, name=name, stopped=stopped,
        )  # fmt: skip


def read_robot(
    urdf: str | FilePath, tool_frame: str, joint_limits: str | FilePath = ""
) -> CarryingRobot | None:
    """Reads the files of the robot, or returns None if no file is named.

    Args:
        urdf: its description; empty: none.
        tool_frame: link that is the container.
        joint_limits: MoveIt's joint_limits.yaml; empty: none.

    Raises:
        SloshEstimatorError, SloshPlanError, SloshFileError: a file cannot be read.
    """
    if not str(urdf):
        return None
    given = read_joint_limits(FilePath(joint_limits)) if str(joint_limits) else {}
    return CarryingRobot(read_arm(urdf, tool_frame), given)


def read_arm(path: str | FilePath, tool_frame: str) -> Arm:
    """Reads a robot from a URDF file.

    Args:
        path: the file.
        tool_frame: link that is the container.

    Raises:
        SloshEstimatorError: the file cannot be read, or no link is named.
        SloshPlanError: Pinocchio is missing, no URDF, no such link.
    """
    if not tool_frame:
        raise SloshEstimatorError(
            f"{path}: give the link that holds the container: the tool frame"
        )
    return Arm(read_urdf(path), tool_frame, str(path))
