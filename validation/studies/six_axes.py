"""A six-axis arm with the proportions of a UR5 that holds a cup, for studies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from slosh_base.types import Array
from slosh_governor.core import GovernedArm
from slosh_governor.core.robot_arm import with_defaults
from slosh_plan.joints import Arm
from slosh_plan.planning.joint_limits import limits_of

AXES = ("0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0")
STEPS = ("0 0 0.089", "0 0.136 0", "0.425 -0.12 0", "0.392 0 0", "0 0.093 0", "0 0 0.095")
SPEED, ACCELERATION, JERK = 1.5, 8.0, 150.0
"""Limits of each joint [rad/s, rad/s², rad/s³]."""
REACH = 2.0
"""Joints turn by so much to either side [rad]."""
UPRIGHT = (0.0, -1.2, 1.7, -0.5, 0.0, 0.0)
CUP = "cup"


def urdf_of(start: Array) -> str:
    """Returns the URDF text of an arm whose cup is upright at joint positions (6,) [rad]."""
    turned = Rotation.identity()
    for axis, angle in zip(AXES, start, strict=True):
        turned = turned * Rotation.from_rotvec(angle * np.array(axis.split(), dtype=np.float64))
    grip = " ".join(f"{angle:.17g}" for angle in turned.inv().as_euler("xyz"))
    lines = ['<robot name="six_axes"><link name="link0"/>']
    for number, (axis, step) in enumerate(zip(AXES, STEPS, strict=True), 1):
        lines.append(
            f'<link name="link{number}"/><joint name="joint{number}" type="revolute">'
            f'<parent link="link{number - 1}"/><child link="link{number}"/>'
            f'<origin xyz="{step}"/><axis xyz="{axis}"/>'
            f'<limit lower="-{REACH}" upper="{REACH}" effort="100" velocity="{SPEED}"/></joint>'
        )
    lines.append(
        f'<link name="{CUP}"/><joint name="grip" type="fixed"><parent link="link6"/>'
        f'<child link="{CUP}"/><origin xyz="0 0.08 0.1" rpy="{grip}"/></joint></robot>'
    )
    return "".join(lines)


def six_axes(start: Sequence[float] = UPRIGHT) -> GovernedArm:
    """Returns the arm at joint positions (6,) [rad] at which the cup is upright."""
    places: Array = np.array(start, dtype=np.float64)
    arm = Arm(urdf_of(places), CUP)
    limits = with_defaults(limits_of(arm, arm.carrying), ACCELERATION, JERK)
    return GovernedArm(arm, limits, places)
