"""Checks planned motions by independently written equations of motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from slosh_model import Cylinder, Rectangle

GRAVITY, VISCOSITY = 9.81, 1e-6
WATCHED = 2.5
"""How long the liquid is looked at after a plan [s]."""
AGREE = 5e-4
"""By how much of a limit the two integrators may differ."""


def cylinder_rate(cup):
    """Returns functions for the state's time derivative and the wave height in a cylinder."""
    r, h, alpha, xi = cup.radius, cup.fill_height, 0.58, 1.8411837813406593
    depth = np.tanh(xi * h / r)
    omega = np.sqrt(GRAVITY * xi / r * depth)
    viscous = 0.92 * np.sqrt(VISCOSITY / np.sqrt(GRAVITY * r**3))
    k = 1.84 * h / r
    zeta = viscous * (1.0 + 0.318 / np.sinh(k) * (1.0 + (1.0 - h / r) / np.cosh(k)))
    c2 = (omega**2 * r / GRAVITY) ** 2
    gain = xi**2 * h / r * 2.0 * r * depth / (xi * h * (xi**2 - 1.0))

    def rate(state, felt):
        x, y, vx, vy = state
        bx, by = x / r, y / r
        radial = 2.0 * zeta * omega * c2 * (bx * vx + by * vy) + c2 * (vx * vx + vy * vy) / r
        radial += omega**2 * alpha * (bx * bx + by * by) * r
        stiffness = omega**2 * (1.0 + felt[2] / GRAVITY)
        fx = -2.0 * zeta * omega * vx - stiffness * x - felt[0] - radial * bx
        fy = -2.0 * zeta * omega * vy - stiffness * y - felt[1] - radial * by
        # (1 + c² q qᵀ)⁻¹ = 1 - c² q qᵀ/(1 + c² q·q)
        along = c2 * (bx * fx + by * fy) / (1.0 + c2 * (bx * bx + by * by))
        return [vx, vy, fx - along * bx, fy - along * by]

    return rate, lambda q: gain * np.hypot(q[0], q[1])


def rectangle_rate(tank):
    """Returns functions for the state's time derivative and the wave height in a box."""
    sides, h = np.array([tank.width, tank.depth]), tank.fill_height
    squared = np.pi * GRAVITY / sides * np.tanh(np.pi * h / sides)
    along, across = sides.max(), sides.min()
    k = np.pi / along
    omega = np.sqrt(squared[np.argmax(sides)])
    zeta = np.sqrt(VISCOSITY / (2.0 * omega)) * (
        k / np.sinh(2 * k * h) + (1 - 2 * k * h / np.sinh(2 * k * h)) / along + 1 / across
    )

    def rate(state, felt):
        theta, speed = state[:2], state[2:]
        c = np.cos(theta)
        change = -2.0 * zeta * np.sqrt(squared) * c**2 * speed
        change -= squared * (1.0 + felt[2] / GRAVITY) * np.sin(theta)
        change += squared / GRAVITY * felt[:2] * c
        return [*speed, *change]

    return rate, lambda q: 0.5 * (sides[0] * np.abs(q[0]) + sides[1] * np.abs(q[1]))


def apparent_acceleration(motion, attitude):
    """Returns the acceleration Rᵀ(a + g ẑ) - g ẑ in the container's axes (N, 3) [m/s²]."""
    weight = np.array([0.0, 0.0, GRAVITY])
    if motion.tilt is None and attitude is None:
        return motion.acceleration
    turned = Rotation.from_quat(attitude if motion.tilt is None else motion.tilt.attitude)
    return turned.inv().apply(motion.acceleration + weight) - weight


def planned_heights(container, motion, attitude=None):
    """Returns maximum heights (N,) [m] at 1 kHz during and after a planned motion."""
    made = cylinder_rate if isinstance(container, Cylinder) else rectangle_rate
    assert isinstance(container, Cylinder | Rectangle)
    rate, height = made(container)
    count = len(motion.t) + round(WATCHED * 1000)
    felt = np.zeros((count, 3))
    felt[: len(motion.t)] = apparent_acceleration(motion, attitude)

    def derivative(now, state):
        row = min(int(now * 1000), count - 2)
        return rate(state, felt[row] + (now * 1000 - row) * (felt[row + 1] - felt[row]))

    t = np.arange(count) / 1000
    found = solve_ivp(
        derivative, (0.0, t[-1]), np.zeros(4), "DOP853", t, rtol=1e-8, atol=1e-10, max_step=0.01
    )
    return height(found.y)


def distance(point, places):
    """Returns the distance of a point from the polyline through given points [m]."""
    starts, steps = places[:-1], np.diff(places, axis=0)
    squares = np.maximum((steps**2).sum(axis=1), 1e-30)
    share = np.clip(((point - starts) * steps).sum(axis=1) / squares, 0.0, 1.0)
    return np.linalg.norm(starts + share[:, None] * steps - point, axis=1).min()


def check_motion(motion, points, limits):
    """Checks that a planned motion is at rest at both ends and keeps its limits and waypoints."""
    assert np.allclose(np.diff(motion.t), 1e-3, atol=1e-12)
    assert np.linalg.norm(motion.acceleration, axis=1).max() <= limits.acceleration * (1.0 + 1e-9)
    steps = np.linalg.norm(np.diff(motion.acceleration, axis=0), axis=1)
    assert steps.max() / 1e-3 <= limits.jerk * (1.0 + 1e-9)
    assert (motion.acceleration[[0, -1]] == 0.0).all()
    between = 0.5 * (motion.acceleration[1:] + motion.acceleration[:-1])
    speed = np.concatenate([np.zeros((1, 3)), np.cumsum(between, axis=0) * 1e-3])
    way = speed[:-1] * 1e-3 + 1e-6 * (
        motion.acceleration[:-1] / 3.0 + motion.acceleration[1:] / 6.0
    )
    assert np.abs(speed[-1]).max() < 2e-3
    places = motion.position[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(way, axis=0)])
    assert np.abs(places - motion.position).max() < 1e-3
    for point in points:
        assert distance(point, motion.position) < 1e-4
    assert motion.position[0] == pytest.approx(points[0], abs=1e-6)
    assert motion.position[-1] == pytest.approx(points[-1], abs=1e-6)


def check_tilt(motion, limits):
    """Checks the tilt of a planned motion: upright at both ends, and within its limits."""
    turned = Rotation.from_quat(motion.tilt.attitude)
    up = turned.apply([0.0, 0.0, 1.0])
    assert up[[0, -1]] == pytest.approx(np.array([[0.0, 0.0, 1.0]] * 2), abs=1e-12)
    assert np.arccos(np.clip(up[:, 2], -1.0, 1.0)).max() <= limits.tilt * (1.0 + 1e-6)
    rate = (turned[:-1].inv() * turned[1:]).as_rotvec() / 1e-3
    assert np.linalg.norm(rate, axis=1).max() <= limits.tilt_rate * (1.0 + 1e-6)
    change = np.diff(np.concatenate([np.zeros((1, 3)), rate, np.zeros((1, 3))]), axis=0) / 1e-3
    # Beside the limited one the rotation vector's own curvature counts.
    curved = limits.tilt_rate**2 * limits.tilt
    assert np.linalg.norm(change, axis=1).max() <= limits.tilt_acceleration * 1.001 + curved
