"""Effect: a wave that rotates along the wall is stiffer than a planar wave."""

from __future__ import annotations

from slosh_model.containers import ROUND
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import RADIUS


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    x, y, vx, vy = q
    # Across the velocity, so that it does no work.
    turning = p[0] / (mode[RADIUS] * mode[RADIUS]) * (x * vy - y * vx)
    return -turning * vy, turning * vx, 0.0, 0.0, 0.0


EFFECT = Effect(
    name="swirl_stiffening",
    title="stiffening by swirl",
    meaning="A wave that goes round the wall is stiffer than one that goes to and fro.",
    stages=(Stage.DYNAMICS,),
    equation=(
        r"\ddot q + \dots + \frac{\gamma}{R^2}"
        r"\left(\lVert\dot q\rVert^2q - (q\cdot\dot q)\,\dot q\right) = 0"
    ),
    source=(
        "third order of potential flow: planar waves are softer, rotating ones stiffer by their "
        "amplitude: Miles 1984; Lukovsky 1990; Faltinsen, Lukovsky & Timokha, J. Fluid Mech. 804, "
        "2016; the default opens the nonlinear surface's gap between the two to theirs in deep "
        "liquid"
    ),
    sections=(ROUND,),
    instead="its models are linear: leave the effect out",
    parameters=(
        Parameter(
            name="gamma",
            unit="1",
            lower=-5.0,
            upper=10.0,
            neutral=0.0,
            description="what is added to the squared frequency of a circling mass, per (q/R)²",
            default=0.9,
            plausible=(-1.0, 4.0),
            spread=1.0,  # between small waves and those of half the radius
            expected=0.9,
            starts=(0.9,),
        ),
    ),
    term=_term,
)
