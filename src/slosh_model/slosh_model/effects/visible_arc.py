"""Effect: the camera sees only part of the wall and measures the maximum there."""

from __future__ import annotations

import math

from slosh_model.containers import REVOLVED, ROUND
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import WALL_AZIMUTH, WALL_X, WALL_Y


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    if wall[WALL_AZIMUTH] == wall[WALL_AZIMUTH]:  # a height at an azimuth is no maximum
        return eta
    from_centre = math.atan2(wall[WALL_Y], wall[WALL_X]) - p[0]
    from_centre -= 2.0 * math.pi * math.floor(from_centre / (2.0 * math.pi) + 0.5)
    beyond = max(abs(from_centre) - 0.5 * p[1], 0.0)
    return eta * math.cos(beyond)


EFFECT = Effect(
    name="visible_arc",
    title="visible part of the wall",
    meaning=(
        "The camera sees a part of the wall alone, and the highest point is that of this part."
    ),
    stages=(Stage.MEASUREMENT,),
    equation=r"\max_{\varphi}\eta(\varphi) \to \max_{|\varphi-c|\le w/2}\eta(\varphi)",
    source="one camera beside the container",
    of_rig=True,
    sections=(ROUND, REVOLVED),
    parameters=(
        Parameter(
            name="centre",
            unit="rad",
            lower=-3.2,
            upper=3.2,
            neutral=None,
            description="azimuth of the visible part's middle from the container's +x",
            plausible=(-math.pi, math.pi),
            starts=(-2.6, -1.6, -0.5, 0.5, 1.6, 2.6),
        ),
        Parameter(
            name="width",
            unit="rad",
            lower=0.0,
            upper=2.0 * math.pi,
            neutral=2.0 * math.pi,
            description="angle that the visible part spans",
            plausible=(0.0, 2.0 * math.pi),
            starts=(1.2, 2.5, 4.2),
        ),
    ),
    order=10,
    reading=_reading,
)
