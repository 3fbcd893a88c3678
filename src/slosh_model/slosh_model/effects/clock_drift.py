"""Effect: the clock of the measured heights runs faster or slower than that of the inputs."""

from __future__ import annotations

from slosh_model.effects.base import Effect, Parameter, Parameters, Stage


def _delay(parameters: Parameters) -> float:
    return parameters["offset"]


def _drift(parameters: Parameters) -> float:
    return parameters["rate"]


EFFECT = Effect(
    name="clock_drift",
    title="clock drift",
    meaning="The clock that stamps the heights runs faster or slower than that of the inputs.",
    stages=(Stage.MEASUREMENT,),
    equation=(
        r"t_{\mathrm{stamped}} = t + b + r\,t \quad\Rightarrow\quad "
        r"\eta(t) \to \eta\!\left(\frac{t - b}{1 + r}\right)"
    ),
    source="stamps counted from a nominal frame rate (30 for 29.97 Hz); clocks never synchronised",
    of_rig=True,
    parameters=(
        Parameter(
            name="rate",
            unit="1",
            lower=-0.05,
            upper=0.05,
            neutral=0.0,
            description="by how much the heights' clock gains per second of the inputs' clock",
            plausible=(-0.03, 0.03),
            spread=0.01,  # frame rates that are rounded; crystals are off by 1e-4 at most
            starts=(-0.015, -0.003, 0.003, 0.015),
        ),
        Parameter(
            name="offset",
            unit="s",
            lower=-1.0,
            upper=1.0,
            neutral=0.0,
            description="by how much the measurement is late at the motion's start",
            default=0.0,
            plausible=(-0.15, 0.15),
            spread=0.04,  # as of a time_offset
        ),
    ),
    order=90,
    odds=0.05,  # mostly a clock that is off is off by a constant time
    delay=_delay,
    drift=_drift,
)
