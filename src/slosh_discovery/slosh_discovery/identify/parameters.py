"""Parameters that can be fitted: damping, frequency, fill height, those of modelled effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from slosh_base.files.nearest import did_you_mean
from slosh_discovery.discover.explanation import plausible
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.identify.tuning import TUNING
from slosh_model.effects.base import Parameter
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.parameters import (
    DAMPING,
    FILL_HEIGHT,
    FREQUENCY,
    parameter_value,
    with_parameters,
)

_OF_THE_MODEL = (DAMPING, FREQUENCY, FILL_HEIGHT)
DEFAULT = (FREQUENCY, DAMPING)
"""What every container has and no formula knows exactly."""
ALIASES = {"p": "accel_gain.gain", "fill_height": FILL_HEIGHT}
"""TM20's factor p of the acceleration is ω₀²/g times the gain (eq. (10))."""


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """A model parameter that an identification fits.

    Attributes:
        name: as in model.yaml: `damping_ratio`, `natural_frequency`, `container.fill_height`,
            `EFFECT.PARAMETER`.
        unit: SI unit, "1" for none.
        start: where the fit begins.
        lower, upper: bounds.
        width: what is known of it before any data: it lies about so far from its start. Motions
            that tell no more do not identify it.
    """

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    width: float


def free_parameters(model: Model, names: Sequence[str]) -> tuple[FreeParameter, ...]:
    """Returns the named parameters, with initial values from the model.

    Raises:
        SloshDiscoveryError: none of a name, a name twice, or none at all.
    """
    if not names:
        raise SloshDiscoveryError("no parameter to fit; name one (--fit)")
    full = [ALIASES.get(name, name) for name in names]
    for index, name in enumerate(full):
        if name in full[:index]:
            raise SloshDiscoveryError(f"--fit names {name} twice")
    return tuple(_parameter(model, name) for name in full)


def fitted_model(model: Model, values: Mapping[str, float]) -> Model | None:
    """Returns the model with given parameter values, or None if they are impossible."""
    named = {name.partition(".")[0] for name in values if name not in _OF_THE_MODEL}
    try:
        for effect in named:
            if not model.has(effect):
                model = model.with_effect(effect, **_values(model, effect))
        return with_parameters(model, values)
    except SloshModelError:
        return None


def _parameter(model: Model, name: str) -> FreeParameter:
    if name == DAMPING:
        start = parameter_value(model, DAMPING)
        return FreeParameter(
            name, "1", start, 0.0, TUNING.most_damping, max(TUNING.damping_width, start)
        )
    if name == FREQUENCY:
        start = model.mode_frequency(1)
        low, high = start / TUNING.frequency_span, start * TUNING.frequency_span
        return FreeParameter(name, "rad/s", start, low, high, TUNING.frequency_width * start)
    if name == FILL_HEIGHT and model.container.digest:
        raise SloshDiscoveryError(
            f"--fit fill_height: a {model.container.shape}'s modes are computed for its fill "
            f"height alone; fit {FREQUENCY} instead"
        )
    if name == FILL_HEIGHT:
        start, rim = model.container.fill_height, model.container.rim_height
        high = min(start * TUNING.fill_span, math.inf if rim is None else math.nextafter(rim, 0.0))
        return FreeParameter(
            name, "m", start, start / TUNING.fill_span, high, TUNING.fill_width * start
        )
    return _effect_parameter(model, name)


def _effect_parameter(model: Model, name: str) -> FreeParameter:
    effect, _, wanted = name.partition(".")
    parameters = EFFECTS[effect].parameters if effect in EFFECTS else ()
    parameter = next((entry for entry in parameters if entry.name == wanted), None)
    if parameter is None or parameter.choices is not None:
        known = [*ALIASES, *DEFAULT, FILL_HEIGHT, "EFFECT.PARAMETER of docs/effects"]
        every = [
            *known[:-1],
            *(f"{one}.{p.name}" for one in EFFECTS for p in EFFECTS[one].parameters),
        ]
        raise SloshDiscoveryError(
            f"--fit {name!r:.60}: no such parameter (known: {', '.join(known)})"
            + did_you_mean(name, every)
        )
    low, high = plausible(parameter)
    start = _values(model, effect)[wanted]
    width = 0.5 * (high - low)
    return FreeParameter(name, parameter.unit, start, parameter.lower, parameter.upper, width)


def _values(model: Model, effect: str) -> dict[str, float]:
    """Returns an effect's parameters; nearly neutral values if the model lacks the effect."""
    for use in model.effects:
        if use.name == effect:
            return dict(use.parameters)
    return {entry.name: _quiet(entry) for entry in EFFECTS[effect].parameters}


def _quiet(parameter: Parameter) -> float:
    if parameter.neutral is not None and math.isfinite(parameter.neutral):
        return parameter.neutral
    if parameter.default is not None:
        return parameter.default
    low, high = plausible(parameter)
    return 0.5 * (low + high)
