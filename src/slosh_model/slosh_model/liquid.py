"""The liquid."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_model.checks import within


@dataclass(frozen=True, slots=True)
class Liquid:
    """A Newtonian liquid; the defaults are water at 20 °C.

    Attributes:
        density: ρ [kg/m³].
        kinematic_viscosity: ν [m²/s].
    """

    density: float = 998.2
    kinematic_viscosity: float = 1.0e-6

    def __post_init__(self) -> None:
        within("liquid.density", self.density, "kg/m³", 1.0, 3e4)
        within("liquid.kinematic_viscosity", self.kinematic_viscosity, "m²/s", 1e-9, 1.0)
