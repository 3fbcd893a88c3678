"""The constants of one sloshing mode."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_model.bessel import bessel_derivative_root
from slosh_model.constants import GRAVITY
from slosh_model.containers import Cylinder


@dataclass(frozen=True, slots=True)
class Mode:
    """Mode n of a container: an equivalent mass on a spring and a damper.

    Attributes:
        number: n ≥ 1.
        container: the container.
        damping_ratio: ζₙ [1].
        frequency_factor: natural frequency as measured, relative to the container's own [1].
    """

    number: int
    container: Cylinder
    damping_ratio: float
    frequency_factor: float = 1.0

    @property
    def xi(self) -> float:
        """ξₙ, the n-th root of J₁′."""
        return bessel_derivative_root(self.number)

    @property
    def natural_frequency(self) -> float:
        """ωₙ [rad/s] (DL22, eq. (3)), or as measured."""
        return self.frequency_factor * self.container.natural_frequency(self.number)

    @property
    def curvature(self) -> float:
        """Cₙ = ωₙ² R/g, the paraboloid's dimensionless curvature (DL22, eq. (5))."""
        return self.natural_frequency**2 * self.container.radius / GRAVITY

    @property
    def linear_gain(self) -> float:
        """Wall height per displacement, plane surface: 4 h mₙ/(m_F R) (DL22, eq. (22)).

        It goes with ω²: under a constant acceleration the surface stands where gravity puts it,
        whatever frequency was measured, as in TM20's pendulum, eq. (9).
        """
        slenderness = self.container.fill_height / self.container.radius
        gain = 4.0 * slenderness * self.container.mass_ratio(self.number)
        return self.frequency_factor**2 * gain

    @property
    def nonlinear_gain(self) -> float:
        """Wall height per displacement, Bessel surface: ξₙ² h mₙ/(m_F R) (DL22, eq. (24))."""
        return self.linear_gain * self.xi**2 / 4.0
