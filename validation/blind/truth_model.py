"""What the truth simulator simulates: a cup and what acts in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from slosh_model.liquid import Liquid
from slosh_model.model import EffectUse, Model
from slosh_model.shapes.cylinder import Cylinder

Array = NDArray[np.float64]
Parameters = Mapping[str, float]

OUTSIDE = (
    "damping_drift",
    "cubic_spring",
    "coriolis",
    "accel_compression",
    "damping_growth",
    "gain_drift",
)
"""What the truth can do and no listed effect does."""


@dataclass(frozen=True, slots=True)
class Truth:
    """A cup of liquid and everything that acts.

    Attributes:
        radius: R [m].
        fill_height: h [m].
        viscosity: kinematic [m²/s].
        damping_ratio: ζ of the first mode; None: the empirical formula.
        effects: parameters by effect, those of the base model too (`vertical_acceleration`,
            `surface_nonlinearity`, `gravity_tilt`).
    """

    radius: float
    fill_height: float
    viscosity: float = 1.0e-6
    damping_ratio: float | None = None
    effects: Mapping[str, Parameters] = field(default_factory=dict)

    def has(self, effect: str) -> bool:
        """Whether the effect acts."""
        return effect in self.effects

    def value(self, effect: str, parameter: str, neutral: float) -> float:
        """A parameter's value; neutral where the effect does not act."""
        return self.effects.get(effect, {}).get(parameter, neutral)

    def growth(self, effect: str, session_time: float, elapsed: Array) -> Array:
        """By which factor an effect has grown since the session, or each motion, began."""
        by_session, by_motion = (self.value(effect, key, 0.0) for key in ("session", "motion"))
        exponent = by_session * (session_time + elapsed) + by_motion * elapsed
        return np.asarray(self.value(effect, "start", 1.0) * np.exp(exponent))

    def plus(self, effect: str, parameters: Parameters) -> Truth:
        """The same with one more effect."""
        return replace(self, effects={**self.effects, effect: dict(parameters)})

    def without(self, *effects: str) -> Truth:
        """The same without these effects."""
        kept = {name: value for name, value in self.effects.items() if name not in effects}
        return replace(self, effects=kept)

    def as_model(self) -> Model:
        """The model that the workflow is given; effects outside the list are left out."""
        return Model(
            container=Cylinder(self.radius, self.fill_height),
            liquid=Liquid(kinematic_viscosity=self.viscosity),
            damping_ratio=self.damping_ratio,
            effects=tuple(
                EffectUse(name, dict(value))
                for name, value in self.effects.items()
                if name not in OUTSIDE
            ),
        )
