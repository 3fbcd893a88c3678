"""Effect: in a rectangle, the liquid swings as a nonlinear pendulum (model class NL)."""

from __future__ import annotations

import math

from slosh_model.constants import GRAVITY
from slosh_model.containers import RECTANGULAR
from slosh_model.effects.base import Effect, Stage, compiled
from slosh_model.indices import AX, AY, DAMPING, FREQUENCY, FREQUENCY_RATIO, VX, VY, X, Y

_SMALL = 1e-4
"""Angle below which sin(θ)/θ is its series, to the last bit [rad]."""


@compiled
def _axis(omega, zeta, x, v, a):  # type: ignore[no-untyped-def]
    """Returns specific force [m/s²] and added relative mass of the pendulum along one axis.

    The mass makes a sine of all that pulls in proportion to the displacement, gravity and vertical
    acceleration alike: 1 + m = θ/sin(θ). The force does the rest.
    """
    angle = x * omega * omega / GRAVITY
    share = 1.0 - angle * angle / 6.0
    if abs(angle) > _SMALL:
        share = math.sin(angle) / angle
    c = math.cos(angle) / share
    drag = 2.0 * zeta * omega * v
    return a - a * c + drag - drag * math.cos(angle) * c, 1.0 / share - 1.0


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    omega, zeta = mode[FREQUENCY], mode[DAMPING]
    fx, mxx = _axis(omega, zeta, q[X], q[VX], inputs[AX])
    fy, myy = _axis(omega * mode[FREQUENCY_RATIO], zeta, q[Y], q[VY], inputs[AY])
    return fx, fy, mxx, 0.0, myy


EFFECT = Effect(
    name="pendulum_nonlinearity",
    title="nonlinear pendulum",
    meaning=(
        "In a rectangular container the liquid swings as a pendulum does, also at large angles."
    ),
    stages=(Stage.DYNAMICS,),
    equation=(
        r"\ddot\theta = -2\zeta\omega\cos^2\theta\,\dot\theta - \omega^2\sin\theta"
        r" - \frac{\omega^2}{g}\,a\cos\theta,\quad \theta = \omega^2 q/g"
    ),
    source="TM20, eq. (6) with g/l = ω² and d/m_P = 2ζω; along each axis of the container",
    sections=(RECTANGULAR,),
    instead="its models are linear: leave the effect out",
    term=_term,
)
