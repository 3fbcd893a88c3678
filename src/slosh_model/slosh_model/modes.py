"""Constants of one sloshing mode."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Container


@dataclass(frozen=True, slots=True)
class Mode:
    """A sloshing mode along one axis: an equivalent mass on a spring and a damper.

    Attributes:
        number: n ≥ 1.
        container: the container.
        damping_ratio: ζₙ [1].
        frequency_factor: natural frequency as measured, relative to the container's own [1].
        axis: of the container, X_AXIS or Y_AXIS; all the same in a round one.
        tension: surface tension over density that acts beside gravity, σ/ρ [m³/s²].
    """

    number: int
    container: Container
    damping_ratio: float
    frequency_factor: float = 1.0
    axis: int = X_AXIS
    tension: float = 0.0

    def along(self, axis: int) -> Mode:
        """Returns the same mode along another axis."""
        return replace(self, axis=axis)

    @property
    def xi(self) -> float:
        """Dimensionless wave number ξₙ for the container's shape."""
        return self.container.root(self.number)

    @property
    def reach(self) -> float:
        """Distance R from the container's axis to the wall [m]."""
        return self.container.reaches[self.axis]

    @property
    def natural_frequency(self) -> float:
        """Natural frequency ωₙ [rad/s] (DL22, eq. (3); TM20, eq. (20))."""
        bond = self.tension * (self.xi / self.reach) ** 2 / GRAVITY
        return self.gravity_frequency * math.sqrt(1.0 + bond)

    @property
    def gravity_frequency(self) -> float:
        """Natural frequency ωₙ without surface tension [rad/s]."""
        return self.frequency_factor * self.container.natural_frequency(self.number, self.axis)

    @property
    def curvature(self) -> float:
        """Dimensionless curvature Cₙ = ωₙ² R/g of the paraboloid (DL22, eq. (5))."""
        return self.natural_frequency**2 * self.reach / GRAVITY

    @property
    def plane_gain(self) -> float:
        """Liquid height at the wall per displacement of the mass, for a plane surface [1].

        It goes with ω²: under a constant acceleration the surface stands where gravity puts it,
        whatever frequency was measured, as in TM20's pendulum, eq. (9).
        """
        return self.frequency_factor**2 * self.container.plane_gain(self.number, self.axis)

    @property
    def curved_gain(self) -> float:
        """Liquid height at the wall per displacement of the mass, for the mode's own shape [1]."""
        return self.frequency_factor**2 * self.container.curved_gain(self.number, self.axis)
