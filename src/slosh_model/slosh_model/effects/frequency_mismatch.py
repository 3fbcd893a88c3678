"""Effect: the natural frequencies differ from those of the ideal container."""

from __future__ import annotations

from dataclasses import replace

from slosh_model.effects.base import Effect, Parameter, Parameters, Stage
from slosh_model.modes import Mode


def _modes(modes: tuple[Mode, ...], parameters: Parameters) -> tuple[Mode, ...]:
    factor = parameters["factor"]
    return tuple(replace(mode, frequency_factor=factor * mode.frequency_factor) for mode in modes)


EFFECT = Effect(
    name="frequency_mismatch",
    title="frequency mismatch",
    meaning=(
        "The liquid swings a little faster or slower than in the ideal container of that size and "
        "fill."
    ),
    stages=(Stage.DYNAMICS, Stage.HEIGHT),
    equation=r"\omega_n \to k\,\omega_n,\quad \bar\eta_n \to k^2\,\bar\eta_n",
    source=(
        "a container that is not quite the ideal one of DL22, eq. (3), and TM20, eq. (20): what "
        "TM20 identified (Tables 2 and 4) is 1.5 % below to 0.3 % above eq. (20); a constant "
        "acceleration still tilts the surface alike"
    ),
    parameters=(
        Parameter(
            name="factor",
            unit="1",
            lower=0.5,
            upper=2.0,
            neutral=1.0,
            description="true natural frequency of every mode relative to the model's",
            plausible=(0.9, 1.1),
            spread=0.02,  # walls that lean, a rounded floor, something in the liquid
            starts=(0.98, 1.02),
        ),
    ),
    order=20,  # of the container as it is filled
    odds=0.05,  # mostly such a frequency has a cause that another effect names
    modes=_modes,
)
