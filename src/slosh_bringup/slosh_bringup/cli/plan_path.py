"""Path options of `slosh plan`: a path of the container or of a robot's joints."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from slosh_bringup.cli import quantities
from slosh_bringup.cli.table_options import table_options
from slosh_bringup.cli.teller import Teller
from slosh_bringup.errors import SloshBringupError
from slosh_model import Model
from slosh_plan.doubts import path_doubts
from slosh_plan.planning import path as paths
from slosh_plan.planning.path import path_through
from slosh_plan.planning.waypoints import Waypoints
from slosh_plan.robot_file import read_robot
from slosh_plan.tables.joint_table import read_joint_table
from slosh_plan.tables.path_table import read_path_table


@dataclass(frozen=True, slots=True, eq=False)
class AskedPath:
    """The path to be planned, as given on the command line.

    Attributes:
        name: where it comes from.
        path: the path.
        waypoints: of the container, as they are given.
        joints: names of the joints that move; empty: the container's own path is given.
        shares: of the joints' velocity and acceleration limits that are used.
    """

    name: str
    path: paths.Path
    waypoints: Waypoints
    joints: tuple[str, ...] = ()
    shares: Mapping[str, float] = field(default_factory=dict)


def add_path_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options that describe the path to the argument parser."""
    parser.add_argument(
        "path", type=Path, nargs="?",
        help="table of waypoints (.csv) with the columns t,x,y,z[,qx,qy,qz,qw]; if --urdf is "
        "given, the columns are t and the robot's joints",
    )  # fmt: skip
    parser.add_argument(
        "--straight", type=quantities.length(10.0), metavar="M",
        help="plan a straight horizontal path of this length [m] instead of PATH",
    )  # fmt: skip
    parser.add_argument(
        "--urdf", type=Path, metavar="FILE",
        help="URDF file of the robot; PATH is then a table of t and its joints [s, rad, m], and "
        "so is the output",
    )  # fmt: skip
    parser.add_argument(
        "--tool-frame", metavar="LINK",
        help="link of the robot that holds the container; needed with --urdf",
    )  # fmt: skip
    parser.add_argument(
        "--joint-limits", type=Path, metavar="FILE",
        help="MoveIt's joint_limits.yaml: joint limits in addition to those in the URDF",
    )  # fmt: skip
    parser.add_argument(
        "--srdf", type=Path, metavar="FILE",
        help="MoveIt's semantic robot description (SRDF); needed with --group",
    )  # fmt: skip
    parser.add_argument(
        "--group", metavar="NAME",
        help="joint group of the SRDF that is planned; other joints that carry the container stay "
        "at their values in the table PATH, or at 0 if the table has no column for them",
    )  # fmt: skip
    parser.add_argument(
        "--velocity-scaling", type=quantities.FRACTION, metavar="S",
        help="usable share of the joints' velocity limits, 0 to 1 (default: "
        "default_velocity_scaling_factor of --joint-limits, or 1)",
    )  # fmt: skip
    parser.add_argument(
        "--acceleration-scaling", type=quantities.FRACTION, metavar="S",
        help="usable share of the joints' acceleration limits, 0 to 1 (default: "
        "default_acceleration_scaling_factor of --joint-limits, or 1)",
    )  # fmt: skip


def asked_path(arguments: argparse.Namespace, model: Model, tell: Teller) -> AskedPath:
    """Reads the path given on the command line and prints warnings about it."""
    if (arguments.path is None) == (arguments.straight is None):
        raise SloshBringupError("give either a PATH or --straight with its length in metres")
    if (arguments.urdf is None) != (arguments.tool_frame is None):
        raise SloshBringupError("--urdf and --tool-frame must be given together")
    if arguments.urdf is not None:
        return _of_joints(arguments, model, tell)
    scalings = ("velocity_scaling", "acceleration_scaling")
    for option in ("joint_limits", "srdf", "group", *scalings):
        if getattr(arguments, option) is not None:
            name = option.replace("_", "-")
            raise SloshBringupError(f"--{name}: needs the robot: --urdf and --tool-frame")
    if arguments.path is None:
        ends = np.array([[0.0, 0.0, 0.0], [arguments.straight, 0.0, 0.0]])
        waypoints = Waypoints(np.array([0.0, 1.0]), ends, None)
        name = f"straight {arguments.straight:g} m"
    else:
        waypoints = read_path_table(arguments.path, table_options(arguments))
        name = str(arguments.path)
    tell.warn(name, path_doubts(waypoints))
    return AskedPath(name, path_through(waypoints.position, times=waypoints.t), waypoints)


def _of_joints(arguments: argparse.Namespace, model: Model, tell: Teller) -> AskedPath:
    if arguments.path is None:
        raise SloshBringupError("--urdf: give PATH, a table of the robot's joints")
    name = str(arguments.path)
    if (arguments.srdf is None) != (arguments.group is None):
        raise SloshBringupError("--srdf and --group must be given together")
    robot = read_robot(
        arguments.urdf, arguments.tool_frame, arguments.joint_limits or "", arguments.srdf or "",
        arguments.group or "",
    )  # fmt: skip
    assert robot is not None
    arm = robot.arm
    given = read_joint_table(arguments.path, arm, table_options(arguments))
    path = robot.path(given, model.container, name)
    unknown = [joint for joint, has in zip(given.names, arm.known(given.names), strict=True)
               if not has]  # fmt: skip
    if unknown:
        tell(f"{name}: {', '.join(unknown)}: not in the URDF, carried along without limits")
    for remark in robot.unlimited(given.names):
        tell(f"{name}: {remark} (--joint-limits)")
    for remark in robot.file_remarks:
        tell(f"{arguments.joint_limits}: {remark}")
    held = robot.held(given.names)
    if held:
        tell(f"{name}: {', '.join(held)}: not in the group {arguments.group}, held at 0")
    places, _ = arm.poses(given.names, given.position)
    waypoints = Waypoints(given.t, places, None)
    return AskedPath(name, path, waypoints, given.names, robot.given.shares)
