"""Test tools: a cup, a straight line, and independently integrated equations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slosh_model import Cylinder, Model
from slosh_model.motion_profiles import quintic
from slosh_plan import Trajectory
from slosh_testing.planned_equations import AGREE, check_motion, check_tilt, planned_heights

RADIUS, FILL = 0.05, 0.07


@pytest.fixture(scope="session")
def cup():
    """Returns the 3D nonlinear model of the cup in DL22."""
    model = Model(Cylinder(RADIUS, FILL), damping_ratio=0.01)
    return model.with_effect("vertical_acceleration").with_effect("surface_nonlinearity")


@pytest.fixture(scope="session")
def line():
    """Returns a function that creates a straight line from rest to rest."""

    def make(duration=1.0, stroke=0.4, rate=1000.0, name="line"):
        t = np.linspace(0.0, duration, round(duration * rate) + 1)
        position, _, acceleration = quintic(t / duration)
        axis = np.array([1.0, 0.0, 0.0])
        return Trajectory(
            t, np.multiply.outer(acceleration * stroke / duration**2, axis),
            position=np.multiply.outer(stroke * position, axis), name=name,
        )  # fmt: skip

    return make


@pytest.fixture(scope="session")
def reference():
    """Returns a function that integrates the equations of DL22 for the cup's wall heights.

    Equations (11), (14) and (15), Table 1 and 2: written down here, not taken from the package.
    """
    xi, g, alpha, w = 1.8411837813406593, 9.81, 0.58, 2.0
    tanh = np.tanh(xi * FILL / RADIUS)
    omega = np.sqrt(g * xi / RADIUS * tanh)
    mass = 2.0 * RADIUS * tanh / (xi * FILL * (xi**2 - 1.0))
    c = omega**2 * RADIUS / g

    def heights(trajectory, moments, zeta=0.01, nonlinear=True):
        def acceleration(t):
            return [np.interp(t, trajectory.t, a) for a in trajectory.acceleration.T]

        def derivative(t, state):
            q, v = state[:2] / RADIUS, state[2:]
            ax, ay, az = acceleration(t)
            a = np.array([ax, ay])
            stiffness = omega**2 * (1.0 + az / g)
            if not nonlinear:
                return [*v, *(-2 * zeta * omega * v - stiffness * q * RADIUS - a)]
            along = q @ v
            pull = 2 * zeta * omega * c**2 * along + c**2 * (v @ v) / RADIUS
            pull += omega**2 * alpha * RADIUS * (q @ q) ** (w - 1)
            force = -pull * q - 2 * zeta * omega * v - stiffness * q * RADIUS - a
            return [*v, *np.linalg.solve(np.eye(2) + c**2 * np.outer(q, q), force)]

        pieces = solve_ivp(
            derivative, (moments[0], moments[-1]), np.zeros(4), "DOP853", t_eval=moments,
            rtol=1e-9, atol=1e-12, max_step=0.01,
        )  # fmt: skip
        gain = (xi**2 if nonlinear else 4.0) * FILL * mass / RADIUS
        return gain * np.hypot(*pieces.y[:2])

    return heights


@pytest.fixture(scope="session")
def check_plan():
    """Returns a function that checks the promises of a plan by independent means."""

    def check(answer, points, model, limits, attitude=None):
        motion = answer.found.motion
        check_motion(motion, points, limits)
        if motion.tilt is not None:
            check_tilt(motion, limits)
        heights = planned_heights(model.container, motion, attitude)
        assert heights.max() <= limits.height * (1.0 + AGREE)
        assert heights[len(motion.t) - 1 :].max() <= limits.residual * (1.0 + AGREE)
        assert heights.max() == pytest.approx(answer.found.peak, abs=AGREE * limits.height)

    return check


@pytest.fixture(scope="session")
def random_path():
    """Returns a function that creates random waypoints without sharp turns from a seed."""

    def make(seed, straightest=0.6):
        generator = np.random.default_rng(seed)
        while True:
            steps = generator.normal(size=(generator.integers(2, 6), 3)) * [0.12, 0.12, 0.05]
            points = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
            directions = steps / np.linalg.norm(steps, axis=1, keepdims=True)
            cosines = np.einsum("ij,ij->i", directions[:-1], directions[1:])
            if (cosines > straightest).all():
                return points

    return make
