"""Effect: liquid is lost during the motion, so that the fill height falls."""

from __future__ import annotations

import math

from slosh_model.constants import GRAVITY
from slosh_model.containers import RECTANGULAR, ROUND
from slosh_model.effects.base import Effect, Parameter, Stage, compiled
from slosh_model.indices import (
    DAMPING,
    FILL,
    FREQUENCY,
    FREQUENCY_RATIO,
    GAIN,
    GAIN_Y,
    RADIUS,
    RADIUS_Y,
    WALL_ELAPSED,
    XI,
)

_SHALLOW = 0.02  # of R; below, the model of standing waves has lost its sense


@compiled
def _modulation(mode, elapsed, p):  # type: ignore[no-untyped-def]
    omega, radius, xi, height = mode[FREQUENCY], mode[RADIUS], mode[XI], mode[FILL]
    now = max(height - p[0] * elapsed, _SHALLOW * radius)
    # ω² and the gains of a shape are proportional to tanh(ξ h/R).
    factor = math.tanh(xi * now / radius) / math.tanh(xi * height / radius)
    omega_now = omega * math.sqrt(factor)
    radius_y = mode[RADIUS_Y]
    factor_y = factor
    if radius_y != radius:
        factor_y = math.tanh(xi * now / radius_y) / math.tanh(xi * height / radius_y)
    return (
        omega_now, mode[DAMPING], omega_now * omega_now * radius / GRAVITY, radius,
        mode[GAIN] * factor, xi, now,
        mode[FREQUENCY_RATIO] * math.sqrt(factor_y / factor), radius_y, mode[GAIN_Y] * factor_y,
    )  # fmt: skip


@compiled
def _reading(dt, eta, wall, memory, p):  # type: ignore[no-untyped-def]
    return eta - p[1] * p[0] * wall[WALL_ELAPSED]


EFFECT = Effect(
    name="fill_loss",
    title="loss of liquid",
    meaning="Liquid is lost during the motion: the still level falls at a constant rate.",
    stages=(Stage.DYNAMICS, Stage.HEIGHT),
    equation=r"h(t) = h - \dot h\,t",
    source="DL22, eqs. (3), (4), Tables 1 and 2 with the momentary h",
    sections=(ROUND, RECTANGULAR),
    instead="compare models of two fill heights",
    parameters=(
        Parameter(
            name="rate",
            unit="m/s",
            lower=0.0,
            upper=0.05,
            neutral=0.0,
            description="speed at which the still level falls",
            plausible=(0.0, 0.01),
            starts=(0.001, 0.004),
        ),
        Parameter(
            name="fixed_zero",
            unit="1",
            lower=0.0,
            upper=1.0,
            neutral=None,
            description=(
                "1 where measured heights are above the level at the start, 0 where they are "
                "above the momentary one"
            ),
            default=0.0,
            choices=(0.0, 1.0),
        ),
    ),
    modulation=_modulation,
    reading=_reading,
    order=40,  # as a reading: before any property of the sensor
)
