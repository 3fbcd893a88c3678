"""A PlanRequest to plain values, and a plan to a MotionPlan."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from geometry_msgs.msg import Transform, Twist
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_estimator.errors import SloshEstimatorError
from slosh_msgs.msg import MotionPlan
from slosh_msgs_py.stamps import to_duration
from slosh_plan import Trajectory
from slosh_plan.nodes.predict_messages import (
    given,
    poses_of,
    read_points,
)
from slosh_plan.planning.execution import Execution, execution_of
from slosh_plan.planning.limits import ACCELERATION, JERK, PlanLimits
from slosh_plan.planning.plan import Plan
from slosh_plan.planning.waypoints import TURNED, Waypoints

NAME = "the path"
MOST_WAYPOINTS = 5_000
"""Each is looked for on the plan: within a second or two."""


def waypoints_of(request: Any) -> Waypoints:
    """The path of a request.

    Raises:
        SloshEstimatorError, SloshPlanError: there is none, or it cannot be one.
    """
    points = request.trajectory.points
    if not len(points):
        raise SloshEstimatorError("give a path: a trajectory with at least 2 points")
    read = read_points(points, MOST_WAYPOINTS, "take fewer waypoints: the path is smooth between")
    t, (position, attitude) = read.t, poses_of(read)
    if position is None:
        raise SloshEstimatorError(f"{NAME}: each point needs a transform")
    # The same checks as of a motion that is predicted: of times, too.
    Trajectory(t, np.zeros_like(position), attitude, None, position, NAME)
    return Waypoints(t, position, None if attitude is None else _kept(attitude))


def _kept(attitude: Array) -> Array:
    """(4,) the attitude that all (N, 4) are.

    Raises:
        SloshEstimatorError: it changes.
    """
    turns = attitude / np.linalg.norm(attitude, axis=1)[:, None]
    angles = 2.0 * np.arccos(np.clip(np.abs(turns @ turns[0]), 0.0, 1.0))
    changed = np.flatnonzero(angles > TURNED)
    if len(changed):
        raise SloshEstimatorError(
            f"{NAME}: the attitude changes at point {changed[0]}: planned are paths of a "
            "container that keeps it"
        )
    first: Array = turns[0]
    return first


def limits_of(request: Any) -> PlanLimits:
    """The limits of a request.

    Raises:
        SloshPlanError: a limit that is none.
    """
    return PlanLimits(
        request.limit,
        given(request.residual_limit, request.limit),
        given(request.max_acceleration, ACCELERATION),
        given(request.max_jerk, JERK),
    )


def plan_message(answer: Plan, request: Any, waypoints: Waypoints) -> MotionPlan:
    """The plan as it goes back: header and names as they came."""
    found, upper = answer.found, answer.upper or (math.nan, math.nan)
    run = execution_of(found.motion, waypoints.position)
    message = MotionPlan(
        method=answer.method,
        reason=answer.reason,
        duration=float(found.motion.duration),
        scaled_duration=float(answer.scaled.found.motion.duration),
        peak=float(found.peak),
        residual=float(found.residual),
        peak_upper=float(upper[0]),
        residual_upper=float(upper[1]),
        acceleration=float(found.acceleration),
        jerk=float(found.jerk),
        seconds=float(answer.seconds),
        waypoints=run.waypoints.tolist(),
    )
    came = request.trajectory
    message.trajectory = MultiDOFJointTrajectory(header=came.header, joint_names=came.joint_names)
    message.trajectory.points = _points(run, waypoints.attitude)
    return message


def _points(run: Execution, attitude: Array | None) -> list[MultiDOFJointTrajectoryPoint]:
    turn = [0.0, 0.0, 0.0, 1.0] if attitude is None else attitude.tolist()
    columns = (run.position, run.velocity, run.acceleration)
    nanoseconds = np.rint(run.t * SECOND).astype(np.int64)
    points = []
    for t, place, speed, change in zip(
        nanoseconds.tolist(), *(column.tolist() for column in columns), strict=True
    ):
        pose, velocity, acceleration = Transform(), Twist(), Twist()
        _set(pose.translation, place)
        pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w = turn
        _set(velocity.linear, speed)
        _set(acceleration.linear, change)
        point = MultiDOFJointTrajectoryPoint(time_from_start=to_duration(t))
        point.transforms, point.velocities = [pose], [velocity]
        point.accelerations = [acceleration]
        points.append(point)
    return points


def _set(vector: Any, values: list[float]) -> None:
    vector.x, vector.y, vector.z = values
