"""Effect: the stamps of the measured heights are late or early by a constant time."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Parameters, Stage


def _delay(parameters: Parameters) -> float:
    return parameters["tau"]


EFFECT = Effect(
    name="time_offset",
    title="time offset",
    meaning="Heights are stamped too late or too early by a constant time.",
    stages=(Stage.MEASUREMENT,),
    equation=r"\eta(t) \to \eta(t - \tau)",
    source="delay between exposure and stamp; clocks that are not one",
    of_rig=True,
    parameters=(
        Parameter(
            name="tau",
            unit="s",
            lower=-1.0,
            upper=1.0,
            neutral=0.0,
            description="by how much the measurement is late",
            plausible=(-0.15, 0.15),
            spread=0.04,  # one or two images, a bus, a filter
            starts=(-0.08, -0.02, 0.02, 0.08),
        ),
    ),
    order=90,
    delay=_delay,
)
