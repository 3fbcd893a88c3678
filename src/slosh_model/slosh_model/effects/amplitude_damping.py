"""Effect: damping increases with the height of the wave."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import (
    DAMPING,
    FREQUENCY,
    FREQUENCY_RATIO,
    RADIUS,
    RADIUS_Y,
    VX,
    VY,
    X,
    Y,
)


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    x, y = q[X] / mode[RADIUS], q[Y] / mode[RADIUS_Y]
    drag = -2.0 * mode[DAMPING] * mode[FREQUENCY] * p[0] * (x * x + y * y)
    return drag * q[VX], drag * mode[FREQUENCY_RATIO] * q[VY], 0.0, 0.0, 0.0


EFFECT = Effect(
    name="amplitude_damping",
    title="damping that grows with the wave's height",
    meaning=(
        "High waves are damped more than low ones, by a share that grows with the square of their "
        "height."
    ),
    stages=(Stage.DYNAMICS,),
    equation=(
        r"\ddot q_i + \dots + 2\zeta\omega_i\,\gamma\,"
        r"\left(\frac{q_x^2}{R_x^2} + \frac{q_y^2}{R_y^2}\right)\dot q_i = 0"
    ),
    source=(
        "damping of high waves as measured: Case and Parkinson 1957, J. Fluid Mech. 2; the first "
        "term that the sign of the wave leaves"
    ),
    parameters=(
        Parameter(
            name="gamma",
            unit="1",
            lower=0.0,
            upper=1000.0,
            neutral=0.0,
            description="relative growth of the damping ratio at a displacement of R",
            plausible=(0.0, 100.0),
            starts=(5.0, 30.0),
        ),
    ),
    term=_term,
)
