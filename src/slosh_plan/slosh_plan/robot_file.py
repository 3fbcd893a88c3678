"""Reads a robot's description (URDF)."""

from __future__ import annotations

from pathlib import Path

from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.robot import read_urdf
from slosh_plan.joints import Arm


def read_arm(path: str | Path, tool_frame: str) -> Arm:
    """The robot in a URDF file.

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
