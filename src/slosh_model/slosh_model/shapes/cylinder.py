"""Upright circular cylinder, with sloshing modes in closed form."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Self

from slosh_model.bessel import bessel_derivative_root
from slosh_model.checks import within
from slosh_model.constants import GRAVITY
from slosh_model.containers import DIMENSIONS, ROUND, X_AXIS, Container
from slosh_model.limits import ValidityLimits

# The damping formula's own rounding of the first root of J1'.
FIRST_ROOT = 1.84


@dataclass(frozen=True, slots=True, repr=False)
class Cylinder(Container):
    """An upright circular cylinder.

    >>> from slosh_model import Cylinder
    >>> cup = Cylinder(radius=0.04, fill_height=0.06, rim_height=0.11)
    >>> cup.size  # m
    0.04

    Attributes:
        radius: inner radius R [m].
        fill_height: height h of the still liquid above the floor [m].
        rim_height: height of the rim above the floor [m]; None: unknown.

    Raises:
        SloshModelError: a dimension is outside DIMENSIONS, or the rim not above the liquid.
    """

    shape: ClassVar[str] = "cylinder"
    section: ClassVar[str] = ROUND
    nonlinear_effect: ClassVar[str] = "surface_nonlinearity"
    built_in: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType({})
    straight_alone: ClassVar[bool] = False
    validated: ClassVar[ValidityLimits] = ValidityLimits()

    radius: float
    fill_height: float
    rim_height: float | None = None

    def __post_init__(self) -> None:
        within("container.radius", self.radius, "m", *DIMENSIONS)
        self._check_heights()

    def root(self, n: int) -> float:
        """Returns ξₙ, the n-th root of J₁′."""
        return bessel_derivative_root(n)

    @property
    def reaches(self) -> tuple[float, float]:
        """Radius, the distance to the wall along both axes [m]."""
        return self.radius, self.radius

    @property
    def volume(self) -> float:
        """Volume πR²h of the liquid [m³]."""
        return math.pi * self.radius**2 * self.fill_height

    @property
    def described(self) -> str:
        """Text that describes the cylinder's dimensions [mm]."""
        return f"radius {1e3 * self.radius:g} mm, filled to {1e3 * self.fill_height:g} mm"

    @property
    def size(self) -> float:
        """Radius of the cylinder [m]."""
        return self.radius

    @property
    def size_name(self) -> str:
        """Name of the characteristic dimension, 'radius'."""
        return "radius"

    def mass_ratio(self, n: int, axis: int = X_AXIS) -> float:
        """Returns mₙ/m_F, the fraction of the liquid's mass in mode n (DL22, eq. (4))."""
        xi = bessel_derivative_root(n)
        slenderness = xi * self.fill_height / self.radius
        return 2.0 * self.depth_factor(n) / (slenderness * (xi**2 - 1.0))

    def plane_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the height gain of a plane surface, 4 h mₙ/(m_F R) (DL22, eq. (22))."""
        slenderness = self.fill_height / self.radius
        return 4.0 * slenderness * self.mass_ratio(n)

    def curved_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the height gain of the Bessel surface, ξₙ² h mₙ/(m_F R) (DL22, eq. (24))."""
        return self.plane_gain(n) * self.root(n) ** 2 / 4.0

    def widened(self, factor: float) -> Self:
        """Returns the cylinder with a scaled radius."""
        return replace(self, radius=self.radius * factor)

    def damping_ratio(self, kinematic_viscosity: float) -> float:
        """Returns the damping ratio ζ₁ of a smooth cylinder by an empirical formula.

        The empirical formula in Ibrahim, *Liquid Sloshing Dynamics* (2005), and Dodge, *The New
        "Dynamic Behavior of Liquids in Moving Containers"* (2000).
        """
        viscous = math.sqrt(kinematic_viscosity / math.sqrt(GRAVITY * self.radius**3))
        ratio = self.fill_height / self.radius
        # 1/sinh and 1/cosh by exp(-x): a deep container must not overflow.
        decay = math.exp(-FIRST_ROOT * ratio)
        inverse_sinh = 2.0 * decay / (1.0 - decay**2)
        inverse_cosh = 2.0 * decay / (1.0 + decay**2)
        return 0.92 * viscous * (1.0 + 0.318 * inverse_sinh * (1.0 + (1.0 - ratio) * inverse_cosh))
