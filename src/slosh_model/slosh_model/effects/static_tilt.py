"""Effect: an unmeasured constant tilt, equivalent to an accelerometer bias."""

from __future__ import annotations

import math

from slosh_model.constants import GRAVITY
from slosh_model.effects.base import SETTLING, Effect, Parameter, Stage, compiled


@compiled
def _drive(dt, inputs, pose, memory, p):  # type: ignore[no-untyped-def]
    ax, ay, az, turn = inputs
    if dt == SETTLING and p[2] == 0.0:
        return ax, ay, az, turn
    c, s = math.cos(turn), math.sin(turn)
    fx, fy, fz = c * ax + s * ay, c * ay - s * ax, az + GRAVITY
    # Rᵀ f for R = Ry(pitch) Rx(roll).
    cp, sp, cr, sr = math.cos(p[1]), math.sin(p[1]), math.cos(p[0]), math.sin(p[0])
    gx, gz = cp * fx - sp * fz, sp * fx + cp * fz
    gy, gz = cr * fy + sr * gz, cr * gz - sr * fy
    return c * gx - s * gy, s * gx + c * gy, gz - GRAVITY, turn


def _angle(name: str, description: str) -> Parameter:
    return Parameter(
        name=name,
        unit="rad",
        lower=-0.5,
        upper=0.5,
        neutral=0.0,
        description=description,
        plausible=(-0.1, 0.1),
        spread=0.04,  # a rig that nobody has levelled
        starts=(0.0,),
    )


EFFECT = Effect(
    name="static_tilt",
    title="constant tilt",
    meaning="The container, or the accelerometer, is mounted with an unknown constant tilt.",
    stages=(Stage.INPUT,),
    equation=r"a \to R_t^T(a + g\hat z) - g\hat z,\quad R_t = R_y(\theta)R_x(\phi)",
    source="equivalence of gravity and acceleration",
    of_rig=True,
    parameters=(
        _angle("roll", "tilt about the container's x axis"),
        _angle("pitch", "tilt about the container's y axis, after the roll"),
        Parameter(
            name="settled",
            unit="1",
            lower=0.0,
            upper=1.0,
            neutral=None,
            description=(
                "1 where the liquid has come to rest in the tilt before the first sample, 0 where "
                "it starts level"
            ),
            default=1.0,
            choices=(0.0, 1.0),
        ),
    ),
    order=50,
    drive=_drive,
)
