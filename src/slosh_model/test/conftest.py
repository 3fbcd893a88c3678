"""Test tools: a cup's motion in closed form, and an independent integrator."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from slosh_model.simulate import Inputs

END = 2.0  # s
STEP = 2e-4  # s; the straight lines between samples are the model's input, not its error


def rise(t):
    """Returns a smooth rise from 0 to 1 within the first second."""
    s = np.clip(t, 0.0, 1.0)
    return s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)


@dataclass(frozen=True)
class Motion:
    """A motion of a container that is pushed, tilted and turned about z.

    Attributes:
        push: of the acceleration.
        tilt: of roll and pitch [rad].
        yaw: of the turn about the container's axis [rad].
    """

    push: float = 1.0
    tilt: float = 0.15
    yaw: float = 1.0

    @property
    def t(self):
        return np.arange(0.0, END + 0.5 * STEP, STEP)

    def acceleration(self, t):
        """Returns accelerations (..., 3) [m/s²] in world axes, without gravity."""
        columns = (3.0 * np.sin(11.0 * t), 2.5 * np.cos(7.0 * t + 0.4), 3.0 * np.sin(9.0 * t + 1))
        return self.push * np.stack(columns, axis=-1) * rise(t)[..., np.newaxis]

    def turn(self, t):
        """Returns the rotation angle about the container's z axis [rad]."""
        return self.yaw * (0.3 + np.sin(2.5 * t) + 0.8 * t)

    def attitude(self, t):
        """Returns the attitude world ← container: first a yaw, then a horizontal rotation."""
        zero = np.zeros_like(t)
        swing = self.tilt * np.stack([np.sin(4.0 * t + 0.5), np.cos(3.0 * t), zero], axis=-1)
        twist = np.stack([zero, zero, self.turn(t)], axis=-1)
        return Rotation.from_rotvec(swing) * Rotation.from_rotvec(twist)

    def rates(self, t, h=1e-5):
        """Returns angular velocities (..., 3) [rad/s] in container axes."""
        return (self.attitude(t - h).inv() * self.attitude(t + h)).as_rotvec() / (2.0 * h)

    def inputs(self, **changes):
        """Returns the motion as inputs of a model."""
        given = {
            "t": self.t,
            "acceleration": self.acceleration(self.t),
            "attitude": self.attitude(self.t).as_quat(),
            "angular_velocity": self.rates(self.t),
        }
        return Inputs(**{**given, **changes})


@pytest.fixture
def motion():
    """Returns the class `Motion`."""
    return Motion


@pytest.fixture
def integrated():
    """Returns a function that integrates equations by an adaptive method of order eight."""

    def integrate(derivative, t, start=(0.0, 0.0, 0.0, 0.0)):
        solution = solve_ivp(
            derivative, (t[0], t[-1]), start, "DOP853", t_eval=t, rtol=1e-10, atol=1e-13,
            max_step=0.02,
        )  # fmt: skip
        return solution.y.T

    return integrate


@pytest.fixture
def same():
    """Returns a function that asserts that two arrays agree relative to the largest value."""

    def assert_same(found, expected, relative):
        found, expected = np.asarray(found), np.asarray(expected)
        scale = np.max(np.abs(expected))
        assert math.isfinite(scale)
        assert scale > 1e-4
        assert np.max(np.abs(found - expected)) < relative * scale

    return assert_same
