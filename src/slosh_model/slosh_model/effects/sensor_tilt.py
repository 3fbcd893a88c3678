"""Effect: the sensor's reference plane is tilted, so that errors depend on the azimuth."""

from __future__ import annotations

import math

from slosh_model.containers import REVOLVED, ROUND
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import WALL_AZIMUTH, WALL_RADIUS, WALL_X, WALL_Y


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    azimuth = wall[WALL_AZIMUTH]
    if azimuth == azimuth:
        return eta + wall[WALL_RADIUS] * (p[0] * math.cos(azimuth) + p[1] * math.sin(azimuth))
    height = math.hypot(wall[WALL_X], wall[WALL_Y])
    if height == 0.0:  # a level surface has no crest
        return eta
    return eta + wall[WALL_RADIUS] * (p[0] * wall[WALL_X] + p[1] * wall[WALL_Y]) / height


def _slope(name: str, axis: str) -> Parameter:
    return Parameter(
        name=name,
        unit="rad",
        lower=-0.5,
        upper=0.5,
        neutral=0.0,
        description=f"how much too high the wall is read per length along the container's {axis}",
        plausible=(-0.1, 0.1),
        spread=0.04,  # a camera's pose by eye or by a board laid beside the cup
        starts=(0.0,),
    )


EFFECT = Effect(
    name="sensor_tilt",
    title="tilt of the sensor's level",
    meaning=(
        "The level from which heights are read leans against the container's: one side "
        "is read too high."
    ),
    stages=(Stage.MEASUREMENT,),
    equation=r"\eta \to \eta + R\,(e_x\cos\varphi + e_y\sin\varphi)",
    source=(
        r"a plane that leans by $e$ over a circle of radius $R$; $\varphi$: azimuth at which the "
        "height is read, for the maximum that of the crest"
    ),
    of_rig=True,
    sections=(ROUND, REVOLVED),
    parameters=(_slope("e_x", "x"), _slope("e_y", "y")),
    order=30,
    reading=_reading,
)
