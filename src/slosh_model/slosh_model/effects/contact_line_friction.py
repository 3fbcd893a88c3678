"""Effect: the contact line sticks to the wall, as dry friction against the motion."""

from __future__ import annotations

import math

from slosh_model.constants import GRAVITY
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import VX, VY

REST_SPEED = 1e-3
"""Speed of the mass below which friction fades, so that the equation stays smooth [m/s]."""


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    vx, vy = q[VX], q[VY]
    friction = -p[0] * GRAVITY / math.sqrt(vx * vx + vy * vy + REST_SPEED * REST_SPEED)
    return friction * vx, friction * vy, 0.0, 0.0, 0.0


EFFECT = Effect(
    name="contact_line_friction",
    title="friction of the contact line",
    meaning=(
        "The line in which the surface meets the wall sticks: a force of constant size "
        "against the velocity."
    ),
    stages=(Stage.DYNAMICS,),
    equation=(
        r"\ddot q + \dots + \mu g\,\frac{\dot q}{\sqrt{\lVert\dot q\rVert^2 + v_0^2}} = 0,"
        r"\quad v_0 = 1\,\mathrm{mm/s}"
    ),
    source="hysteresis of the contact angle: Ibrahim 2005, ch. 3; Dussan 1979",
    parameters=(
        Parameter(
            name="mu",
            unit="1",
            lower=0.0,
            upper=0.1,
            neutral=0.0,
            description="friction force relative to the sloshing mass's weight",
            plausible=(0.0, 0.02),
            starts=(0.001, 0.006),
        ),
    ),
    term=_term,
)
