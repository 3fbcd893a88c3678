"""Upright rectangular container, with sloshing modes in closed form."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Self

from slosh_model.bessel import check_mode
from slosh_model.checks import within
from slosh_model.containers import (
    DIMENSIONS,
    RECTANGULAR,
    X_AXIS,
    Y_AXIS,
    Container,
)
from slosh_model.limits import ValidityLimits


@dataclass(frozen=True, slots=True, repr=False)
class Rectangle(Container):
    """An upright container of rectangular cross-section.

    Its liquid follows its yaw: the modes' axes are its own.

    >>> from slosh_model import Rectangle
    >>> tray = Rectangle(width=0.2, depth=0.1, fill_height=0.03)
    >>> tray.size  # m
    0.2

    Attributes:
        width: inner width w along the container's x [m].
        depth: inner depth d along the container's y [m].
        fill_height: height h of the still liquid above the floor [m].
        rim_height: height of the rim above the floor [m]; None: unknown.

    Raises:
        SloshModelError: a dimension is outside DIMENSIONS, or the rim not above the liquid.
    """

    shape: ClassVar[str] = "rectangle"
    section: ClassVar[str] = RECTANGULAR
    nonlinear_effect: ClassVar[str] = "pendulum_nonlinearity"
    built_in: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType(
        {"yaw_coupling": MappingProxyType({"kappa": 1.0})}
    )
    straight_alone: ClassVar[bool] = True
    # The motions that TM20 measured, quintic with a stroke of 100 mm and b = 0.4: the slowest and
    # the fastest of the speeds up to which the surface is a line (Table 4: 42 … 57 1/min).
    validated: ClassVar[ValidityLimits] = ValidityLimits(
        acceleration=3.3, jerk=80.0, planar_acceleration=1.8, planar_jerk=32.0
    )

    width: float
    depth: float
    fill_height: float
    rim_height: float | None = None

    def __post_init__(self) -> None:
        within("container.width", self.width, "m", *DIMENSIONS)
        within("container.depth", self.depth, "m", *DIMENSIONS)
        self._check_heights()

    def root(self, n: int) -> float:
        """Returns ξₙ = (2n - 1) π/2: an odd number of half waves between the walls."""
        check_mode(n)
        return (2 * n - 1) * math.pi / 2.0

    @property
    def reaches(self) -> tuple[float, float]:
        """Half the width and half the depth [m]."""
        return self.width / 2.0, self.depth / 2.0

    @property
    def volume(self) -> float:
        """Volume W d h of the liquid [m³]."""
        return self.width * self.depth * self.fill_height

    @property
    def described(self) -> str:
        """Text that describes the container's dimensions [mm]."""
        sides = f"width {1e3 * self.width:g} mm, depth {1e3 * self.depth:g} mm"
        return f"{sides}, filled to {1e3 * self.fill_height:g} mm"

    @property
    def size(self) -> float:
        """Width of the container [m]."""
        return self.width

    @property
    def size_name(self) -> str:
        """Name of the characteristic dimension, 'width'."""
        return "width"

    def mass_ratio(self, n: int, axis: int = X_AXIS) -> float:
        """Returns mₙ/m_F, the fraction of the liquid's mass in mode n (Ibrahim 2005, ch. 5)."""
        xi = self.root(n)
        return 2.0 * self.depth_factor(n, axis) * self.reaches[axis] / (xi**3 * self.fill_height)

    def plane_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the height gain ωₙ² R/g of a plane surface (TM20, eq. (9), η = θ w/2)."""
        return self.root(n) * self.depth_factor(n, axis)

    def curved_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the height gain of a standing wave sin(ξₙ x/R): 2/ξₙ² times `plane_gain`."""
        return 2.0 / self.root(n) ** 2 * self.plane_gain(n, axis)

    def widened(self, factor: float) -> Self:
        """Returns the rectangle with scaled width and depth."""
        return replace(self, width=self.width * factor, depth=self.depth * factor)

    def damping_ratio(self, kinematic_viscosity: float) -> float:
        """Returns the damping ratio ζ₁ along the longer side by boundary layers, Keulegan 1959."""
        along, across = max(self.width, self.depth), min(self.width, self.depth)
        axis = X_AXIS if self.width >= self.depth else Y_AXIS
        omega, k = self.natural_frequency(1, axis), math.pi / along
        # 2kh/sinh(2kh) by exp(-x): a deep container must not overflow.
        decay = math.exp(-2.0 * k * self.fill_height)
        floor = 2.0 * k * self.fill_height * 2.0 * decay / (1.0 - decay**2)
        layers = floor / (2.0 * self.fill_height) + (1.0 - floor) / along + 1.0 / across
        return math.sqrt(kinematic_viscosity / (2.0 * omega)) * layers
