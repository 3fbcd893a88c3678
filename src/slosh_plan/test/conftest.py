"""A cup, a straight line, and equations integrated elsewhere."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slosh_model import Cylinder, Model
from slosh_model.motion_profiles import quintic
from slosh_plan import Trajectory

RADIUS, FILL = 0.05, 0.07


@pytest.fixture(scope="session")
def cup():
    """3D-NL of the cup of DL22."""
    model = Model(Cylinder(RADIUS, FILL), damping_ratio=0.01)
    return model.with_effect("vertical_acceleration").with_effect("surface_nonlinearity")


@pytest.fixture(scope="session")
def line():
    """Makes a straight line from rest to rest."""

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
    """Wall heights (N,) of the cup's NL or L model by an adaptive method, from the text of DL22.

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
