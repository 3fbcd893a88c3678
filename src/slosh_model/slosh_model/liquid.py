"""Properties of the liquid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from slosh_model.checks import within
from slosh_model.errors import SloshModelError


@dataclass(frozen=True, slots=True)
class Liquid:
    """A Newtonian liquid; the defaults are water at 20 °C.

    >>> from slosh_model import Liquid
    >>> Liquid(density=1260.0, kinematic_viscosity=1.12e-3)  # glycerol
    Liquid(density=1260.0, kinematic_viscosity=0.00112)

    Attributes:
        density: ρ [kg/m³].
        kinematic_viscosity: ν [m²/s].
    """

    density: float = 998.2
    kinematic_viscosity: float = 1.0e-6

    def __post_init__(self) -> None:
        within("liquid.density", self.density, "kg/m³", 1.0, 3e4)
        within("liquid.kinematic_viscosity", self.kinematic_viscosity, "m²/s", 1e-9, 1.0)


LIQUIDS: Mapping[str, Liquid] = MappingProxyType(
    {
        "water": Liquid(),
        "coffee": Liquid(1000.0, 1.03e-6),
        "juice": Liquid(1046.0, 1.4e-6),
        "milk": Liquid(1030.0, 2.0e-6),
        "oil": Liquid(920.0, 7.0e-5),
        "ethanol": Liquid(789.0, 1.5e-6),
        "syrup": Liquid(1316.0, 1.12e-4),
        "glycerine": Liquid(1261.0, 1.12e-3),
    }
)
"""Liquids at 20 °C by name.

Oil is of sunflowers; coffee is black, with 1 % of solids; juice and syrup are solutions of 12 %
and 65 % of sucrose: pulp makes a juice thicker.
"""


def liquid_named(name: str) -> Liquid:
    """Returns a liquid by its name in the table LIQUIDS.

    Raises:
        SloshModelError: there is none of that name.
    """
    if name not in LIQUIDS:
        raise SloshModelError(f"liquid = {name!r} (known: {', '.join(LIQUIDS)})", ("liquid",))
    return LIQUIDS[name]
