"""Trajectory messages to plain values; of several bodies the first is the container."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_estimator.errors import SloshEstimatorError
from slosh_msgs_py.point_arrays import PointArrays, arrays_of
from slosh_plan import Trajectory
from slosh_plan.consistency import check_consistent
from slosh_plan.joints import Arm
from slosh_plan.trajectory import MOST_POINTS

Points = PointArrays | Sequence[Any]


def trajectory_of_points(points: Points, name: str) -> Trajectory:
    """The motion of a trajectory's points: by accelerations where all have one, else by poses.

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
    """The points as arrays.

    Raises:
        SloshEstimatorError: there are more than `most`.
    """
    if len(points) > most:
        raise SloshEstimatorError(f"{len(points)} points are more than {most}: {remedy}")
    return arrays_of(points, most)


def poses_of(points: PointArrays) -> tuple[Array | None, Array | None]:
    """(N, 3) positions [m] and (N, 4) attitudes; None where points lack a transform.

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
    """(N, 3) linear part of each point's velocity or acceleration; None: not all have one."""
    twists = points.values[field]
    return None if twists is None else twists[:, :3]


def trajectory_of_joints(message: Any, arm: Arm, name: str) -> Trajectory:
    """The container's motion on a JointTrajectory.

    Velocities and accelerations count where all points have them.

    Raises:
        SloshEstimatorError, SloshPlanError: it cannot be one.
    """
    joints, read = list(message.joint_names), read_points(message.points)
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
    position, velocity, acceleration = [*columns, None, None][:3]
    assert position is not None
    return arm.motion(read.t, joints, position, velocity, acceleration, name)
