"""Converts commands to plain values, and what the governor gives to messages."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import Transform, Twist, TwistStamped
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_msgs.msg import GovernedMotion
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.stamps import to_duration, to_nanoseconds, to_time
from slosh_plan.governor import Command, Governed
from slosh_plan.governor.parameters import velocity_command
from slosh_plan.trajectory import Trajectory

AXES = "xyz"


def twist_command(message: TwistStamped) -> Command:
    """Makes the command of a velocity."""
    linear, angular = (
        tuple(float(getattr(part, axis)) for axis in AXES)
        for part in (message.twist.linear, message.twist.angular)
    )
    return velocity_command(to_nanoseconds(message.header.stamp), linear, angular)


def pose_command(message: Any) -> Command:
    """Makes the command of a target from a PoseStamped; its attitude is not used."""
    place = message.pose.position
    return Command(to_nanoseconds(message.header.stamp), target=(place.x, place.y, place.z))


def governed_message(moved: Governed, frame: str) -> GovernedMotion:
    """Makes the message of a step."""
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
    )


def safe_twist(moved: Governed, frame: str) -> TwistStamped:
    """Makes the velocity for the robot."""
    message = TwistStamped()
    message.header.stamp, message.header.frame_id = to_time(moved.stamp_ns), frame
    _set(message.twist.linear, moved.velocity)
    return message


def stop_message(
    motion: Trajectory, velocity: Array, stamp_ns: int, frame: str, name: str
) -> MultiDOFJointTrajectory:
    """Makes the message of a stop.

    Args:
        motion: with positions from where the container is.
        velocity: (3,) of the container at its begin [m/s].
        stamp_ns: when it begins [ns].
        frame: of the world.
        name: of the container.
    """
    message = MultiDOFJointTrajectory(joint_names=[name])
    message.header.stamp, message.header.frame_id = to_time(stamp_ns), frame
    assert motion.position is not None
    steps = 0.5 * np.diff(motion.t)[:, None] * (motion.acceleration[1:] + motion.acceleration[:-1])
    speeds = velocity + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    speeds[-1] = 0.0
    since = np.rint((motion.t - motion.t[0]) * SECOND).astype(np.int64).tolist()
    columns = (motion.position.tolist(), speeds.tolist(), motion.acceleration.tolist())
    for t, place, speed, change in zip(since, *columns, strict=True):
        pose, rate, push = Transform(), Twist(), Twist()
        _set(pose.translation, place)
        _set(rate.linear, speed)
        _set(push.linear, change)
        point = MultiDOFJointTrajectoryPoint(time_from_start=to_duration(t))
        point.transforms, point.velocities, point.accelerations = [pose], [rate], [push]
        message.points.append(point)
    return message


def _set(vector: Any, values: Any) -> None:
    vector.x, vector.y, vector.z = values
