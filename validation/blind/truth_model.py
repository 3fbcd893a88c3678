"""Parameters of the simulated true liquid: a cup and the effects that act in it."""

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
    """A cup of liquid with the effects that act in it, for the truth simulator.

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
        """Returns whether an effect acts."""
        return effect in self.effects

    def value(self, effect: str, parameter: str, neutral: float) -> float:
        """Returns a parameter of an effect, or a neutral value if the effect does not act."""
        return self.effects.get(effect, {}).get(parameter, neutral)

    def growth(self, effect: str, session_time: float, elapsed: Array) -> Array:
        """Returns the factor by which an effect has grown since its recordings or motion began."""
        by_session, by_motion = (self.value(effect, key, 0.0) for key in ("session", "motion"))
        exponent = by_session * (session_time + elapsed) + by_motion * elapsed
        return np.asarray(self.value(effect, "start", 1.0) * np.exp(exponent))

    def plus(self, effect: str, parameters: Parameters) -> Truth:
        """Returns a copy with one more effect."""
        return replace(self, effects={**self.effects, effect: dict(parameters)})

    def without(self, *effects: str) -> Truth:
        """Returns a copy without the named effects."""
        kept = {name: value for name, value in self.effects.items() if name not in effects}
        return replace(self, effects=kept)

    def as_model(self) -> Model:
        """Returns the model for the discovery, without effects that it does not know."""
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
