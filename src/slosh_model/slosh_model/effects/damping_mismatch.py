"""Effect: the real damping differs from that of the model."""

from __future__ import annotations

from dataclasses import replace

from slosh_model.effects.base import Effect, Parameter, Parameters, Stage
from slosh_model.modes import Mode

_LIMIT = 0.99


def _modes(modes: tuple[Mode, ...], parameters: Parameters) -> tuple[Mode, ...]:
    factor = parameters["factor"]
    return tuple(
        replace(mode, damping_ratio=min(factor * mode.damping_ratio, _LIMIT)) for mode in modes
    )


EFFECT = Effect(
    name="damping_mismatch",
    title="damping mismatch",
    meaning="Waves decay faster or slower than in the model, equally at all heights.",
    stages=(Stage.DYNAMICS,),
    equation=r"\zeta \to k\,\zeta",
    source="DL22, eq. (12); measured decays: Ibrahim 2005, ch. 3",
    parameters=(
        Parameter(
            name="factor",
            unit="1",
            lower=0.0,
            upper=30.0,
            neutral=1.0,
            description="damping ratio relative to the model's",
            plausible=(0.0, 8.0),
            expected=1.0,
            starts=(0.5, 1.5, 4.0),
        ),
    ),
    order=20,
    modes=_modes,
)
