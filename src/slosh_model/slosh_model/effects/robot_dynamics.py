"""Effect: the robot arm follows the commanded acceleration as a second-order system."""

from __future__ import annotations

import math

from slosh_model.effects.base import SETTLING, Effect, Parameter, Stage, compiled
from slosh_model.indices import TURN

_STEP = 0.1  # of 1/ω; the error per step is below 1e-7 of the signal


@compiled
def _follow(y, v, a, m, b, h, omega, zeta):  # type: ignore[no-untyped-def]
    """Advances one axis of the robot arm's response by a Runge-Kutta step."""
    k1 = omega * omega * (a - y) - 2.0 * zeta * omega * v
    v2 = v + 0.5 * h * k1
    k2 = omega * omega * (m - y - 0.5 * h * v) - 2.0 * zeta * omega * v2
    v3 = v + 0.5 * h * k2
    k3 = omega * omega * (m - y - 0.5 * h * v2) - 2.0 * zeta * omega * v3
    v4 = v + h * k3
    k4 = omega * omega * (b - y - h * v3) - 2.0 * zeta * omega * v4
    y += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
    v += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return y, v


@compiled
def _drive(dt, inputs, pose, memory, p):  # type: ignore[no-untyped-def]
    # memory: the command, the arm's acceleration and its rate of change, of each axis.
    if dt == SETTLING:
        for axis in range(3):
            memory[3 + axis], memory[6 + axis] = inputs[axis], 0.0
    elif dt > 0.0:
        count = max(math.ceil(dt * p[0] / _STEP), 1)
        h = dt / count
        for i in range(count):
            begin, end = i / count, (i + 1) / count
            for axis in range(3):  # side by side: none waits for the others
                u0, u1 = memory[axis], inputs[axis]
                a, b = u0 + (u1 - u0) * begin, u0 + (u1 - u0) * end
                memory[3 + axis], memory[6 + axis] = _follow(
                    memory[3 + axis], memory[6 + axis], a, 0.5 * (a + b), b, h, p[0], p[1]
                )
    for axis in range(3):
        memory[axis] = inputs[axis]
    return memory[3], memory[4], memory[5], inputs[TURN]


EFFECT = Effect(
    name="robot_dynamics",
    title="dynamics of the arm",
    meaning="The motion is what was commanded; the arm follows it as a second-order system.",
    stages=(Stage.INPUT,),
    equation=(
        r"\ddot a + 2\zeta_a\omega_a\dot a + \omega_a^2 a = \omega_a^2 a_{\mathrm{command}}"
    ),
    source="second-order model of a controlled joint",
    parameters=(
        Parameter(
            name="frequency",
            unit="rad/s",
            lower=2.0,
            upper=500.0,
            neutral=None,
            description="natural frequency of the arm; without bound: it follows exactly",
            plausible=(10.0, 250.0),
            starts=(20.0, 50.0, 120.0),
        ),
        Parameter(
            name="damping_ratio",
            unit="1",
            lower=0.02,
            upper=3.0,
            neutral=None,
            description="damping ratio of the arm",
            default=0.7,
            plausible=(0.1, 1.5),
            starts=(0.3, 0.8),
        ),
    ),
    order=10,
    drive=_drive,
    drive_memory=9,
)
