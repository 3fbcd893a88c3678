"""Limits of a robot's joints from its description and MoveIt's joint_limits.yaml."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from slosh_base.files.yaml_document import parse_yaml, read_yaml
from slosh_base.types import Array
from slosh_plan.errors import SloshPlanError
from slosh_plan.joints import Arm

SECTION = "joint_limits"
KEYS = {
    "velocity": "max_velocity", "acceleration": "max_acceleration", "jerk": "max_jerk",
    "torque": "max_effort", "lower": "min_position", "upper": "max_position",
}  # fmt: skip
"""Of joint_limits.yaml, by the limits that they set."""
SWITCHES = {
    "velocity": "has_velocity_limits", "acceleration": "has_acceleration_limits",
    "jerk": "has_jerk_limits", "torque": "has_effort_limits",
    "lower": "has_position_limits", "upper": "has_position_limits",
}  # fmt: skip
"""A limit counts where its switch is true; without a switch it counts."""


@dataclass(frozen=True, slots=True, eq=False)
class JointLimits:
    """Limits of joints, (J,) each; infinite if a joint has no limit.

    Attributes:
        names: of the joints.
        lower, upper: positions [rad or m].
        velocity, acceleration, jerk: sizes of the derivatives by time [rad/s or m/s, …].
        torque: size of the torque [N m], of a sliding joint the force [N].
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array

    def check_positions(self, position: Array, where: str, tolerance: float = 1e-6) -> None:
        """Raises SloshPlanError if a joint position (N, J) exceeds its limits."""
        outside = np.maximum(self.lower - position, position - self.upper)
        if outside.max() > tolerance:
            row, joint = np.unravel_index(int(np.argmax(outside)), outside.shape)
            degrees = "; are the angles in degrees?" if np.abs(position).max() > 10.0 else ""
            raise SloshPlanError(
                f"{where}: joint {self.names[joint]!r} reaches {position[row, joint]:.6g}, "
                f"outside its limits, {self.lower[joint]:.6g} to {self.upper[joint]:.6g}{degrees}"
            )


def limits_of(
    arm: Arm, joints: Sequence[str], given: Mapping[str, Mapping[str, float]] | None = None
) -> JointLimits:
    """Returns the joint limits of the robot's description, overridden by the user's limits.

    Args:
        arm: the robot.
        joints: their names.
        given: limits by joint and name, as `read_joint_limits` tells them.
    """
    own = arm.limits(joints)
    known = [one.name for one in fields(JointLimits)][1:]
    columns = {name: own.get(name, np.full(len(joints), np.inf)).copy() for name in known}
    for place, joint in enumerate(joints):
        for name, value in (given or {}).get(joint, {}).items():
            columns[name][place] = value
    return JointLimits(tuple(joints), **columns)


def read_joint_limits(path: Path) -> dict[str, dict[str, float]]:
    """Reads MoveIt's joint_limits.yaml; returns limits by joint and name.

    Scaling factors and other keys of MoveIt's are passed over.

    Raises:
        SloshFileError, SloshPlanError: no such file, a limit that is no positive number.
    """
    return _joint_limits(read_yaml(path).value, str(path))


def parse_joint_limits(
    text: str, source: str = "joint_limits.yaml"
) -> dict[str, dict[str, float]]:
    """Parses the text of MoveIt's joint_limits.yaml; returns limits by joint and name.

    Raises:
        SloshFileError, SloshPlanError: as `read_joint_limits`.
    """
    return _joint_limits(parse_yaml(text, source).value, source)


def _joint_limits(document: Any, source: str) -> dict[str, dict[str, float]]:
    section = document.get(SECTION) if isinstance(document, Mapping) else None
    if not isinstance(section, Mapping):
        raise SloshPlanError(f"{source}: the section {SECTION} is missing")
    return {str(joint): _limits(source, str(joint), entry) for joint, entry in section.items()}


def _limits(path: str, joint: str, entry: Any) -> dict[str, float]:
    if not isinstance(entry, Mapping):
        raise SloshPlanError(f"{path}: {SECTION}.{joint} must hold limits by their names")
    found = {}
    for name, key in KEYS.items():
        if key not in entry or entry.get(SWITCHES[name], True) is not True:
            continue
        value, signed = entry[key], name in ("lower", "upper")
        usable = isinstance(value, int | float) and not isinstance(value, bool)
        if not (usable and np.isfinite(value) and (signed or value > 0.0)):
            raise SloshPlanError(
                f"{path}: {SECTION}.{joint}.{key} = {value!r} must be a "
                f"{'finite' if signed else 'positive'} number"
            )
        found[name] = float(value)
    return found
