"""The `predict` service's request to plain values, and answers to its response."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slosh_estimator.errors import SloshEstimatorError
from slosh_plan import HeightLimits, ModelError, Prediction, SafeScales, Trajectory
from slosh_plan.joints import Arm
from slosh_plan.nodes.trajectory_messages import trajectory_of_joints, trajectory_of_points

NAME = "the motion"
AXES = ("acceleration_x", "acceleration_y", "acceleration_z")


def trajectory_of(request: Any, arm: Arm | None) -> Trajectory:
    """The motion of a request.

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
    """The limits of a request.

    Raises:
        SloshPlanError: a limit that is none.
    """
    height = math.inf if math.isnan(request.limit) else request.limit
    return HeightLimits(height, given(request.residual_limit, math.inf))


def error_of(request: Any) -> ModelError:
    """The model's measured error of a request.

    Raises:
        SloshPlanError: impossible values.
    """
    return ModelError(given(request.sigma, 0.0), given(request.epsilon, 0.0))


def horizon_of(request: Any) -> float | None:
    """The horizon of a request [s]; None: the usual one."""
    return given(request.horizon, 0.0) or None


def fill(response: Any, prediction: Prediction) -> None:
    """Writes a prediction."""
    linear, nonlinear = prediction.linear, prediction.nonlinear
    response.peak_linear, response.peak_nonlinear = linear.peak, nonlinear.peak
    response.peak_time, response.azimuth = nonlinear.peak_time, nonlinear.azimuth
    response.peak_lower, response.peak_upper = prediction.lower, prediction.upper
    response.residual_linear = linear.residual
    response.residual_nonlinear = nonlinear.residual
    response.settling_time = nonlinear.settling_time
    response.excess, response.residual_excess = prediction.excess, prediction.residual_excess
    response.flags = int(prediction.flags)


def fill_unknown(response: Any) -> None:
    """NaN in all that only an answer knows."""
    for name, kind in response.get_fields_and_field_types().items():
        if kind == "double":
            setattr(response, name, math.nan)


def fill_scales(response: Any, scales: SafeScales) -> None:
    """Writes which time scales are safe."""
    response.time_scale = scales.safe_from
    response.safe_from = [low for low, _ in scales.intervals]
    response.safe_to = [high for _, high in scales.intervals]
    response.fastest_scale, response.slowest_scale = scales.fastest, scales.slowest


def given(value: float, otherwise: float) -> float:
    """A number of a request; another where it is NaN or 0."""
    return otherwise if value == 0.0 or math.isnan(value) else value
