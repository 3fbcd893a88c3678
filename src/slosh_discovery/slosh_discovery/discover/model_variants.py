"""A model with each of its parameters a little off: in which direction a refit goes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.model import Model

WIDTH_CHANGE = 0.003
"""Relative change of the container's width: 0.15 % of the natural frequency."""
DAMPING_CHANGE = 0.03
"""Relative change of the damping."""
PARAMETER_CHANGE = 0.03
"""Change of an effect's parameter, in units of its distance from neutral, at least 0.1 % of the
bounds' span."""


def variants_of(model: Model) -> Iterator[Model]:
    """Models with the natural frequency, the damping or one parameter of an effect changed."""
    wider = model.container.widened(1.0 + WIDTH_CHANGE)
    if model.natural_frequency is None:
        yield replace(model, container=wider)
    else:
        slower = wider.natural_frequency(1) / model.container.natural_frequency(1)
        yield replace(model, natural_frequency=slower * model.natural_frequency)
    damping = model.mode_constants()[0].damping_ratio
    yield replace(model, damping_ratio=min(damping * (1.0 + DAMPING_CHANGE), 0.99))
    for use in model.effects:
        for parameter in EFFECTS[use.name].parameters:
            if parameter.choices is not None:
                continue
            value = use.parameters[parameter.name]
            span = parameter.upper - parameter.lower
            reference = value - (parameter.neutral or 0.0)
            step = max(PARAMETER_CHANGE * abs(reference), 0.001 * span)
            for moved in (value + step, value - step):
                try:
                    yield model.with_effect(use.name, **{**use.parameters, parameter.name: moved})
                except SloshModelError:
                    continue
                break
