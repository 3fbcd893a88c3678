"""Simulates the true liquid of the test cases, independently of slosh_model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from slosh_model.simulate import Inputs
from validation.blind import drive, gauss, sensor, theory
from validation.blind.truth_model import Truth

Array = NDArray[np.float64]
LONGEST_STEP = 0.002
LONGEST_STEP_ROUGH = 0.001


@dataclass(frozen=True, slots=True, eq=False)
class Wave:
    """The simulated true motion of the liquid on a fine time grid.

    Attributes:
        t: (G,) [s].
        states: (G, 14) x, y, px, py of each mode, the servo's states.
        height: (G, 2) height vector at the wall in axes that do not yaw [m].
        heading: (G,) the container's yaw [rad].
        level: (G,) still level above that at the start [m].
    """

    t: Array
    states: Array
    height: Array
    heading: Array
    level: Array

    @property
    def msh(self) -> Array:
        """Returns the true maximum height (G,) over the whole wall [m]."""
        return np.asarray(np.hypot(self.height[:, 0], self.height[:, 1]))


def heights(
    truth: Truth,
    inputs: Inputs,
    times: Array,
    azimuths: Array | None = None,
    session_time: float = 0.0,
) -> Array:
    """Returns the maximum or wall heights [m] that a sensor measures, without noise.

    Args:
        truth: what acts.
        inputs: the motion, as the workflow gets it.
        times: (M,) sample times on the inputs' clock [s].
        azimuths: (K,) from the container's +x [rad]; None: MSH.
        session_time: time since the session began at the motion's start [s].
    """
    wave = simulate(truth, inputs, session_time)
    seen = sensor.measure(truth, wave.t, wave.height, wave.heading, wave.level, times, azimuths)
    return seen * truth.growth("gain_drift", session_time, times - inputs.t[0])[:, np.newaxis]


def simulate(truth: Truth, inputs: Inputs, session_time: float = 0.0) -> Wave:
    """Simulates the liquid from equilibrium in the tilt of the first sample."""
    grid = fine_grid(inputs.t, LONGEST_STEP_ROUGH if _rough(truth) else LONGEST_STEP)
    steps = np.diff(grid)
    at = (grid[:-1, np.newaxis] + steps[:, np.newaxis] * gauss.NODES).ravel()
    nodes = drive.nodes_at(truth, inputs, at, session_time)
    first = drive.nodes_at(truth, inputs, inputs.t[:1], session_time)[0]
    const = constants(truth)
    start = equilibrium(truth, first, const)
    cube = nodes.reshape(len(steps), gauss.STAGES, gauss.NODE_WIDTH)
    states = gauss.integrate(start, steps, cube, const)
    elapsed = grid - grid[0]
    depth = drive.depth_at(truth, elapsed)
    nonlinear = truth.has("surface_nonlinearity")
    gain = theory.bessel_gain if nonlinear else theory.planar_gain
    gains = gain(truth.radius, depth)
    masses = states[:, : gauss.SERVO_STATE].reshape(-1, theory.MODES, 4)[:, :, :2]
    height = np.sum(gains[:, :, np.newaxis] * masses, axis=1)
    heading = drive.attitude_at(inputs, grid).heading
    return Wave(grid, states, height, heading, depth - depth[0])


def _rough(truth: Truth) -> bool:
    return truth.has("contact_line_friction") or truth.has("draining_film")


def fine_grid(t: Array, longest: float) -> Array:
    """Subdivides the intervals of a time grid so that none exceeds a given length [s]."""
    parts = np.maximum(1, np.ceil(np.diff(t) / longest - 1e-9)).astype(int)
    part = np.repeat(np.diff(t) / parts, parts)
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    return np.append(np.repeat(t[:-1], parts) + number * part, t[-1])


def constants(truth: Truth) -> Array:
    """Returns the constants (CONSTANTS,) of the equations of motion for a liquid."""
    const = np.zeros(gauss.CONSTANTS)
    const[gauss.ALPHA] = truth.value("surface_nonlinearity", "alpha", 0.0)
    const[gauss.VERTICAL] = float(truth.has("vertical_acceleration"))
    const[gauss.QUADRATIC] = truth.value("quadratic_damping", "beta", 0.0)
    const[gauss.FRICTION] = truth.value("contact_line_friction", "mu", 0.0)
    const[gauss.E] = truth.value("anisotropic_stiffness", "e", 0.0)
    const[gauss.AXIS] = truth.value("anisotropic_stiffness", "axis", 0.0)
    const[gauss.SERVO] = truth.value("robot_dynamics", "frequency", 0.0)
    const[gauss.SERVO_DAMPING] = truth.value("robot_dynamics", "damping_ratio", 0.0)
    const[gauss.CUBIC] = truth.value("cubic_spring", "beta", 0.0)
    const[gauss.CUBIC_AXIS] = truth.value("cubic_spring", "axis", 0.0)
    const[gauss.CORIOLIS] = truth.value("coriolis", "rate", 0.0)
    const[gauss.AMPLITUDE] = truth.value("amplitude_damping", "gamma", 0.0)
    const[gauss.RADIUS] = truth.radius
    const[gauss.ACTIVE_MODES] = 2.0 if truth.has("second_mode") else 1.0
    return const


def equilibrium(truth: Truth, node: Array, const: Array) -> Array:
    """Returns the rest state (14,) for the first sample's acceleration and tilt."""
    start = np.zeros(gauss.STATE_WIDTH)
    servo = gauss.SERVO_STATE
    start[servo : servo + 3] = node[:3]
    frame = node[gauss.FRAME : gauss.SPIN].reshape(3, 3)
    felt = frame.T @ (node[:3] + node[3:6] + [0.0, 0.0, theory.GRAVITY])
    felt[2] -= theory.GRAVITY
    size = float(np.hypot(felt[0], felt[1]))
    if size == 0.0:
        return start
    lift = 1.0 + const[gauss.VERTICAL] * felt[2] / theory.GRAVITY
    for mode in range(int(const[gauss.ACTIVE_MODES])):
        squared = node[gauss.MODE + gauss.PER_MODE * mode]

        def pull(r: float, squared: float = squared) -> float:
            stiff = lift + const[gauss.ALPHA] * (r / truth.radius) ** 2
            return float(squared * stiff * r - size)

        radius = brentq(pull, 0.0, 2.0 * size / (squared * lift), xtol=1e-15)
        start[4 * mode : 4 * mode + 2] = -radius * felt[:2] / size
    return start
