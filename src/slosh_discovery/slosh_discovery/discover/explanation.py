"""An explanation: effects that are added to a model, with the parameters that are free."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slosh_model.effects.base import Effect, Parameter
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.model import Model

Array = NDArray[np.float64]

PRIOR_VARIANCE = 1.0 / 12.0
"""Of a parameter that lies anywhere within its plausible width, in squares of that width."""
LEAST_FILL = 0.1
"""A fit leaves at least this share of the fill height in the container."""


@dataclass(frozen=True)
class Explanation:
    """Effects in addition to a base model; an effect that the base has already is fitted anew.

    Attributes:
        base: the model that they are added to.
        effects: their ids, in alphabetical order.
        chosen: values of those parameters that choose between variants, by (effect, parameter).
    """

    base: Model
    effects: tuple[str, ...] = ()
    chosen: Mapping[tuple[str, str], float] = field(default_factory=dict)

    @cached_property
    def free(self) -> tuple[tuple[Effect, Parameter], ...]:
        """The parameters that a fit may change, in the order of its vectors."""
        return tuple(
            (EFFECTS[name], parameter)
            for name in self.effects
            for parameter in EFFECTS[name].parameters
            if parameter.choices is None
        )

    @cached_property
    def widths(self) -> Array:
        """(P,) how far each free parameter plausibly spreads."""
        ranges = (plausible(parameter) for _, parameter in self.free)
        return np.array([high - low for low, high in ranges])

    @cached_property
    def spreads(self) -> Array:
        """(P,) standard deviation of each free parameter, before any data."""
        even = self.widths * math.sqrt(PRIOR_VARIANCE)
        told = [parameter.spread for _, parameter in self.free]
        return np.array([e if t is None else t for e, t in zip(even.tolist(), told, strict=True)])

    @cached_property
    def centres(self) -> Array:
        """(P,) what each free parameter is expected to be, before any data."""
        return np.array([_centre(parameter) for _, parameter in self.free])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """(P,), (P,) lower and upper bounds."""
        lower = np.array([parameter.lower for _, parameter in self.free])
        upper = np.array([parameter.upper for _, parameter in self.free])
        least_delta = (LEAST_FILL - 1.0) * self.base.container.fill_height
        for index, (effect, parameter) in enumerate(self.free):
            if (effect.name, parameter.name) == ("fill_level", "delta"):
                lower[index] = max(lower[index], least_delta)
        return lower, upper

    def model(self, vector: Array) -> Model | None:
        """The base with these effects; None where the parameters are impossible."""
        parameters: dict[str, dict[str, float]] = {name: {} for name in self.effects}
        for (effect, parameter), value in zip(self.free, vector.tolist(), strict=True):
            parameters[effect.name][parameter.name] = value
        for (name, parameter_name), value in self.chosen.items():
            parameters[name][parameter_name] = value
        model = self.base
        try:
            for name, values in parameters.items():
                model = model.with_effect(name, **values)
        except SloshModelError:
            return None
        return model

    def with_effect(self, name: str, chosen: Mapping[str, float]) -> Explanation:
        """One more effect, with its choices."""
        return Explanation(
            self.base,
            tuple(sorted((*self.effects, name))),
            {**self.chosen, **{(name, key): value for key, value in chosen.items()}},
        )

    def without(self, name: str) -> Explanation:
        """One effect less."""
        return Explanation(
            self.base,
            tuple(effect for effect in self.effects if effect != name),
            {key: value for key, value in self.chosen.items() if key[0] != name},
        )

    def part(self, vector: Array, name: str) -> dict[str, float]:
        """One effect's parameters out of a vector, its choices included."""
        values = {
            parameter.name: value
            for (effect, parameter), value in zip(self.free, vector.tolist(), strict=True)
            if effect.name == name
        }
        chosen = {key[1]: value for key, value in self.chosen.items() if key[0] == name}
        return {**values, **chosen}

    def vector(self, parts: Mapping[str, Mapping[str, float]]) -> Array:
        """The vector of parameters given by effect."""
        return np.array([parts[effect.name][parameter.name] for effect, parameter in self.free])


def starts(name: str) -> Iterator[tuple[dict[str, float], dict[str, float]]]:
    """Where a fit of an effect may start: its free parameters and its choices."""
    parameters = EFFECTS[name].parameters
    values = [
        parameter.choices or parameter.starts or (_centre(parameter),) for parameter in parameters
    ]
    for combination in itertools.product(*values):
        pairs = list(zip(parameters, combination, strict=True))
        yield (
            {parameter.name: value for parameter, value in pairs if parameter.choices is None},
            {parameter.name: value for parameter, value in pairs if parameter.choices},
        )


def plausible(parameter: Parameter) -> tuple[float, float]:
    """Where a parameter usually lies."""
    return parameter.plausible or (parameter.lower, parameter.upper)


def _centre(parameter: Parameter) -> float:
    low, high = plausible(parameter)
    neutral = parameter.neutral
    if neutral is not None and low <= neutral <= high and math.isfinite(neutral):
        return neutral
    if parameter.default is not None and parameter.choices is None:
        return parameter.default
    return 0.5 * (low + high)
