"""Converts messages to commands, and the governor's results to messages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from geometry_msgs.msg import PoseStamped, Transform, Twist, TwistStamped
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slosh_base.files.nanoseconds import SECOND
from slosh_governor.core import Command, Governed, StopReason
from slosh_governor.core.parameters import NOWHERE, velocity_command
from slosh_governor.tuning import TUNING
from slosh_msgs.msg import GovernedMotion
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_duration, to_nanoseconds, to_time

AXES = "xyz"
_FRAMED = (TwistStamped, PoseStamped)
"""Commands that are in a frame; those of joints are in none."""
_WHY = {
    StopReason.SILENT: "no usable command for longer than the parameter timeout",
    StopReason.INVALID: "the command has NaN, a wrong number of values or an impossible target",
    StopReason.LATE: "a step came late, or the clock jumped",
    StopReason.TURN: "the command turns the container, which is refused: send angular velocity 0",
}
"""What reasons to stop mean, in words; others are told with what the message says."""


class Heading(NamedTuple):
    """What the header of the last command says, as needed to explain a governor.

    Attributes:
        topic: of the commands.
        world: name of the world's frame.
        frame: of the command; None: its type has none, or its joints need none.
        age: when it came [s]; NaN: it has no stamp.
        stamped: whether it has a stamp, or its type has none.
    """

    topic: str
    world: str
    frame: str | None = None
    age: float = math.nan
    stamped: bool = True

    def of(self, message: Any, now_ns: int) -> Heading:
        """Returns that of a command, whatever its type, that came at a moment [ns]."""
        if not hasattr(message, "header"):
            return self
        sent_ns = to_nanoseconds(message.header.stamp)
        frame = message.header.frame_id if isinstance(message, _FRAMED) else None
        age = (now_ns - sent_ns) / SECOND if sent_ns else math.nan
        return self._replace(frame=frame, age=age, stamped=sent_ns != 0)

    def doubts_unit(self, moved: Governed | None) -> bool:
        """Whether a step's command asks for a speed that is unlikely in m/s."""
        fast = moved is not None and math.hypot(*moved.wanted[0]) > TUNING.unlikely
        return fast and self.frame is not None

    def remark(self, moved: Governed | None) -> str:
        """Says what a command leaves open, how it is taken, and what helps; empty: nothing.

        Args:
            moved: the last step; None: there is none.
        """
        found = []
        if moved is not None and self.doubts_unit(moved):
            speed = math.hypot(*moved.wanted[0])
            found.append(f"{speed:g} m/s is more than robots do: send m/s, not mm/s")
        if self.frame == "":
            found.append(f"frame_id is empty, taken as {self.world!r}: set it")
        if not self.stamped:
            found.append("stamp is 0, taken as now: stamp it, so that old commands are refused")
        return f"{self.topic}: {'; '.join(found)}" if found else ""


def why(moved: Governed, heading: Heading) -> str:
    """Says in words why a governor stops, and what helps; empty where the reason says all.

    Args:
        moved: its last step.
        heading: of the last command.
    """
    topic, world = heading.topic, heading.world
    if moved.reason is StopReason.FAST:
        speed, most = math.hypot(*moved.wanted[0]), TUNING.fastest
        return f"{topic} asks for {speed:g} m/s or rad/s, above {most:g}: send m/s, not mm/s"
    if moved.reason is StopReason.FRAME:
        return (
            f"{topic} is in the frame {heading.frame!r:.60}, not in {world!r}: send it in "
            f"{world!r}, or set the parameter world_frame"
        )
    if moved.reason is StopReason.STAMP:
        apart = f"{abs(heading.age):.3g} s {'after' if heading.age < 0.0 else 'before'} it came"
        return (
            f"{topic} is stamped {apart}: set the clocks of both computers alike (NTP; "
            "use_sim_time), or send stamp 0, which is taken as now"
        )
    return _WHY.get(moved.reason, "")


def not_safe(moved: Governed) -> str:
    """Says by how much a step's held stop exceeds the limits, and why."""
    found = (
        f"no stop keeps the limits: the best found reaches {1e3 * moved.peak:.3g} of "
        f"{1e3 * moved.limit:.3g} mm"
    )
    if moved.worst:
        found += f" {moved.worst}"
    if moved.unknown_cause:
        found += f", {1e3 * moved.unknown:.3g} mm of it since {moved.unknown_cause}"
    return found


