"""Reads a robot's description (URDF)."""

from __future__ import annotations

from pathlib import Path

from slosh_base.files.bounded_text import read_text
from slosh_base.files.errors import TextFileError
from slosh_estimator.errors import SloshEstimatorError
from slosh_plan.joints import Arm

LONGEST = 10_000_000
"""Bytes; a robot with its cell has some hundred kilobytes."""


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
    try:
        text = read_text(path, LONGEST)
    except TextFileError as error:
        raise SloshEstimatorError(str(error)) from None
    return Arm(text, tool_frame, str(path))
