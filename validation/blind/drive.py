"""Computes the inputs of the simulated liquid at any time from a motion table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from slosh_model.simulate import Inputs
from validation.blind import gauss, theory
from validation.blind.truth_model import Truth

Array = NDArray[np.float64]
Curve = Callable[[Array], Array]


@dataclass(frozen=True, slots=True, eq=False)
class Attitude:
    """Attitude, heading, angular velocity and acceleration of the container over time.

    Attributes:
        rotation: (T, 3, 3) world <- container at times (T,).
        heading: (T,) turned about its own axis since upright and not turned [rad].
        rate, angular_acceleration: (T, 3) in the container's frame [rad/s, rad/s²].
    """

    rotation: Array
    heading: Array
    rate: Array
    angular_acceleration: Array


def attitude_at(inputs: Inputs, times: Array) -> Attitude:
    """Interpolates a motion table's attitude at times by cubic splines.

    The heading is the integral of the rate about the container's own axis: a liquid without
    friction in a round cup does not notice that rotation, however the axis moves meanwhile.

    Raises:
        ValueError: rates that tilt, without an attitude.
    """
    if inputs.attitude is None:
        return _from_rates(inputs, times)
    aligned = _continuous(inputs.attitude)
    curve = CubicSpline(inputs.t, aligned)
    quaternion = curve(times)
    rotation = Rotation.from_quat(quaternion)
    rates = CubicSpline(inputs.t, _table_rates(inputs, aligned))
    first = Rotation.from_quat(aligned[0]).as_matrix()
    start = np.arctan2(first[1, 0] - first[0, 1], first[0, 0] + first[1, 1])
    heading = start + rates.antiderivative()(times)[:, 2]
    return Attitude(rotation.as_matrix(), heading, rates(times), rates(times, 1))


def _from_rates(inputs: Inputs, times: Array) -> Attitude:
    rates = np.zeros((len(inputs.t), 3))
    if inputs.angular_velocity is not None:
        rates = inputs.angular_velocity
        if np.any(rates[:, :2]):
            raise ValueError("rates that tilt need an attitude")
    curve = CubicSpline(inputs.t, rates)
    heading = curve.antiderivative()(times)[:, 2]
    rotation = _about_z(heading)
    return Attitude(rotation, heading, curve(times), curve(times, 1))


def _about_z(angle: Array) -> Array:
    """Returns rotation matrices (T, 3, 3) about z for angles (T,) [rad]."""
    zero = np.zeros_like(angle)
    return np.asarray(Rotation.from_rotvec(np.stack([zero, zero, angle], axis=-1)).as_matrix())


def _continuous(quaternions: Array) -> Array:
    """Returns unit quaternions with signs chosen so that consecutive ones do not jump."""
    unit = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    flips = np.sum(unit[1:] * unit[:-1], axis=1) < 0.0
    signs = np.concatenate(([1.0], np.cumprod(np.where(flips, -1.0, 1.0))))
    return np.asarray(unit * signs[:, np.newaxis])


def _table_rates(inputs: Inputs, aligned: Array) -> Array:
    """Returns angular velocities (N, 3) [rad/s]: as given, or derived from the attitude."""
    if inputs.angular_velocity is not None:
        return inputs.angular_velocity
    slope = CubicSpline(inputs.t, aligned)(inputs.t, 1)
    vector, scalar = aligned[:, :3], aligned[:, 3:]
    return np.asarray(
        2.0 * (scalar * slope[:, :3] - slope[:, 3:] * vector - np.cross(vector, slope[:, :3]))
    )


def nodes_at(truth: Truth, inputs: Inputs, times: Array, session_time: float) -> Array:
    """Returns inputs and coefficients (T, NODE_WIDTH) of the equations of motion at times."""
    nodes = np.zeros((len(times), gauss.NODE_WIDTH))
    attitude = attitude_at(inputs, times)
    command = CubicSpline(inputs.t, inputs.acceleration)(times)
    squeeze = truth.value("accel_compression", "gamma", 0.0)
    command = command * (1.0 - squeeze * np.sum(command**2, axis=1, keepdims=True))
    nodes[:, :3] = truth.value("accel_gain", "gain", 1.0) * command
    if truth.has("lever_arm"):
        nodes[:, 3:6] = _lever(truth, attitude)
    nodes[:, gauss.FRAME : gauss.SPIN] = _frame(truth, attitude).reshape(-1, 9)
    nodes[:, gauss.SPIN] = truth.value("yaw_coupling", "kappa", 0.0) * attitude.rate[:, 2]
    nodes[:, gauss.HEADING] = attitude.heading
    nodes[:, gauss.MODE :] = _coefficients(truth, times - inputs.t[0], session_time)
    return nodes


def _lever(truth: Truth, attitude: Attitude) -> Array:
    """Returns the acceleration (T, 3) [m/s²] that a lever arm adds, in world axes."""
    arm = np.array([truth.value("lever_arm", axis, 0.0) for axis in "xyz"])
    swing = np.cross(attitude.rate, np.cross(attitude.rate, arm))
    local = np.cross(attitude.angular_acceleration, arm) + swing
    return np.asarray(np.einsum("tij,tj->ti", attitude.rotation, local))


def _frame(truth: Truth, attitude: Attitude) -> Array:
    """Returns the axes (T, 3, 3) in which the liquid moves, as columns in world axes."""
    count = len(attitude.heading)
    frame = np.broadcast_to(np.eye(3), (count, 3, 3))
    back = _about_z(-attitude.heading)
    if truth.has("gravity_tilt"):
        frame = attitude.rotation @ back
    if truth.has("static_tilt"):
        roll, pitch = (truth.value("static_tilt", name, 0.0) for name in ("roll", "pitch"))
        mount = Rotation.from_euler("yx", [pitch, roll]).as_matrix()
        frame = frame @ np.swapaxes(back, 1, 2) @ mount @ back
    return np.asarray(frame)


def depth_at(truth: Truth, elapsed: Array) -> Array:
    """Returns the depth (T,) of the still liquid [m] at times since the motion's start."""
    start = truth.fill_height + truth.value("fill_level", "delta", 0.0)
    return np.asarray(start - truth.value("fill_loss", "rate", 0.0) * elapsed)


def _coefficients(truth: Truth, elapsed: Array, session_time: float) -> Array:
    """Returns ω², 2ζω and c = ω²/g of both modes, (T, 6)."""
    depth = depth_at(truth, elapsed)
    squared = theory.frequency_squared(truth.radius, depth)
    if truth.damping_ratio is None:
        first = theory.empirical_damping_ratio(truth.radius, depth, truth.viscosity)
    else:
        first = np.full(len(depth), truth.damping_ratio)
    second = np.full(len(depth), truth.value("second_mode", "damping_ratio", 0.0))
    ratios = np.stack([first, second], axis=-1) * truth.value("damping_mismatch", "factor", 1.0)
    if truth.has("damping_drift"):
        since = session_time + elapsed
        start, time = (truth.value("damping_drift", key, 1.0) for key in ("start", "time"))
        ratios *= (start * np.exp(-since / time))[:, np.newaxis]
    ratios *= truth.growth("damping_growth", session_time, elapsed)[:, np.newaxis]
    damping = 2.0 * ratios * np.sqrt(squared)
    curvature = squared / theory.GRAVITY * float(truth.has("surface_nonlinearity"))
    return np.asarray(np.stack([squared, damping, curvature], axis=-1).reshape(-1, 6))
