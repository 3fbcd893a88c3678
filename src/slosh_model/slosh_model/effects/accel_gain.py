"""Effect: the acceleration input has a wrong scale factor."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import AX, AY, AZ, TURN


@compiled
def _drive(dt, inputs, pose, memory, p):  # type: ignore[no-untyped-def]
    return p[0] * inputs[AX], p[0] * inputs[AY], p[0] * inputs[AZ], inputs[TURN]


EFFECT = Effect(
    name="accel_gain",
    title="gain of the acceleration",
    meaning=(
        "The given acceleration is too small or too large by a constant factor, in all directions."
    ),
    stages=(Stage.INPUT,),
    equation=r"a \to k\,a",
    source="scale error of an accelerometer or of a planned motion",
    of_rig=True,
    parameters=(
        Parameter(
            name="gain",
            unit="1",
            lower=0.2,
            upper=5.0,
            neutral=1.0,
            description="true acceleration relative to the given one",
            plausible=(0.7, 1.4),
            spread=0.15,  # a sensor out of calibration
            starts=(0.9, 1.1),
        ),
    ),
    order=20,
    drive=_drive,
)
