"""Effect: the real fill height differs from that of the model."""

from __future__ import annotations

from dataclasses import replace

from slosh_model.effects.base import Effect, Parameter, Parameters, Stage
from slosh_model.modes import Mode


def _modes(modes: tuple[Mode, ...], parameters: Parameters) -> tuple[Mode, ...]:
    container = modes[0].container
    # Where the rim is does not matter to the modes.
    filled = container.filled_to(container.fill_height + parameters["delta"], None)
    return tuple(replace(mode, container=filled) for mode in modes)


EFFECT = Effect(
    name="fill_level",
    title="fill level",
    meaning="The container holds more or less liquid than the model assumes.",
    stages=(Stage.DYNAMICS, Stage.HEIGHT),
    equation=r"h \to h + \delta",
    source="DL22, eqs. (3), (4), Tables 1 and 2 with the changed h",
    of_rig=True,
    parameters=(
        Parameter(
            name="delta",
            unit="m",
            lower=-1.0,
            upper=1.0,
            neutral=0.0,
            description="liquid above the model's fill height",
            plausible=(-0.03, 0.03),
            spread=0.008,  # a ruler, a meniscus, a cup filled by eye
            starts=(-0.015, 0.015),
        ),
    ),
    order=10,
    modes=_modes,
)
