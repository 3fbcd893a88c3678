"""Effect: the camera image ends below the highest crests and cuts off their heights."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Stage, compiled


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    return min(eta, p[0])


EFFECT = Effect(
    name="frame_saturation",
    title="saturation at the frame's edge",
    meaning="Nothing above the image's edge is seen: measured heights end at a cap.",
    stages=(Stage.MEASUREMENT,),
    equation=r"\eta \to \min(\eta, \mathrm{cap})",
    source="DL22, Fig. 9",
    of_rig=True,
    parameters=(
        Parameter(
            name="cap",
            unit="m",
            lower=0.0,
            upper=1.0,
            neutral=1.0,
            description="highest height that can be seen",
            plausible=(0.0, 0.08),
            starts=(0.004, 0.008, 0.015, 0.025, 0.04),
        ),
    ),
    order=80,
    reading=_reading,
)
