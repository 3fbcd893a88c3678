"""Effect: rotation of the container about its axis drags the liquid along."""

from __future__ import annotations

import math

from slosh_model.containers import REVOLVED, ROUND
from slosh_model.effects.base import Effect, Parameter, Stage, compiled


@compiled
def _drive(dt, inputs, pose, memory, p):  # type: ignore[no-untyped-def]
    ax, ay, az, turn = inputs
    # The modal axes follow the container by a part of its yaw.
    dragged = p[0] * turn
    c, s = math.cos(dragged), math.sin(dragged)
    return c * ax + s * ay, c * ay - s * ax, az, turn - dragged


EFFECT = Effect(
    name="yaw_coupling",
    title="drag by yaw",
    meaning="Liquid in a round cup follows a part of the cup's yaw instead of none of it.",
    stages=(Stage.DYNAMICS,),
    equation=(
        r"\dot q|_{\mathrm{drag}} = \kappa\dot\psi\,\hat z\times q,\quad"
        r"\ddot q|_{\mathrm{drag}} = \kappa\dot\psi\,\hat z\times\dot q"
    ),
    source="wall friction and inserts that turn the liquid; the wave's axes turn by a part of ψ",
    sections=(ROUND, REVOLVED),
    parameters=(
        Parameter(
            name="kappa",
            unit="1",
            lower=-1.0,
            upper=1.0,
            neutral=0.0,
            description="fraction of the container's yaw that the wave follows",
            plausible=(0.0, 1.0),
            starts=(0.2, 0.8),
        ),
    ),
    order=90,  # the modal axes change for all that comes after
    needs_rotation=True,
    drive=_drive,
)