def in_frame(message: Any, world: str) -> bool:
    """Whether a command is in the world's frame, by name or by an empty `frame_id`."""
    given = message.header.frame_id.lstrip("/")
    return not given or given == world.lstrip("/")


def motion_command(message: Any, world: str) -> Command:
    """Creates a command from a TwistStamped or PoseStamped; one in another frame is refused.

    Args:
        message: the commanded velocity or pose of the container.
        world: name of the world's frame.
    """
    if not in_frame(message, world):
        stamp_ns = to_nanoseconds(message.header.stamp)
        return Command(stamp_ns, NOWHERE, refused=StopReason.FRAME)
    return twist_command(message) if isinstance(message, TwistStamped) else pose_command(message)


def twist_command(message: TwistStamped) -> Command:
    """Creates a governor command from a commanded velocity (TwistStamped)."""
    linear, angular = (
        tuple(float(getattr(part, axis)) for axis in AXES)
        for part in (message.twist.linear, message.twist.angular)
    )
    return velocity_command(to_nanoseconds(message.header.stamp), linear, angular)


def pose_command(message: Any) -> Command:
    """Creates the command of a target position from a PoseStamped; its attitude is not used."""
    place = message.pose.position
    return Command(to_nanoseconds(message.header.stamp), target=(place.x, place.y, place.z))


def governed_message(moved: Governed, frame: str, joints: Sequence[str] = ()) -> GovernedMotion:
    """Creates the GovernedMotion message of one governor step.

    Args:
        moved: the step.
        frame: name of the world's frame.
        joints: names of the joints that are commanded or carry the container.
    """
    of_joints: dict[str, Any] = {}
    if moved.joints:
        rate, change, place = moved.joints
        of_joints = {
            "joint_names": list(joints), "joint_position": place, "joint_velocity": rate,
            "joint_acceleration": change, "joint_start": moved.joint_start,
        }  # fmt: skip
    return filled(
        GovernedMotion,
        stamp_ns=moved.stamp_ns,
        frame_id=frame,
        velocity=moved.velocity,
        acceleration=moved.acceleration,
        position=moved.position,
        share=moved.share,
        state=int(moved.state),
        reason=int(moved.reason),
        safe=moved.safe,
        peak=moved.peak,
        margin=moved.margin,
        limit=moved.limit,
        stop_duration=moved.rest,
        command_age=moved.age,
        steps=moved.steps,
        commands_taken=moved.commands,
        liquid_stamp_ns=moved.liquid_ns,
        worst_container=moved.worst,
        refused_by=moved.refused_by,
        friction_use=moved.friction,
        tipping_use=moved.tipping,
        target_velocity=moved.wanted[0],
        target=moved.wanted[1],
        unknown_wave=moved.unknown,
        unknown_because=moved.unknown_cause,
        unknown_since_ns=moved.unknown_since_ns,
        **of_joints,
    )


def safe_twist(moved: Governed, frame: str) -> TwistStamped:
    """Creates the velocity message (TwistStamped) of a governor step for the robot."""
    message = TwistStamped()
    message.header.stamp, message.header.frame_id = to_time(moved.stamp_ns), frame
    _set(message.twist.linear, moved.velocity)
    return message


def stop_message(moving: Sequence[Governed], period: float, frame: str) -> MultiDOFJointTrajectory:
    """Creates the message of a predicted stop; positions are relative to the stop's start.

    Args:
        moving: steps, the first before the stop begins.
        period: between two of them [s].
        frame: of the world.
    """
    message = MultiDOFJointTrajectory(joint_names=["container"])
    message.header.stamp, message.header.frame_id = to_time(moving[0].stamp_ns), frame
    for number, one in enumerate(moving):
        pose, rate, change = Transform(), Twist(), Twist()
        begin = moving[0].position
        _set(pose.translation, [a - b for a, b in zip(one.position, begin, strict=True)])
        _set(rate.linear, one.velocity)
        _set(change.linear, one.acceleration)
        point = MultiDOFJointTrajectoryPoint(
            time_from_start=to_duration(round(number * period * SECOND))
        )
        point.transforms, point.velocities, point.accelerations = [pose], [rate], [change]
        message.points.append(point)
    return message


def _set(vector: Any, values: Any) -> None:
    vector.x, vector.y, vector.z = values
