"""Effect: nonlinear sloshing in a cylinder, a mass on a paraboloid (DL22; model class NL)."""

from __future__ import annotations

from slosh_model.containers import ROUND
from slosh_model.effects.base import Effect, Parameter, Parameters, Stage, compiled
from slosh_model.indices import CURVATURE, DAMPING, FREQUENCY, RADIUS
from slosh_model.modes import Mode

ALPHA = 0.58
"""α of the spring of order w = 2, as Bauer found and DL22 use it."""


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    omega, zeta = mode[FREQUENCY], mode[DAMPING]
    curvature, radius = mode[CURVATURE], mode[RADIUS]
    x, y, vx, vy = q
    xr, yr = x / radius, y / radius
    c2 = curvature * curvature
    # Along the position: damping of the vertical motion, centripetal force, spring.
    sliding = xr * vx + yr * vy
    radial = (
        2.0 * zeta * omega * c2 * sliding
        + c2 * (vx * vx + vy * vy) / radius
        + omega * omega * p[0] * (xr * xr + yr * yr) * radius
    )
    return -radial * xr, -radial * yr, c2 * xr * xr, c2 * xr * yr, c2 * yr * yr


def _height_gain(mode: Mode, parameters: Parameters) -> float:
    return mode.curved_gain


EFFECT = Effect(
    name="surface_nonlinearity",
    title="nonlinear free surface",
    meaning=(
        "High waves are not plane: the liquid slides on a paraboloid, and its surface has "
        "the shape of a Bessel function."
    ),
    stages=(Stage.DYNAMICS, Stage.HEIGHT),
    equation=(
        r"C^2\bar q\bar q^T(\ddot q + 2\zeta\omega\dot q) + C^2\bar q\,\lVert\dot q\rVert^2/R"
        r" + \omega^2\alpha\lVert\bar q\rVert^2 q"
    ),
    source="DL22, eqs. (5)-(11), (19), (24), (30); Bauer 1966",
    sections=(ROUND,),
    instead="its models are linear: leave the effect out",
    parameters=(
        Parameter(
            name="alpha",
            unit="1",
            lower=0.0,
            upper=5.0,
            neutral=None,
            description="stiffness of the cubic spring relative to the linear one",
            default=ALPHA,
            plausible=(0.0, 2.0),
            expected=ALPHA,
            starts=(ALPHA,),
        ),
    ),
    term=_term,
    height_gain=_height_gain,
)
