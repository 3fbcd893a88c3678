"""Creates the governor from the parameters of its node, live and in a replay."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slosh_governor.core.commands import Command, ModelDoubt, StopReason
from slosh_governor.core.governor import Governor
from slosh_governor.core.robot_arm import GovernedArm, with_defaults
from slosh_model.model import Model
from slosh_model.tray import Tray
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.robot_file import CarryingRobot

POSITION, VELOCITY = "position", "velocity"
"""What the numbers of `joint_values` are."""
TURNS = 1e-3
"""A larger angular velocity of a command [rad/s] is refused: it tilts or turns the container."""
NOWHERE = (math.nan,) * 3
"""Numbers of a command of the container's motion that is refused."""


def governor_of(
    held: Model | Tray,
    parameters: Mapping[str, Any],
    robot: GovernedArm | None = None,
    *,
    at_rest: bool = False,
) -> Governor:
    """Creates the motion governor from a node's parameters.

    Args:
        held: the container's model, or a tray.
        parameters: of the node by name.
        robot: its joints are commanded, or carry the commanded container; None: unknown.
        at_rest: whether the liquid is at rest; else its state is unknown.

    Raises:
        SloshPlanError: an impossible limit, a robot that holds the container tilted.
    """
    height = float(parameters["limit"]) or float("inf")
    limits = PlanLimits(
        height, height, float(parameters["max_acceleration"]), float(parameters["max_jerk"]),
        rim_distance=float(parameters["rim_distance"]),
        friction=float(parameters.get("friction", 1.0)),
        tipping=float(parameters.get("tipping", 1.0)),
    )  # fmt: skip
    doubt = ModelDoubt(float(parameters["frequency_error"]), float(parameters["damping_factor"]))
    joints = commands_joints(parameters)
    return Governor(
        held, limits, doubt=doubt, period=1.0 / float(parameters["rate"]),
        timeout=float(parameters["timeout"]), arm=robot if joints else None,
        carrier=None if joints else robot, at_rest=at_rest,
    )  # fmt: skip


def commands_joints(parameters: Mapping[str, Any]) -> bool:
    """Whether a governor's parameters select commands of joints."""
    return str(parameters.get("command", "")).startswith("joint")


def velocity_command(
    stamp_ns: int, linear: tuple[float, ...], angular: tuple[float, ...]
) -> Command:
    """Creates a command from a TwistStamped; one that turns the container is refused.

    Args:
        stamp_ns: of the message [ns].
        linear, angular: x, y, z [m/s, rad/s].
    """
    turn = math.hypot(*angular)
    if turn > TURNS:
        return Command(stamp_ns, NOWHERE, refused=StopReason.TURN)
    return Command(stamp_ns, NOWHERE if math.isnan(turn) else linear)


def arm_of(
    robot: CarryingRobot | None, start: Sequence[float], parameters: Mapping[str, Any]
) -> GovernedArm | None:
    """Creates the robot that the governor moves; None without a robot description.

    Args:
        robot: the description, with the user's limits.
        start: (J,) positions of the joints that carry the link [rad or m].
        parameters: of the node by name.

    Raises:
        SloshPlanError: positions beyond the joints' limits.
    """
    if robot is None:
        return None
    limits = with_defaults(
        robot.limits(robot.arm.carrying), float(parameters["max_joint_acceleration"]),
        float(parameters["max_joint_jerk"]),
    )  # fmt: skip
    return GovernedArm(robot.arm, limits, np.array(start, dtype=np.float64))


def joint_command(
    stamp_ns: int,
    carrying: Sequence[str],
    names: Sequence[str],
    positions: Sequence[float],
    velocities: Sequence[float],
) -> Command:
    """Creates a command from joint positions, velocities, or both, by joint name.

    Args:
        stamp_ns: of the message [ns]; 0: it has none.
        carrying: joints that are commanded, in the governor's order.
        names: of the values, in any order and with other joints; empty: in the governor's order.
        positions, velocities: values [rad or m, and per second]; empty: not given.

    Returns:
        the command; an unusable one of NaN if a joint is missing or the numbers do not match.
    """
    own = tuple(names) or tuple(carrying)
    unusable = Command(stamp_ns, (math.nan,) * len(carrying))
    if not all(name in own for name in carrying) or not (positions or velocities):
        return unusable
    if any(values and len(values) != len(own) for values in (positions, velocities)):
        return unusable
    places = [own.index(name) for name in carrying]
    target = tuple(float(positions[place]) for place in places) if positions else None
    velocity = tuple(float(velocities[place]) for place in places) if velocities else ()
    return Command(stamp_ns, velocity, target)
