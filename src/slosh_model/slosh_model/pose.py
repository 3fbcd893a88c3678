"""Converts attitude and angular velocity of a container for the compiled code."""

from __future__ import annotations

import numpy as np
import scipy

from slosh_base.types import Array
from slosh_model.indices import POSE_COUNT
from slosh_model.interpolation import columns_at


def pose_rows(
    t: Array, attitude: Array | None, angular_velocity: Array | None
) -> tuple[Array, Array]:
    """Returns the yaw angle and the pose row of each sample, for the compiled code.

    Args:
        t: (N,) time, strictly increasing [s].
        attitude: (N, 4) quaternion x, y, z, w, world ← container, of any length but zero; None:
            the angular velocity integrated from upright, or upright throughout.
        angular_velocity: (N, 3) in the container's frame [rad/s]; None: from the attitude.

    Returns:
        (N,) the attitude's twist about the container's z [rad] (swing-twist decomposition: x and y
        belong to the swing), without jumps; and (N, POSE_COUNT) quaternion, without changes of its
        sign, angular velocity and angular acceleration; (0, POSE_COUNT) where the container stands
        upright throughout.
    """
    if attitude is None and angular_velocity is None:
        return np.zeros(len(t)), np.zeros((0, POSE_COUNT))
    if attitude is None:
        assert angular_velocity is not None
        attitude = integrated(t, angular_velocity)
    quaternion = attitude / np.linalg.norm(attitude, axis=1, keepdims=True)
    if angular_velocity is None:
        angular_velocity = _rates(t, quaternion)
    flips = np.sum(quaternion[1:] * quaternion[:-1], axis=1) < 0.0
    quaternion[1:][np.cumsum(flips) % 2 == 1] *= -1.0
    z, w = quaternion[:, 2], quaternion[:, 3]
    yaw: Array = np.unwrap(np.arctan2(2.0 * w * z, w * w - z * z))
    change = _slope(t, angular_velocity)
    return yaw, np.column_stack([quaternion, angular_velocity, change])


def integrated(t: Array, rate: Array) -> Array:
    """Integrates an angular velocity to attitudes (N, 4), using interval means."""
    rotation = scipy.spatial.transform.Rotation
    turns = rotation.from_rotvec(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)[:, np.newaxis])
    attitude = [rotation.identity()]
    for turn in turns:
        attitude.append(attitude[-1] * turn)
    quaternions: Array = rotation.concatenate(attitude).as_quat()
    return quaternions


def _rates(t: Array, quaternion: Array) -> Array:
    """Returns the angular velocity (N, 3) [rad/s] in container axes by central differences."""
    if len(t) < 2:
        return np.zeros((len(t), 3))
    attitude = scipy.spatial.transform.Rotation.from_quat(quaternion)
    turns = (attitude[:-1].inv() * attitude[1:]).as_rotvec()
    rates = turns / np.diff(t)[:, np.newaxis]
    middles = 0.5 * (t[1:] + t[:-1])
    return columns_at(t, middles, rates)


def _slope(t: Array, values: Array) -> Array:
    if len(t) < 2:
        return np.zeros_like(values)
    slope: Array = np.gradient(values, t, axis=0)
    return slope
