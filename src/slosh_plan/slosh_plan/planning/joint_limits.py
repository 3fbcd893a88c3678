"""Limits of a robot's joints from its description and MoveIt's joint_limits.yaml."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
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
DECELERATION = "max_deceleration"
"""A size of either sign: Pilz' planners have it below 0."""
SWITCHES = {
    "velocity": "has_velocity_limits", "acceleration": "has_acceleration_limits",
    "jerk": "has_jerk_limits", "torque": "has_effort_limits",
    "lower": "has_position_limits", "upper": "has_position_limits",
    "deceleration": "has_deceleration_limits",
}  # fmt: skip
"""A limit counts where its switch is true; without a switch it counts."""
SHARES = {
    "velocity": "default_velocity_scaling_factor",
    "acceleration": "default_acceleration_scaling_factor",
}
"""Shares of the limits that MoveIt plans with unless a request says otherwise."""
NO_LIMITS = frozenset({"angle_wraparound"})
"""Keys of a joint that limit nothing."""
_ENTRY_KEYS = NO_LIMITS.union(KEYS.values(), SWITCHES.values(), [DECELERATION])


@dataclass(frozen=True, slots=True)
class GivenLimits:
    """Limits that a user gives beside the robot's description.

    Attributes:
        joints: limits by joint and name.
        shares: of all joints' velocity and acceleration limits that plans use by default.
        unused: what the file holds beside them, in words.
    """

    joints: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    shares: Mapping[str, float] = field(default_factory=dict)
    unused: tuple[str, ...] = ()


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
        given: limits by joint and name.
    """
    own = arm.limits(joints)
    known = [one.name for one in fields(JointLimits)][1:]
    columns = {name: own.get(name, np.full(len(joints), np.inf)).copy() for name in known}
    for place, joint in enumerate(joints):
        for name, value in (given or {}).get(joint, {}).items():
            columns[name][place] = value
    return JointLimits(tuple(joints), **columns)


def read_joint_limits(path: Path) -> GivenLimits:
    """Reads MoveIt's joint_limits.yaml, also as a ROS 2 parameter file or with `!degrees`.

    Raises:
        SloshFileError, SloshPlanError: no such file, a limit that is no positive number.
    """
    return _joint_limits(read_yaml(path, angles=True).value, str(path))


def parse_joint_limits(text: str, source: str = "joint_limits.yaml") -> GivenLimits:
    """Parses the text of MoveIt's joint_limits.yaml.

    Raises:
        SloshFileError, SloshPlanError: as `read_joint_limits`.
    """
    return _joint_limits(parse_yaml(text, source, angles=True).value, source)


def _joint_limits(document: Any, source: str) -> GivenLimits:
    document = _planning_part(document, source)
    section = document.get(SECTION)
    if not isinstance(section, Mapping):
        raise SloshPlanError(f"{source}: the section {SECTION} is missing")
    shares = {
        name: _number(document[key], f"{source}: {key}", most=1.0)
        for name, key in SHARES.items() if key in document
    }  # fmt: skip
    joints = {
        str(joint): _limits(f"{source}: {SECTION}.{joint}", entry)
        for joint, entry in section.items()
    }
    unused = [str(key) for key in document if key not in (SECTION, *SHARES.values())]
    for joint, entry in section.items():
        unused += [f"{joint}.{key}" for key in entry if key not in _ENTRY_KEYS]
        unused += [f"{joint}.{key} (without a value)" for key in _without_value(entry)]
    return GivenLimits(joints, shares, tuple(unused))


def _planning_part(document: Any, source: str) -> Mapping[str, Any]:
    """Returns the part of a document that holds the limits, as in a ROS 2 parameter file."""
    found = list(_sections(document))
    if len(found) > 1:
        raise SloshPlanError(
            f"{source}: {len(found)} sections {SECTION}: keep those of one robot in the file"
        )
    return found[0] if found else {}


def _sections(document: Any) -> Iterator[Mapping[str, Any]]:
    """Yields the mappings that hold limits, below any names of nodes and parameters."""
    if isinstance(document, Mapping):
        if SECTION in document:
            yield document
        else:
            for inner in document.values():
                yield from _sections(inner)


def _without_value(entry: Mapping[str, Any]) -> list[str]:
    """Returns the switches that are true and whose limits are missing."""
    keys: dict[str, list[str]] = {}
    for name, switch in SWITCHES.items():
        keys.setdefault(switch, []).append(KEYS.get(name, DECELERATION))
    return [one for one, wanted in keys.items()
            if entry.get(one) is True and not any(key in entry for key in wanted)]  # fmt: skip


def _limits(where: str, entry: Any) -> dict[str, float]:
    if not isinstance(entry, Mapping):
        raise SloshPlanError(f"{where} must hold limits by their names")

    def counts(name: str, key: str) -> bool:
        return key in entry and entry.get(SWITCHES[name], True) is True

    found = {
        name: _number(entry[key], f"{where}.{key}", signed=name in ("lower", "upper"))
        for name, key in KEYS.items() if counts(name, key)
    }  # fmt: skip
    if counts("deceleration", DECELERATION):
        value = abs(_number(entry[DECELERATION], f"{where}.{DECELERATION}", signed=True))
        if value == 0.0:
            raise SloshPlanError(f"{where}.{DECELERATION} = 0 must be another number than 0")
        # A joint's acceleration has one limit for both signs of the change of its speed.
        found["acceleration"] = min(value, found.get("acceleration", value))
    return found


def _number(value: Any, where: str, *, signed: bool = False, most: float = math.inf) -> float:
    usable = isinstance(value, int | float) and not isinstance(value, bool)
    if not (usable and math.isfinite(value) and value <= most and (signed or value > 0.0)):
        least = "finite number" if signed else "positive number"
        upper = f" up to {most:g}" if most < math.inf else ""
        raise SloshPlanError(f"{where} = {value!r} must be a {least}{upper}")
    return float(value)
