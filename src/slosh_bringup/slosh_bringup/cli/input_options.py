"""Options that say which topic of a bag drives the models, and by which robot."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from slosh_estimator.inputs import JOINTS, MESSAGE_TYPES, InputSettings, WantedInput
from slosh_estimator.robot import read_urdf


def add_input_options(parser: Any) -> None:
    """Declares them.

    Args:
        parser: or a group of one.
    """
    parser.add_argument(
        "--input", choices=list(MESSAGE_TYPES),
        help="what drives the models (default: as recorded, or the first of these in the bag)",
    )  # fmt: skip
    parser.add_argument(
        "--urdf", type=Path, metavar="FILE",
        help="robot description for the input joints (default: recorded /robot_description)",
    )  # fmt: skip
    parser.add_argument(
        "--tool-frame",
        metavar="LINK",
        help="link of the robot that is the container (default: container)",
    )


def wanted_input(arguments: argparse.Namespace) -> WantedInput | None:
    """What the options say; None: nothing.

    Raises:
        SloshEstimatorError: the robot's description does not fit.
    """
    kind, urdf, tool = arguments.input, arguments.urdf, arguments.tool_frame or ""
    if kind is None and urdf is None and not tool:
        return None
    if urdf is None:
        return WantedInput(kind or JOINTS, "", tool) if tool else WantedInput(kind)
    text = read_urdf(urdf)
    # A mistake in it is told once, not once per bag.
    InputSettings(urdf=text, tool_frame=tool).poses(JOINTS)
    return WantedInput(kind or JOINTS, text, tool)
