"""Effect: the height sensor acts as a first-order low-pass filter."""

from __future__ import annotations

import math

from slosh_model.effects.base import Effect, Parameter, Stage, compiled


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    # memory: whether there was a height, that height, and what was read of it.
    before, read = memory[1], memory[2]
    if memory[0] == 0.0 or p[0] <= 0.0:
        read = eta
    elif dt > 0.0:
        # Exact for a height that is straight between two samples: behind a ramp the reading
        # stays by `late`, and what it is off from there decays.
        late = (eta - before) / dt * p[0]
        read = eta - late + (read - before + late) * math.exp(-dt / p[0])
    memory[0], memory[1], memory[2] = 1.0, eta, read
    return read


EFFECT = Effect(
    name="sensor_lag",
    title="slow sensor",
    meaning="The sensor follows the height as a first-order low pass: late, and lower if quick.",
    stages=(Stage.MEASUREMENT,),
    equation=r"T\,\dot\eta_{\mathrm{measured}} + \eta_{\mathrm{measured}} = \eta",
    source="first-order low pass of a level sensor or of its smoothing",
    of_rig=True,
    parameters=(
        Parameter(
            name="time",
            unit="s",
            lower=0.0,
            upper=1.0,
            neutral=0.0,
            description="time constant of the low pass",
            plausible=(0.0, 0.1),
            starts=(0.005, 0.02, 0.05),
        ),
    ),
    order=85,  # of what the frame's edge has left of the height
    reading=_reading,
    reading_memory=3,
)
