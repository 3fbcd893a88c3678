"""Effect: the measured heights have a wrong zero."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Stage, compiled


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    return eta + p[0]


EFFECT = Effect(
    name="height_offset",
    title="offset of the heights",
    meaning=(
        "The still surface is not at the calibrated level: a constant is added to every height."
    ),
    stages=(Stage.MEASUREMENT,),
    equation=r"\eta \to \eta + b",
    source="error of the still level in the camera's calibration",
    of_rig=True,
    parameters=(
        Parameter(
            name="offset",
            unit="m",
            lower=-0.1,
            upper=0.1,
            neutral=0.0,
            description="measured height of the still level",
            plausible=(-0.02, 0.02),
            spread=0.004,  # the line at which the still level was taken
            starts=(0.0,),
        ),
    ),
    order=60,
    reading=_reading,
)
