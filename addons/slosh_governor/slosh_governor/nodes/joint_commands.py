"""Converts messages to joint commands, and governed motions of joints to messages."""

from __future__ import annotations

import array
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from slosh_base.files.bounded_text import read_text
from slosh_base.files.nanoseconds import SECOND
from slosh_governor.core import Command, Governed
from slosh_governor.core.parameters import VELOCITY, joint_command
from slosh_motion.inputs.robot import LONGEST, read_urdf
from slosh_msgs_py import topics
from slosh_msgs_py.stamps import to_duration, to_nanoseconds, to_time
from slosh_plan.errors import SloshPlanError
from slosh_plan.robot_file import CarryingRobot, read_robot

_RATE, _CHANGE, _PLACE = range(3)
"""Rows of `Governed.joints`."""


class JointTopics(NamedTuple):
    """Topic names, message type and conversions for one kind of joint command.

    Attributes:
        desired, safe: names of the topics of commands and of what is passed on.
        message: type of both.
        command: makes a command of a message.
        passed: makes the message of a step.
    """

    desired: str
    safe: str
    message: type
    command: Callable[[Any, Sequence[str], str], Command]
    passed: Callable[[Governed, Sequence[str], float, str], Any]


def _of_state(message: JointState, joints: Sequence[str], _: str) -> Command:
    stamp_ns = to_nanoseconds(message.header.stamp)
    return joint_command(
        stamp_ns, joints, message.name, list(message.position), list(message.velocity)
    )


def _of_trajectory(message: JointTrajectory, joints: Sequence[str], _: str) -> Command:
    """Creates the joint command from a one-point trajectory, as MoveIt Servo sends it."""
    stamp_ns, names = to_nanoseconds(message.header.stamp), message.joint_names
    if len(message.points) != 1:
        return joint_command(stamp_ns, joints, names, (), ())
    (point,) = message.points
    return joint_command(stamp_ns, joints, names, list(point.positions), list(point.velocities))


def _of_values(message: Float64MultiArray, joints: Sequence[str], values: str) -> Command:
    given, none = list(message.data), ()
    pair = (none, given) if values == VELOCITY else (given, none)
    return joint_command(0, joints, (), *pair)


def _state(moved: Governed, joints: Sequence[str], period: float, values: str) -> JointState:
    message = JointState(name=list(joints))
    message.header.stamp = to_time(moved.stamp_ns)
    message.position, message.velocity = _doubles(moved, _PLACE), _doubles(moved, _RATE)
    return message


def _trajectory(
    moved: Governed, joints: Sequence[str], period: float, values: str
) -> JointTrajectory:
    return joint_trajectory([moved], joints, period, first=1)


def _values(
    moved: Governed, joints: Sequence[str], period: float, values: str
) -> Float64MultiArray:
    return Float64MultiArray(data=_doubles(moved, _RATE if values == VELOCITY else _PLACE))


def joint_trajectory(
    moving: Sequence[Governed], joints: Sequence[str], period: float, first: int = 0
) -> JointTrajectory:
    """Creates the JointTrajectory message of successive steps of the governor.

    Args:
        moving: the steps; the stamp is that of the first.
        joints: names.
        period: between two steps [s].
        first: periods from the stamp to the first point.
    """
    message = JointTrajectory(joint_names=list(joints))
    message.header.stamp = to_time(moving[0].stamp_ns)
    for number, one in enumerate(moving, first):
        point = JointTrajectoryPoint(time_from_start=to_duration(round(number * period * SECOND)))
        point.positions, point.velocities = _doubles(one, _PLACE), _doubles(one, _RATE)
        point.accelerations = _doubles(one, _CHANGE)
        message.points.append(point)
    return message


def _doubles(moved: Governed, row: int) -> array.array[float]:
    return array.array("d", moved.joints[row])


_KINDS = (
    JointTopics(topics.DESIRED_JOINTS, topics.SAFE_JOINTS, JointState, _of_state, _state),
    JointTopics(
        topics.DESIRED_JOINT_TRAJECTORY, topics.SAFE_JOINT_TRAJECTORY, JointTrajectory,
        _of_trajectory, _trajectory,
    ),
    JointTopics(
        topics.DESIRED_JOINT_VALUES, topics.SAFE_JOINT_VALUES, Float64MultiArray, _of_values,
        _values,
    ),
)  # fmt: skip
JOINT_TOPICS: Mapping[str, JointTopics] = {
    kind: one
    for one in _KINDS
    for kind, row in topics.COMMANDING.items()
    if row.name == one.desired
}
"""Kinds of joint commands, by the value of the governor's parameter `command`."""


def robot_of(parameters: Mapping[str, Any]) -> CarryingRobot | None:
    """Reads the robot that carries the container; None without the parameter `urdf`.

    Args:
        parameters: of the governor by name.

    Raises:
        SloshEstimatorError, SloshPlanError, SloshFileError: a file is missing or unusable.
    """
    kind = parameters["command"]
    if kind in JOINT_TOPICS and not parameters["urdf"]:
        raise SloshPlanError(f"command = {kind} needs the robot's description: the parameter urdf")
    return read_robot(parameters["urdf"], parameters["tool_frame"], parameters["joint_limits"])


def files_of_robot(parameters: Mapping[str, Any]) -> dict[str, str]:
    """Returns the texts of the robot's files by parameter, which a replay needs."""
    if not parameters["urdf"]:
        return {}
    found = {"urdf": read_urdf(parameters["urdf"])}
    if parameters["joint_limits"]:
        found["joint_limits"] = read_text(parameters["joint_limits"], LONGEST)
    return found


class JointPlaces:
    """Newest positions of the joints that carry the container, from joint states.

    Args:
        joints: names in the governor's order.
        now: tells the time [ns].
    """

    def __init__(self, joints: Sequence[str], now: Callable[[], int]) -> None:
        self._joints, self._now = tuple(joints), now
        self._known: dict[str, float] = {}
        self._heard_ns: dict[str, int] = {}
        self._unusable: dict[str, float] = {}

    def hear(self, message: JointState) -> None:
        """Stores a JointState's positions; ignores a message without a position for each name."""
        if len(message.position) != len(message.name):
            return
        for name, value in zip(message.name, message.position, strict=True):
            if name not in self._joints:
                continue
            if abs(value) < float("inf"):
                self._known[name], self._heard_ns[name] = float(value), self._now()
                self._unusable.pop(name, None)
            else:
                self._unusable[name] = float(value)

    def silence(self, now_ns: int, timeout: float) -> str:
        """Names a joint without joint states for longer than a timeout [s]; empty if none."""
        for name in self._joints:
            seconds = (now_ns - self._heard_ns.get(name, now_ns)) / SECOND
            if seconds > timeout:
                return f"no joint states of {name!r} for {seconds:.2f} s{self._bad(name)}"
        return ""

    @property
    def waiting(self) -> str:
        """Names joints whose position was never received, in one line; empty if none."""
        if not self.missing:
            return ""
        bad = "".join(self._bad(name) for name in self.missing)
        return f"no joint states of {', '.join(self.missing)} yet{bad}"

    def _bad(self, name: str) -> str:
        return f"; {name!r} is {self._unusable[name]}" if name in self._unusable else ""

    @property
    def missing(self) -> list[str]:
        """Names of the joints whose position was not received yet."""
        return [name for name in self._joints if name not in self._known]

    @property
    def places(self) -> list[float]:
        """Joint positions in the governor's order [rad or m]; needs a position of every joint."""
        return [self._known[name] for name in self._joints]
