"""Effect: in a rectangle the frequency falls with amplitude, or rises in shallow liquid."""

from __future__ import annotations

import math

from slosh_model.constants import GRAVITY
from slosh_model.containers import RECTANGULAR
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import FILL, FREQUENCY, FREQUENCY_RATIO, RADIUS, RADIUS_Y, XI, X, Y

_FIRST = 2.0
"""Between ξ of the first mode and that of the second."""


@compiled
def frequency_shift(depth):  # type: ignore[no-untyped-def]
    """Returns Δ(ω²)/ω² of a standing wave per (kA)²: k wave number, A height at the wall.

    Args:
        depth: kh; below about 0.6 the third order is too little.
    """
    square = math.tanh(depth) ** 2
    return (9.0 / (square * square) - 12.0 / square - 3.0 - 2.0 * square) / 32.0


@compiled
def _spring(omega, xi, reach, fill, q):  # type: ignore[no-untyped-def]
    """Returns the specific force of a cubic spring that gives the third-order frequency shift.

    Waves so high that the third order says nothing any more are kept from running away.
    """
    steepness = 2.0 * omega * omega * q / (GRAVITY * xi)  # k times the wave's height at the wall
    square = steepness * steepness / (1.0 + steepness * steepness)
    return -4.0 / 3.0 * frequency_shift(xi * fill / reach) * omega * omega * square * q


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    if mode[XI] > _FIRST:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    omega, xi, fill = mode[FREQUENCY], mode[XI], mode[FILL]
    omega_y = omega * mode[FREQUENCY_RATIO]
    fx = p[0] * _spring(omega, xi, mode[RADIUS], fill, q[X])
    fy = p[0] * _spring(omega_y, xi, mode[RADIUS_Y], fill, q[Y])
    return fx, fy, 0.0, 0.0, 0.0


EFFECT = Effect(
    name="amplitude_stiffening",
    title="frequency that depends on the wave's height",
    meaning=(
        "A high wave in a rectangle swings slower than a low one; where the liquid is shallow, "
        "faster."
    ),
    stages=(Stage.DYNAMICS,),
    equation=(
        r"\ddot q + \dots"
        r" + \tfrac43\,\kappa\,\Gamma(kh)\,\omega^2\frac{(kA)^2}{1 + (kA)^2}\,q = 0,"
        r"\quad kA = \frac{2\omega^2q}{\xi g},\quad"
        r" \Gamma = \tfrac1{32}\left(9T^{-4} - 12T^{-2} - 3 - 2T^2\right),\quad T = \tanh kh"
    ),
    source=(
        "third order of a standing wave in liquid of finite depth: Tadjbakhsh & Keller, J. Fluid "
        "Mech. 8, 1960; Faltinsen & Timokha 2009, ch. 8; the first mode along each axis by itself"
    ),
    sections=(RECTANGULAR,),
    instead="its models are linear: leave the effect out",
    parameters=(
        Parameter(
            name="kappa",
            unit="1",
            lower=0.0,
            upper=2.5,  # beyond, the highest waves would have no spring left
            neutral=0.0,
            description="share of the theory's; less in waves so high that the third order ends",
            default=1.0,
            plausible=(0.0, 1.5),
            spread=0.3,  # between waves of a tenth and of half the width
            expected=1.0,
            starts=(1.0,),
        ),
    ),
    term=_term,
)
