"""Converts a PlanRequest to plain values, and a plan to a MotionPlan message."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import Transform, Twist
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_estimator.errors import SloshEstimatorError
from slosh_model import Model
from slosh_msgs.msg import MotionPlan
from slosh_msgs_py.stamps import to_duration
from slosh_plan import Trajectory
from slosh_plan.nodes.predict_messages import (
    given,
    joint_columns,
    poses_of,
    read_points,
)
from slosh_plan.planning.checked import attitudes
from slosh_plan.planning.execution import Execution, execution_of
from slosh_plan.planning.joint_path import JointMotion
from slosh_plan.planning.limits import ACCELERATION, JERK, PlanLimits
from slosh_plan.planning.path import Path, path_through
from slosh_plan.planning.plan import Plan
from slosh_plan.planning.waypoints import TURNED, JointWaypoints, Waypoints
from slosh_plan.robot_file import CarryingRobot

NAME = "the path"
MOST_WAYPOINTS = 5_000
"""Each is looked for on the plan: within a second or two."""


@dataclass(frozen=True, slots=True, eq=False)
class RequestedPath:
    """The path in a planning request: waypoints of the container or of the joints.

    Attributes:
        waypoints: of the container; None: the joints' path is given.
        joints: the joints' waypoints, and the robot; None: the container's path is given.
    """

    waypoints: Waypoints | None
    joints: tuple[JointWaypoints, CarryingRobot] | None = None

    @property
    def attitude(self) -> Array | None:
        """Container's attitude quaternion (4,); None if upright or determined by the joints."""
        return None if self.waypoints is None else self.waypoints.attitude

    def path(self, model: Model, stopped: Callable[[], bool]) -> Path:
        """Returns the smooth path through the requested waypoints.

        Raises:
            SloshPlanError: there is none.
            StoppedError: it was stopped before its end.
        """
        if self.joints is None:
            assert self.waypoints is not None
            return path_through(self.waypoints.position, stopped, self.waypoints.t)
        given, robot = self.joints
        return robot.path(given, model.container, NAME, stopped)


def points_of(request: Any) -> tuple[Any, Any]:
    """Returns the points of a request's container trajectory and joint trajectory."""
    return request.trajectory.points, request.joint_trajectory.points


def path_of(request: Any, robot: CarryingRobot | None) -> RequestedPath:
    """Reads the path of a planning request (PlanRequest.msg).

    Args:
        request: of the service or the action.
        robot: whose joints move; None: it is not known.

    Raises:
        SloshEstimatorError, SloshPlanError: there is none, or it cannot be one.
    """
    places, joints = points_of(request)
    if not len(joints):
        return RequestedPath(waypoints_of(request))
    if len(places):
        raise SloshEstimatorError("give either a trajectory or a joint_trajectory")
    if robot is None:
        raise SloshEstimatorError(
            "the robot of the joint_trajectory is not known: start the planner with the "
            "parameters urdf and tool_frame"
        )
    names, t, columns = joint_columns(request.joint_trajectory, NAME)
    columns[0] = robot.arm.joined(names, columns[0])
    return RequestedPath(None, (JointWaypoints(names, t, *columns), robot))


def waypoints_of(request: Any) -> Waypoints:
    """Reads the container's waypoints from a planning request.

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
    """Returns the attitude (4,) that a path's attitudes (N, 4) share; an error if they differ.

    Raises:
        SloshEstimatorError: it changes.
    """
    turns = attitude / np.linalg.norm(attitude, axis=1)[:, None]
    angles = 2.0 * np.arccos(np.clip(np.abs(turns @ turns[0]), 0.0, 1.0))
    changed = np.flatnonzero(angles > TURNED)
    if len(changed):
        raise SloshEstimatorError(
            f"{NAME}: the attitude changes at point {changed[0]}: give one attitude "
            "for all points; only such paths are planned"
        )
    first: Array = turns[0]
    return first


def limits_of(request: Any, robot: CarryingRobot | None) -> PlanLimits:
    """Reads the motion limits of a planning request (PlanRequest.msg).

    Args:
        request: of the service or the action.
        robot: whose file may hold default shares of the joints' limits; None: it is not known.

    Raises:
        SloshPlanError: a limit that is none.
    """
    distance = given(request.rim_distance, 0.0)
    limit = request.limit
    if distance > 0.0 and math.isnan(limit):
        limit = math.inf
    asked = PlanLimits(
        limit,
        given(request.residual_limit, limit),
        given(request.max_acceleration, ACCELERATION),
        given(request.max_jerk, JERK),
        rim_distance=distance,
    )
    shares = {} if robot is None else robot.given.shares
    return asked.with_shares(
        {},
        given(request.max_velocity_scaling_factor, shares.get("velocity", 1.0)),
        given(request.max_acceleration_scaling_factor, shares.get("acceleration", 1.0)),
    )


def plan_message(answer: Plan, request: Any, asked: RequestedPath) -> MotionPlan:
    """Creates the MotionPlan message that describes a plan."""
    found, upper = answer.found, answer.upper or (math.nan, math.nan)
    places = np.empty((0, 3)) if asked.waypoints is None else asked.waypoints.position
    run = execution_of(found.motion, places)
    message = MotionPlan(
        method=answer.method,
        reason=answer.reason,
        duration=float(found.motion.duration),
        scaled_duration=float(answer.scaled.found.motion.duration),
        peak=float(found.peak),
        residual=float(found.residual),
        distance_to_rim=float(answer.distance_to_rim),
        peak_upper=float(upper[0]),
        residual_upper=float(upper[1]),
        acceleration=float(found.acceleration),
        jerk=float(found.jerk),
        seconds=float(answer.seconds),
        waypoints=run.waypoints.tolist(),
    )
    came = request.trajectory
    message.trajectory = MultiDOFJointTrajectory(header=came.header, joint_names=came.joint_names)
    message.trajectory.points = _points(run, attitudes(found.motion, asked.attitude, len(run.t)))
    if found.motion.joints is not None:
        came = request.joint_trajectory
        names = list(found.motion.joints.limits.names)
        message.joint_trajectory = JointTrajectory(header=came.header, joint_names=names)
        message.joint_trajectory.points = joint_points(run.t, found.motion.joints)
    return message


def joint_points(t: Array, joints: JointMotion) -> list[JointTrajectoryPoint]:
    """Creates the trajectory points of a joint motion at times (N,) [s]."""
    columns = (joints.position, joints.velocity, joints.acceleration)
    return [
        JointTrajectoryPoint(
            time_from_start=to_duration(moment), positions=q, velocities=v, accelerations=a
        )
        for moment, q, v, a in zip(
            _nanoseconds(t), *(column.tolist() for column in columns), strict=True
        )
    ]


def _nanoseconds(t: Array) -> list[int]:
    found: list[int] = np.rint(t * SECOND).astype(np.int64).tolist()
    return found


def _points(run: Execution, attitude: Array | None) -> list[MultiDOFJointTrajectoryPoint]:
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(run.t), 1)) if attitude is None else attitude
    columns = (run.position, run.velocity, run.acceleration, turns)
    points = []
    for t, place, speed, change, turn in zip(
        _nanoseconds(run.t), *(column.tolist() for column in columns), strict=True
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
