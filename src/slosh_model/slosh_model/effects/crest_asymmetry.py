"""Effect: wave crests are sharper than troughs."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import WALL_RADIUS


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    return eta + p[0] * eta * eta / wall[WALL_RADIUS]


EFFECT = Effect(
    name="crest_asymmetry",
    title="asymmetry of crest and trough",
    meaning="A wave of finite height has sharper crests and flatter troughs.",
    stages=(Stage.MEASUREMENT,),
    equation=r"\eta \to \eta + \kappa\,\eta^2/R",
    source="second order of the standing wave: Faltinsen & Timokha 2009, ch. 8",
    parameters=(
        Parameter(
            name="kappa",
            unit="1",
            lower=-0.5,  # below, a crest of height R would be lower than one that is less high
            upper=3.0,
            neutral=0.0,
            description="second-order height relative to the first order's square over R",
            plausible=(-0.5, 1.5),
            starts=(0.2,),
        ),
    ),
    order=20,
    reading=_reading,
)
