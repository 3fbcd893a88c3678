"""Effect: damping increases with the speed of the liquid."""

from __future__ import annotations

import math

from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import RADIUS, VX, VY


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    vx, vy = q[VX], q[VY]
    # Not math.hypot, which keeps the compiler from vector instructions.
    drag = -p[0] / mode[RADIUS] * math.sqrt(vx * vx + vy * vy)
    return drag * vx, drag * vy, 0.0, 0.0, 0.0


EFFECT = Effect(
    name="quadratic_damping",
    title="quadratic damping",
    meaning=(
        "Drag that grows with the square of the liquid's speed: baffles, edges, breaking crests."
    ),
    stages=(Stage.DYNAMICS,),
    equation=r"\ddot q + \dots + \frac{\beta}{R}\lVert\dot q\rVert\,\dot q = 0",
    source="separation at edges and breaking crests: Dodge 2000, ch. 2; Faltinsen & Timokha 2009",
    parameters=(
        Parameter(
            name="beta",
            unit="1",
            lower=0.0,
            upper=10.0,
            neutral=0.0,
            description="drag per relative displacement",
            plausible=(0.0, 1.0),
            starts=(0.02, 0.2),
        ),
    ),
    term=_term,
)
