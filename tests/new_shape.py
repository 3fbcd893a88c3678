"""A shape of container that a user adds: one class in one file."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Self

from slosh_model.containers import ROUND, Container
from slosh_model.limits import ValidityLimits
from slosh_model.shapes.cylinder import Cylinder


@dataclass(frozen=True)
class Tub(Container):
    """A cylinder defined by its diameter, as an example of a user's own shape."""

    shape: ClassVar[str] = "tub"
    section: ClassVar[str] = ROUND
    nonlinear_effect: ClassVar[str] = "surface_nonlinearity"
    built_in: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType({})
    straight_alone: ClassVar[bool] = False
    validated: ClassVar[ValidityLimits] = ValidityLimits()

    diameter: float
    fill_height: float
    rim_height: float | None = None

    @property
    def _cylinder(self) -> Cylinder:
        return Cylinder(self.diameter / 2.0, self.fill_height, self.rim_height)

    @property
    def size(self) -> float:
        return self.diameter

    @property
    def size_name(self) -> str:
        return "diameter"

    @property
    def reaches(self) -> tuple[float, float]:
        return self._cylinder.reaches

    @property
    def described(self) -> str:
        return f"diameter {1e3 * self.diameter:g} mm"

    def root(self, n: int) -> float:
        return self._cylinder.root(n)

    def mass_ratio(self, n: int, axis: int = 0) -> float:
        return self._cylinder.mass_ratio(n, axis)

    def plane_gain(self, n: int, axis: int = 0) -> float:
        return self._cylinder.plane_gain(n, axis)

    def curved_gain(self, n: int, axis: int = 0) -> float:
        return self._cylinder.curved_gain(n, axis)

    def widened(self, factor: float) -> Self:
        return replace(self, diameter=self.diameter * factor)

    def damping_ratio(self, kinematic_viscosity: float) -> float:
        return self._cylinder.damping_ratio(kinematic_viscosity)
