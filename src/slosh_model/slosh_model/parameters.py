"""Accesses a model's parameters by their names in model.yaml."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from slosh_model.errors import SloshModelError
from slosh_model.model import Model

DAMPING, FREQUENCY = "damping_ratio", "natural_frequency"
FILL_HEIGHT = "container.fill_height"


def parameter_value(model: Model, name: str) -> float:
    """Returns a parameter of the model; computes it if the model file does not give it.

    Raises:
        SloshModelError: the model has no such parameter.
    """
    if name == DAMPING:
        return replace(model, effects=()).mode_constants()[0].damping_ratio
    if name == FREQUENCY:
        return model.mode_frequency(1)
    if name == FILL_HEIGHT:
        return model.container.fill_height
    effect, _, parameter = name.partition(".")
    for use in model.effects:
        if use.name == effect and parameter in use.parameters:
            return use.parameters[parameter]
    raise SloshModelError(f"the model has no parameter {name!r:.60}")


def with_parameters(model: Model, values: Mapping[str, float]) -> Model:
    """Returns the model with given parameter values.

    Args:
        model: the model; an effect that it lacks is added, where all its parameters are given or
            have defaults.
        values: by name.

    Raises:
        SloshModelError: together they are impossible.
    """
    effects: dict[str, dict[str, float]] = {}
    present = {use.name: use.parameters for use in model.effects}
    for name, value in values.items():
        if name == DAMPING:
            model = replace(model, damping_ratio=value)
        elif name == FREQUENCY:
            model = replace(model, natural_frequency=value)
        elif name == FILL_HEIGHT:
            model = replace(
                model, container=model.container.filled_to(value, model.container.rim_height)
            )
        else:
            effect, _, parameter = name.partition(".")
            effects.setdefault(effect, dict(present.get(effect, {})))[parameter] = value
    for effect, parameters in effects.items():
        model = model.with_effect(effect, **parameters)
    return model
