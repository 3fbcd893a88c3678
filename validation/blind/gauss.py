"""Integrates the liquid's equations of motion by the Gauss-Legendre method of order six.

With c = ωₙ²/g the mass on its paraboloid has T = |q̇|²/2 + c² (q·q̇)²/2 per unit mass, the momentum
p = q̇ + c² (q·q̇) q, and the Lagrange equations of DL22 (eqs. (7)-(10), (13)) become

    q̇ = p - c² (q·p)/(1 + c² |q|²) q
    ṗ = c² (q·q̇) q̇ - 2ζω p - ω² (1 + α |q|²/R² + z̈/g) q - s̈.

DL22's damping force is 2ζω p as it stands. c = 0 and α = 0 give the linear model.
"""

from __future__ import annotations

import math

import numpy as np
from numba.types import float64
from numpy.typing import NDArray

from slosh_base.compiled.compilation import compiled, entry_point, given
from validation.blind.theory import GRAVITY

Array = NDArray[np.float64]
GIVEN_1, GIVEN_2, GIVEN_3 = (given(float64, axes) for axes in (1, 2, 3))

# Columns of a node: the inputs and coefficients at one instant.
COMMAND, ADDED, FRAME, SPIN, HEADING, MODE = 0, 3, 6, 15, 16, 17
PER_MODE = 3  # ω², 2ζω, c
NODE_WIDTH = MODE + 2 * PER_MODE
# Constants of a simulation.
(ALPHA, VERTICAL, QUADRATIC, FRICTION, E, AXIS, SERVO, SERVO_DAMPING) = range(8)
(CUBIC, CUBIC_AXIS, CORIOLIS, AMPLITUDE, RADIUS, ACTIVE_MODES) = range(8, 14)
CONSTANTS = 14
# State: x, y, px, py of each mode, then the servo's acceleration and its rate.
SERVO_STATE = 8
STATE_WIDTH = 14
CREEP = 0.003
"""Speed of the mass below which contact-line friction fades [m/s]."""

ROOT15 = math.sqrt(15.0)
NODES: Array = np.array([0.5 - ROOT15 / 10.0, 0.5, 0.5 + ROOT15 / 10.0])
WEIGHTS: Array = np.array([5.0, 8.0, 5.0]) / 18.0
COUPLING: Array = np.array(
    [
        [5 / 36, 2 / 9 - ROOT15 / 15, 5 / 36 - ROOT15 / 30],
        [5 / 36 + ROOT15 / 24, 2 / 9, 5 / 36 - ROOT15 / 24],
        [5 / 36 + ROOT15 / 30, 2 / 9 + ROOT15 / 15, 5 / 36],
    ]
)
STAGES = 3
MAXIMUM_ITERATIONS = 40
TOLERANCE = 1e-13


@compiled
def mode_slope(
    q: Array, node: Array, mode: int, const: Array, ax: float, ay: float, az: float, out: Array
) -> None:
    """Computes the time derivatives of one mode's position and momentum; writes them to `out`."""
    first = 4 * mode
    x, y, px, py = q[first], q[first + 1], q[first + 2], q[first + 3]
    column = MODE + PER_MODE * mode
    stiffness, damping, c = node[column], node[column + 1], node[column + 2]
    radius = const[RADIUS]
    r2 = x * x + y * y
    share = c * c * (x * px + y * py) / (1.0 + c * c * r2)
    vx, vy = px - share * x, py - share * y
    radial = c * c * (x * vx + y * vy)
    spring = stiffness * (1.0 + const[ALPHA] * r2 / radius**2 + const[VERTICAL] * az / GRAVITY)
    speed2 = vx * vx + vy * vy
    drag = const[QUADRATIC] / radius * math.sqrt(speed2)
    drag += const[FRICTION] * GRAVITY / math.sqrt(speed2 + CREEP * CREEP)
    drag += damping * const[AMPLITUDE] * r2 / radius**2
    fx = radial * vx - damping * px - spring * x - ax - drag * vx + const[CORIOLIS] * vy
    fy = radial * vy - damping * py - spring * y - ay - drag * vy - const[CORIOLIS] * vx
    if const[E] != 0.0:
        twice = 2.0 * (const[AXIS] + node[HEADING])
        fx -= const[E] * spring * (math.cos(twice) * x + math.sin(twice) * y)
        fy -= const[E] * spring * (math.sin(twice) * x - math.cos(twice) * y)
    if const[CUBIC] != 0.0:
        angle = const[CUBIC_AXIS] + node[HEADING]
        along = math.cos(angle) * x + math.sin(angle) * y
        force = stiffness * const[CUBIC] * along**3 / radius**2
        fx -= force * math.cos(angle)
        fy -= force * math.sin(angle)
    spin = node[SPIN]
    out[first] = vx - spin * y
    out[first + 1] = vy + spin * x
    out[first + 2] = fx - spin * py
    out[first + 3] = fy + spin * px


