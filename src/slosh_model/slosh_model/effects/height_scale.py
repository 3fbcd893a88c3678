"""Effect: the measured heights are scaled by a wrong factor."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Stage, compiled


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    return p[0] * eta


EFFECT = Effect(
    name="height_scale",
    title="scale of the heights",
    meaning="Every measured height is too small or too large by a constant factor.",
    stages=(Stage.MEASUREMENT,),
    equation=r"\eta \to k\,\eta",
    source="scale error of the camera's calibration",
    of_rig=True,
    parameters=(
        Parameter(
            name="gain",
            unit="1",
            lower=0.2,
            upper=5.0,
            neutral=1.0,
            description="measured height relative to the true one",
            plausible=(0.7, 1.4),
            spread=0.15,  # a distance taken from a drawing
            starts=(0.9, 1.1),
        ),
    ),
    order=50,
    reading=_reading,
)
