"""Options that choose the input topic of a bag and the robot's description."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from slosh_motion.inputs.inputs import JOINTS, MESSAGE_TYPES, InputSettings, WantedInput
from slosh_motion.inputs.robot import read_urdf


def add_input_options(parser: Any) -> None:
    """Adds the options that choose the input topic and describe the robot.

    Args:
        parser: or a group of one.
    """
    parser.add_argument(
        "--input", choices=list(MESSAGE_TYPES),
        help="source of the container's motion (default: as recorded, or the first in the bag)",
    )  # fmt: skip
    add_robot_options(parser)


def add_robot_options(parser: Any) -> None:
    """Adds the options that describe the robot: its URDF file and frames.

    Args:
        parser: or a group of one.
    """
    parser.add_argument(
        "--urdf", type=Path, metavar="FILE",
        help="URDF file of the robot, needed to read its motion from joint states (default: the "
        "recorded /robot_description)",
    )  # fmt: skip
    parser.add_argument(
        "--tool-frame",
        metavar="LINK",
        help="link of the robot that holds the container (default: container)",
    )


def wanted_input(arguments: argparse.Namespace) -> WantedInput | None:
    """Returns the input topic and robot that the options choose, or None if they choose none.

    Raises:
        SloshEstimatorError: the robot's description does not fit.
    """
    kind, robot = arguments.input, wanted_robot(arguments)
    if robot is None:
        return None if kind is None else WantedInput(kind)
    return robot._replace(kind=kind or JOINTS)


def wanted_robot(arguments: argparse.Namespace) -> WantedInput | None:
    """Returns joint-state input with URDF and tool frame, or None if the options give neither.

    Raises:
        SloshEstimatorError: the robot's description does not fit.
    """
    urdf, tool = arguments.urdf, arguments.tool_frame or ""
    if urdf is None:
        return WantedInput(JOINTS, "", tool) if tool else None
    text = read_urdf(urdf)
    # A mistake in it is told once, not once per bag.
    InputSettings(urdf=text, tool_frame=tool).poses(JOINTS)
    return WantedInput(JOINTS, text, tool)
