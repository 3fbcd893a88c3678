"""Converts `predict` requests to plain values, and predictions to responses.

Of several bodies in a trajectory the first is the container.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_estimator.errors import SloshEstimatorError
from slosh_msgs_py.point_arrays import PointArrays, arrays_of
from slosh_plan import HeightLimits, ModelError, Prediction, SafeScales, Trajectory
from slosh_plan.consistency import check_consistent
from slosh_plan.joints import Arm
from slosh_plan.trajectory import MOST_POINTS

NAME = "the motion"
AXES = ("acceleration_x", "acceleration_y", "acceleration_z")

Points = PointArrays | Sequence[Any]


def trajectory_of(request: Any, arm: Arm | None) -> Trajectory:
    """Reads the container's motion from a prediction request.

    Args:
        request: of the service.
        arm: the robot whose joints move; None: it is not known.

    Raises:
        SloshEstimatorError, SloshPlanError: there is none, or it cannot be one.
    """
    points, joints = request.trajectory.points, request.joint_trajectory
    if sum(map(bool, map(len, (request.time, points, joints.points)))) != 1:
        raise SloshEstimatorError(
            "give the motion either as time and acceleration or a trajectory or a joint_trajectory"
        )
    if len(joints.points):
        if arm is None:
            raise SloshEstimatorError(
                "the robot of the joint_trajectory is not known: start the predictor with the "
                "parameters urdf and tool_frame"
            )
        return trajectory_of_joints(joints, arm, NAME)
    if len(points):
        return trajectory_of_points(points, NAME)
    count = len(request.time)
    columns = []
    for name in AXES:
        values = getattr(request, name)
        if len(values) != count:
            raise SloshEstimatorError(f"{name} has {len(values)} values, time has {count}")
        columns.append(np.asarray(values))
    return Trajectory(np.asarray(request.time), np.column_stack(columns), name=NAME)


def limits_of(request: Any) -> HeightLimits:
    """Reads the height limits from a prediction request.

    Raises:
        SloshPlanError: a limit that is none.
    """
    height = math.inf if math.isnan(request.limit) else request.limit
    distance = given(request.rim_distance, 0.0)
    return HeightLimits(height, given(request.residual_limit, math.inf), rim_distance=distance)


def error_of(request: Any) -> ModelError:
    """Reads the model's measured error from a prediction request.

    Raises:
        SloshPlanError: impossible values.
    """
    return ModelError(given(request.sigma, 0.0), given(request.epsilon, 0.0))


def horizon_of(request: Any) -> float | None:
    """Returns how long to predict after the motion's end [s], or None for the default."""
    return given(request.horizon, 0.0) or None


def fill(response: Any, prediction: Prediction) -> None:
    """Writes a prediction into the response of the prediction service."""
    linear, nonlinear = prediction.linear, prediction.nonlinear
    response.peak_linear, response.peak_nonlinear = linear.peak, nonlinear.peak
    response.peak_time, response.azimuth = nonlinear.peak_time, nonlinear.azimuth
    response.peak_lower, response.peak_upper = prediction.lower, prediction.upper
    response.residual_linear = linear.residual
    response.residual_nonlinear = nonlinear.residual
    response.settling_time = nonlinear.settling_time
    response.excess, response.residual_excess = prediction.excess, prediction.residual_excess
    response.flags = int(prediction.flags)
    response.distance_to_rim = prediction.distance_to_rim


def fill_unknown(response: Any) -> None:
    """Sets all numbers of a failed prediction's response to NaN."""
    for name, kind in response.get_fields_and_field_types().items():
        if kind == "double":
            setattr(response, name, math.nan)


def fill_scales(response: Any, scales: SafeScales) -> None:
    """Writes the safe time scales into the response of the prediction service."""
    response.time_scale = scales.safe_from
    response.safe_from = [low for low, _ in scales.intervals]
    response.safe_to = [high for _, high in scales.intervals]
    response.fastest_scale, response.slowest_scale = scales.fastest, scales.slowest


def given(value: float, otherwise: float) -> float:
    """Returns a number from a request, or a default if the number is NaN or 0."""
    return otherwise if value == 0.0 or math.isnan(value) else value


def trajectory_of_points(points: Points, name: str) -> Trajectory:
    """Creates a motion from trajectory points: from accelerations if complete, else from poses.

    Raises:
        SloshEstimatorError, SloshPlanError: it cannot be one, or its fields contradict each other.
    """
    if not len(points):
        raise SloshEstimatorError(f"{name} is empty: a trajectory needs at least two points")
    read = read_points(points)
    position, attitude = poses_of(read)
    velocity, acceleration = _linear_of(read, "velocities"), _linear_of(read, "accelerations")
    if acceleration is not None:
        found = Trajectory(read.t, acceleration, attitude, position=position, name=name)
    elif position is not None:
        found = Trajectory.from_poses(read.t, position, attitude, name)
    else:
        raise SloshEstimatorError(
            "the trajectory's points need a transform each, or an acceleration each"
        )
    check_consistent(name, read.t, position, velocity, acceleration)
    return found


def read_points(
    points: Points, most: int = MOST_POINTS, remedy: str = "cut the motion or thin it out"
) -> PointArrays:
    """Reads trajectory points as arrays; raises an error if there are too many.

    Raises:
        SloshEstimatorError: there are more than `most`.
    """
    if len(points) > most:
        raise SloshEstimatorError(f"{len(points)} points are more than {most}: {remedy}")
    return arrays_of(points, most)


def poses_of(points: PointArrays) -> tuple[Array | None, Array | None]:
    """Returns positions (N, 3) [m] and attitudes (N, 4) of trajectory points; None if missing.

    The attitude is None, too, where the container stands unturned throughout. A rotation of zeros
    is upright.
    """
    poses = points.values["transforms"]
    if poses is None:
        return None, None
    attitude = poses[:, 3:].copy()
    attitude[~attitude.any(axis=1), 3] = 1.0
    return poses[:, :3], attitude if attitude[:, :3].any() else None


def _linear_of(points: PointArrays, field: str) -> Array | None:
    """Returns the linear part (N, 3) of the points' twists, or None if a point lacks a twist."""
    twists = points.values[field]
    return None if twists is None else twists[:, :3]


def trajectory_of_joints(message: Any, arm: Arm, name: str) -> Trajectory:
    """Computes the container's motion from a JointTrajectory message.

    Velocities and accelerations count where all points have them.

    Raises:
        SloshEstimatorError, SloshPlanError: it cannot be one.
    """
    joints, t, columns = joint_columns(message, name)
    position, velocity, acceleration = [*columns, None, None][:3]
    assert position is not None
    return arm.motion(t, joints, position, velocity, acceleration, name)


def joint_columns(message: Any, name: str) -> tuple[tuple[str, ...], Array, list[Array]]:
    """Returns joint names, times (N,) [s] and joint values from a JointTrajectory message.

    Raises:
        SloshEstimatorError: points whose number of values is not that of the joints.
    """
    joints, read = tuple(message.joint_names), read_points(message.points)
    columns: list[Array] = []
    for what in ("positions", "velocities", "accelerations"):
        sizes, values = read.sizes[what], read.values[what]
        if columns and not sizes.all():
            break
        wrong = np.flatnonzero(sizes != len(joints))
        if len(wrong):
            raise SloshEstimatorError(
                f"{name}: point {wrong[0]} has {sizes[wrong[0]]} {what} for {len(joints)} joints"
            )
        columns.append(np.empty((len(sizes), 0)) if values is None else values)
    return joints, read.t, columns
