"""The arm follows the commanded acceleration as a second-order system."""

from __future__ import annotations

import math

from slosh_model.effects.base import SETTLING, Effect, Parameter, Stage, compiled

_STEP = 0.1  # of 1/ω; the error per step is below 1e-7 of the signal


@compiled
def _follow(y, v, u0, u1, dt, omega, zeta):  # type: ignore[no-untyped-def]
    """One axis of the arm over one sample, by Runge-Kutta steps; u0, u1: command at its ends."""
    count = max(math.ceil(dt * omega / _STEP), 1)
    h = dt / count
    for i in range(count):
        a = u0 + (u1 - u0) * (i / count)
        b = u0 + (u1 - u0) * ((i + 1) / count)
        m = 0.5 * (a + b)
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
    # memory: for each axis the command, the arm's acceleration and its rate of change.
    for axis in range(3):
        command = inputs[axis]
        place = 3 * axis
        if dt == SETTLING:
            memory[place + 1], memory[place + 2] = command, 0.0
        elif dt > 0.0:
            memory[place + 1], memory[place + 2] = _follow(
                memory[place + 1], memory[place + 2], memory[place], command, dt, p[0], p[1]
            )
        memory[place] = command
    return memory[1], memory[4], memory[7], inputs[3]


EFFECT = Effect(
    name="robot_dynamics",
    title="dynamics of the arm",
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
