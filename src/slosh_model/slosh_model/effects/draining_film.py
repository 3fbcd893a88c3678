"""Effect: liquid that drains from the wall is taken for the surface, so readings fall slowly."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Stage, compiled


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    # memory: whether there was a height, and that height.
    if memory[0] != 0.0:
        eta = max(eta, memory[1] - p[0] * dt)
    memory[0], memory[1] = 1.0, eta
    return eta


EFFECT = Effect(
    name="draining_film",
    title="draining film",
    meaning=(
        "A crest leaves a film on the wall that a camera takes for liquid until it has run down."
    ),
    stages=(Stage.MEASUREMENT,),
    equation=r"\dot\eta_{\mathrm{measured}} \ge -v",
    source="gravity drainage of a film on a wall: Jeffreys 1930",
    parameters=(
        Parameter(
            name="speed",
            unit="m/s",
            lower=1e-3,
            upper=10.0,
            neutral=None,
            description="speed at which the film's edge falls",
            plausible=(0.0, 0.5),
            starts=(0.01, 0.03, 0.08, 0.2),
        ),
    ),
    order=70,
    reading=_reading,
    reading_memory=2,
)