@compiled
def slope(q: Array, node: Array, const: Array, out: Array) -> None:
    """Computes the time derivative of the complete state; writes it to `out`."""
    a = np.empty(3)
    servo = const[SERVO]
    for k in range(3):
        command = node[COMMAND + k]
        actual, rate = q[SERVO_STATE + k], q[SERVO_STATE + 3 + k]
        if servo > 0.0:
            a[k] = actual + node[ADDED + k]
            out[SERVO_STATE + k] = rate
            lag = 2.0 * const[SERVO_DAMPING] * servo * rate
            out[SERVO_STATE + 3 + k] = servo * servo * (command - actual) - lag
        else:
            a[k] = command + node[ADDED + k]
            out[SERVO_STATE + k] = 0.0
            out[SERVO_STATE + 3 + k] = 0.0
    a[2] += GRAVITY
    f = FRAME  # the frame's columns are its axes: aᵀ·axis
    ax = node[f] * a[0] + node[f + 3] * a[1] + node[f + 6] * a[2]
    ay = node[f + 1] * a[0] + node[f + 4] * a[1] + node[f + 7] * a[2]
    az = node[f + 2] * a[0] + node[f + 5] * a[1] + node[f + 8] * a[2] - GRAVITY
    for mode in range(2):
        if mode < const[ACTIVE_MODES]:
            mode_slope(q, node, mode, const, ax, ay, az, out)
        else:
            out[4 * mode : 4 * mode + 4] = 0.0


@entry_point(float64[:, ::1](GIVEN_2, GIVEN_2, GIVEN_1))
def slopes_of(states: Array, nodes: Array, const: Array) -> Array:
    """Returns the time derivatives (N, 14) of N states, each with its own inputs."""
    slopes = np.zeros(states.shape)
    for i in range(len(states)):
        slope(states[i], nodes[i], const, slopes[i])
    return slopes


@entry_point(float64[:, ::1](GIVEN_1, GIVEN_1, GIVEN_3, GIVEN_1))
def integrate(start: Array, steps: Array, nodes: Array, const: Array) -> Array:
    """Returns the states (S + 1, 14) at the start and at the ends of S time steps.

    Args:
        start: (14,) state.
        steps: (S,) lengths [s].
        nodes: (S, 3, NODE_WIDTH) inputs at the Gauss points of every step.
        const: (CONSTANTS,) constants.
    """
    states = np.empty((len(steps) + 1, STATE_WIDTH))
    states[0] = start
    slopes = np.zeros((STAGES, STATE_WIDTH))
    fresh = np.zeros(STATE_WIDTH)
    stage = np.zeros(STATE_WIDTH)
    for step in range(len(steps)):
        h = steps[step]
        for _ in range(MAXIMUM_ITERATIONS):
            change, size = 0.0, 0.0
            for i in range(STAGES):
                for d in range(STATE_WIDTH):
                    total = 0.0
                    for j in range(STAGES):
                        total += COUPLING[i, j] * slopes[j, d]
                    stage[d] = states[step, d] + h * total
                slope(stage, nodes[step, i], const, fresh)
                for d in range(STATE_WIDTH):
                    change = max(change, abs(fresh[d] - slopes[i, d]))
                    size = max(size, abs(fresh[d]))
                    slopes[i, d] = fresh[d]
            if change <= TOLERANCE * (1.0 + size):
                break
        for d in range(STATE_WIDTH):
            total = 0.0
            for j in range(STAGES):
                total += WEIGHTS[j] * slopes[j, d]
            states[step + 1, d] = states[step, d] + h * total
    return states
