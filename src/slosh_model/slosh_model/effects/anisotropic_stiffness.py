"""Effect: the container is not quite round and has two natural frequencies along two axes."""

from __future__ import annotations

import math

from slosh_model.containers import REVOLVED, ROUND
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import FREQUENCY, TURN, X, Y


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    # The axes turn with the container.
    angle = 2.0 * (p[1] + inputs[TURN])
    c, s = math.cos(angle), math.sin(angle)
    stiffness = -p[0] * mode[FREQUENCY] * mode[FREQUENCY]
    return stiffness * (c * q[X] + s * q[Y]), stiffness * (s * q[X] - c * q[Y]), 0.0, 0.0, 0.0


EFFECT = Effect(
    name="anisotropic_stiffness",
    title="anisotropic stiffness",
    meaning=(
        "A cup that is not quite round has two natural frequencies, one along an axis "
        "and one across it."
    ),
    stages=(Stage.DYNAMICS,),
    equation=(
        r"\omega^2 q \to \omega^2\left[1 + e\,(u u^T - v v^T)\right] q,"
        r"\quad u = (\cos\varphi, \sin\varphi),\ v \perp u"
    ),
    source="elliptic and slightly oval tanks: Ibrahim 2005, ch. 2",
    sections=(ROUND, REVOLVED),
    parameters=(
        Parameter(
            name="e",
            unit="1",
            lower=0.0,
            upper=0.5,
            neutral=0.0,
            description="relative difference of the stiffness from the mean",
            plausible=(0.0, 0.15),
            starts=(0.03,),
        ),
        Parameter(
            name="axis",
            unit="rad",
            lower=-3.2,
            upper=3.2,
            neutral=None,
            description="azimuth of the stiff axis from the container's +x",
            default=0.0,
            plausible=(-0.5 * math.pi, 0.5 * math.pi),
            starts=(-1.2, -0.4, 0.4, 1.2),
        ),
    ),
    term=_term,
)
