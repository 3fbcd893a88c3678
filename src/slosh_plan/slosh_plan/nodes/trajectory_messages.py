"""Trajectory messages to plain values; of several bodies the first is the container."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_estimator.errors import SloshEstimatorError
from slosh_plan import Trajectory
from slosh_plan.consistency import check_consistent
from slosh_plan.joints import Arm
from slosh_plan.trajectory import MOST_POINTS

Array = NDArray[np.float64]


def trajectory_of_points(points: Any, name: str) -> Trajectory:
    """The motion of a trajectory's points: by accelerations where all have one, else by poses.

    Raises:
        SloshEstimatorError, SloshPlanError: it cannot be one, or its fields contradict each other.
    """
    if not len(points):
        raise SloshEstimatorError(f"{name} is empty: a trajectory needs at least two points")
    t = times_of(points)
    placed = all(point.transforms for point in points)
    attitude = attitude_of(points) if placed else None
    position = positions_of(points) if placed else None
    acceleration = _linear_of(points, "accelerations")
    if acceleration is not None:
        found = Trajectory(t, acceleration, attitude, position=position, name=name)
    elif position is not None:
        found = Trajectory.from_poses(t, position, attitude, name)
    else:
        raise SloshEstimatorError(
            "the trajectory's points need a transform each, or an acceleration each"
        )
    check_consistent(name, t, position, _linear_of(points, "velocities"), acceleration)
    return found


def _linear_of(points: Any, field: str) -> Array | None:
    """(N, 3) linear part of each point's velocity or acceleration; None: not all have one."""
    if not all(getattr(point, field) for point in points):
        return None
    linear = [getattr(point, field)[0].linear for point in points]
    return np.array([(one.x, one.y, one.z) for one in linear])


def trajectory_of_joints(message: Any, arm: Arm, name: str) -> Trajectory:
    """The container's motion on a JointTrajectory.

    Velocities and accelerations count where all points have them.

    Raises:
        SloshEstimatorError, SloshPlanError: it cannot be one.
    """
    points, joints = message.points, list(message.joint_names)
    columns: list[Array] = []
    for what in ("positions", "velocities", "accelerations"):
        rows = [getattr(point, what) for point in points]
        if columns and not all(len(row) for row in rows):
            break
        for number, row in enumerate(rows):
            if len(row) != len(joints):
                raise SloshEstimatorError(
                    f"{name}: point {number} has {len(row)} {what} for {len(joints)} joints"
                )
        columns.append(np.array(rows))
    position, velocity, acceleration = [*columns, None, None][:3]
    assert position is not None
    return arm.motion(times_of(points), joints, position, velocity, acceleration, name)


def times_of(points: Any) -> Array:
    """(N,) times of points from the trajectory's start [s].

    Raises:
        SloshEstimatorError: there are too many.
    """
    if len(points) > MOST_POINTS:
        raise SloshEstimatorError(f"{len(points)} points are more than {MOST_POINTS}")
    return np.array([p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points])


def positions_of(points: Any) -> Array:
    """(N, 3) of points that have a transform [m]."""
    shifts = [point.transforms[0].translation for point in points]
    return np.array([(p.x, p.y, p.z) for p in shifts])


def attitude_of(points: Any) -> Array | None:
    """(N, 4) of points that have a transform; None where the container stands unturned throughout.

    A rotation of zeros is upright.
    """
    turns = [point.transforms[0].rotation for point in points]
    attitude = np.array([(q.x, q.y, q.z, q.w) for q in turns])
    attitude[~attitude.any(axis=1), 3] = 1.0
    return attitude if attitude[:, :3].any() else None
