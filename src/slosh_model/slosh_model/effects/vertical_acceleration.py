"""Effect: vertical acceleration changes the effective gravity (model class 3D)."""

from __future__ import annotations

from slosh_model.constants import GRAVITY
from slosh_model.effects.base import Effect, Stage, compiled
from slosh_model.indices import AZ, FREQUENCY, FREQUENCY_RATIO, X, Y


@compiled
def _term(mode, elapsed, q, inputs, p):  # type: ignore[no-untyped-def]
    stiffness = mode[FREQUENCY] * mode[FREQUENCY] * inputs[AZ] / GRAVITY
    across = stiffness * mode[FREQUENCY_RATIO] * mode[FREQUENCY_RATIO]
    return -stiffness * q[X], -across * q[Y], 0.0, 0.0, 0.0


EFFECT = Effect(
    name="vertical_acceleration",
    title="vertical acceleration",
    meaning=(
        "While the container is accelerated upwards gravity is stronger and the liquid stiffer."
    ),
    stages=(Stage.DYNAMICS,),
    equation=r"\ddot q + \dots + \frac{\ddot z_0}{g}\,\omega^2 q = 0",
    source="DL22, eqs. (14), (15)",
    term=_term,
)
