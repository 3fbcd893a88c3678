"""Containers: their dimensions and what follows from them alone."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_model.bessel import bessel_derivative_root
from slosh_model.checks import within
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError

DIMENSIONS = (1e-4, 10.0)  # m; any other value is a unit mistaken for another


@dataclass(frozen=True, slots=True)
class Cylinder:
    """An upright circular cylinder.

    Attributes:
        radius: inner radius R [m].
        fill_height: height h of the still liquid above the floor [m].
        rim_height: height of the rim above the floor [m]; None: unknown.

    Raises:
        SloshModelError: a dimension is outside DIMENSIONS, or the rim not above the liquid.
    """

    radius: float
    fill_height: float
    rim_height: float | None = None

    def __post_init__(self) -> None:
        within("container.radius", self.radius, "m", *DIMENSIONS)
        within("container.fill_height", self.fill_height, "m", *DIMENSIONS)
        if self.rim_height is None:
            return
        within("container.rim_height", self.rim_height, "m", *DIMENSIONS)
        if self.rim_height <= self.fill_height:
            raise SloshModelError(
                f"container.rim_height = {self.rim_height:g} m must lie above "
                f"fill_height = {self.fill_height:g} m",
                ("container", "rim_height"),
            )

    @property
    def freeboard(self) -> float | None:
        """Height of the rim above the still level [m]; None: unknown."""
        return None if self.rim_height is None else self.rim_height - self.fill_height

    def depth_factor(self, n: int) -> float:
        """tanh(ξₙ h/R), the share of the deep-liquid frequency squared that this depth leaves."""
        return math.tanh(bessel_derivative_root(n) * self.fill_height / self.radius)

    def natural_frequency(self, n: int) -> float:
        """ωₙ [rad/s] (DL22, eq. (3))."""
        return math.sqrt(GRAVITY * bessel_derivative_root(n) / self.radius * self.depth_factor(n))

    def mass_ratio(self, n: int) -> float:
        """mₙ/m_F, the share of the liquid's mass that sloshes in mode n (DL22, eq. (4))."""
        xi = bessel_derivative_root(n)
        slenderness = xi * self.fill_height / self.radius
        return 2.0 * self.depth_factor(n) / (slenderness * (xi**2 - 1.0))
