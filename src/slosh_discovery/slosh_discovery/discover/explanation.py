"""A candidate model: physical effects with free parameters, added to the base model."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.tuning import TUNING
from slosh_model.effects.base import Effect, Parameter
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.model import EffectUse, Model

PRIOR_VARIANCE = 1.0 / 12.0
"""Of a parameter that lies anywhere within its plausible width, in squares of that width."""


Key = tuple[tuple[str, ...], tuple[str, ...]]
"""What tells explanations apart: their effects, and those of them that are fitted per group."""

Part = Callable[[str, str | None], Mapping[str, float]]
"""(effect, group) -> its parameters; group None: of all."""


class Free(NamedTuple):
    """A free parameter of a fit: effect, parameter, and group of motions.

    Attributes:
        effect, parameter: whose it is.
        group: of the motions for which it holds; None: for all.
    """

    effect: Effect
    parameter: Parameter
    group: str | None


@dataclass(frozen=True)
class Explanation:
    """Physical effects added to a base model; effects that the base has are fitted again.

    Attributes:
        base: the model that they are added to.
        effects: their ids, in alphabetical order.
        chosen: values of those parameters that choose between variants, by (effect, parameter).
        groups: of the motions, in alphabetical order; empty: they belong together.
        per_group: ids of those effects whose parameters each group has its own of.
    """

    base: Model
    effects: tuple[str, ...] = ()
    chosen: Mapping[tuple[str, str], float] = field(default_factory=dict)
    groups: tuple[str, ...] = ()
    per_group: tuple[str, ...] = ()

    @property
    def key(self) -> Key:
        """Key that identifies a candidate model among those of the same base model."""
        return self.effects, self.per_group

    @cached_property
    def free(self) -> tuple[Free, ...]:
        """The free parameters of the candidate model, in the order of the parameter vector."""
        return tuple(
            Free(EFFECTS[name], parameter, group)
            for name in self.effects
            for group in (self.groups if name in self.per_group else (None,))
            for parameter in EFFECTS[name].parameters
            if parameter.choices is None
        )

    @cached_property
    def widths(self) -> Array:
        """Width (P,) of each free parameter's plausible range."""
        ranges = (plausible(one.parameter) for one in self.free)
        return np.array([high - low for low, high in ranges])

    @cached_property
    def spreads(self) -> Array:
        """Prior standard deviation (P,) of each free parameter."""
        even = self.widths * math.sqrt(PRIOR_VARIANCE)
        told = [one.parameter.spread for one in self.free]
        return np.array([e if t is None else t for e, t in zip(even.tolist(), told, strict=True)])

    @cached_property
    def centres(self) -> Array:
        """Prior mean (P,) of each free parameter's probability distribution."""
        return np.array([_centre(one.parameter) for one in self.free])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Returns lower and upper bounds (P,) of the free parameters."""
        lower = np.array([one.parameter.lower for one in self.free])
        upper = np.array([one.parameter.upper for one in self.free])
        least_delta = (TUNING.least_fill - 1.0) * self.base.container.fill_height
        for index, (effect, parameter, _) in enumerate(self.free):
            if (effect.name, parameter.name) == ("fill_level", "delta"):
                lower[index] = max(lower[index], least_delta)
        return lower, upper

    def model(self, vector: Array, group: str | None = None) -> Model | None:
        """Returns the candidate model for a group of motions; None for impossible parameters.

        Args:
            vector: (P,) the free parameters.
            group: None: without the effects that each group has its own parameters of.

        Returns:
            None where the parameters are impossible.
        """
        names = [name for name in self.effects if group is not None or name not in self.per_group]
        try:
            uses = (EffectUse(name, self.part(vector, name, group)) for name in names)
            return self.base.with_effects(*uses)
        except SloshModelError:
            return None

    def with_effect(
        self, name: str, chosen: Mapping[str, float], *, per_group: bool = False
    ) -> Explanation:
        """Returns a copy with one more physical effect, in a chosen variant."""
        return replace(
            self,
            effects=tuple(sorted((*self.effects, name))),
            chosen={**self.chosen, **{(name, key): value for key, value in chosen.items()}},
            per_group=tuple(sorted((*self.per_group, name))) if per_group else self.per_group,
        )

    def without(self, name: str) -> Explanation:
        """Returns a copy of the candidate model without one physical effect."""
        return self.only(tuple(effect for effect in self.effects if effect != name))

    def only(self, names: Sequence[str]) -> Explanation:
        """Returns a copy of the candidate model with only the named physical effects."""
        return replace(
            self,
            effects=tuple(effect for effect in self.effects if effect in names),
            chosen={key: value for key, value in self.chosen.items() if key[0] in names},
            per_group=tuple(effect for effect in self.per_group if effect in names),
        )

    def shared(self, name: str) -> Explanation:
        """Returns a copy in which all groups of motions share the parameters of one effect."""
        return replace(self, per_group=tuple(e for e in self.per_group if e != name))

    def simpler(self) -> list[Explanation]:
        """Returns copies with one effect removed, or with one effect equal in all groups."""
        less = [self.without(name) for name in self.effects]
        return [*less, *(self.shared(name) for name in self.per_group)]

    def part(self, vector: Array, name: str, group: str | None = None) -> dict[str, float]:
        """Returns a physical effect's parameters from a parameter vector, with its variant.

        Args:
            vector: (P,).
            name: of the effect.
            group: whose parameters; without meaning where they are those of all groups.
        """
        values = {
            one.parameter.name: value
            for one, value in zip(self.free, vector.tolist(), strict=True)
            if one.effect.name == name and one.group in (None, group)
        }
        chosen = {key[1]: value for key, value in self.chosen.items() if key[0] == name}
        return {**values, **chosen}

    def vector(self, part: Part) -> Array:
        """Returns the parameter vector (P,) for given parameters by effect and group."""
        return np.array(
            [part(one.effect.name, one.group)[one.parameter.name] for one in self.free]
        )


def starts(name: str) -> Iterator[tuple[dict[str, float], dict[str, float]]]:
    """Yields initial values of a physical effect's free parameters for each of its variants."""
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
    """Returns the plausible range of a parameter, lower and upper end."""
    return parameter.plausible or (parameter.lower, parameter.upper)


def _centre(parameter: Parameter) -> float:
    low, high = plausible(parameter)
    if parameter.expected is not None:
        return parameter.expected
    neutral = parameter.neutral
    if neutral is not None and low <= neutral <= high and math.isfinite(neutral):
        return neutral
    if parameter.default is not None and parameter.choices is None:
        return parameter.default
    return 0.5 * (low + high)
