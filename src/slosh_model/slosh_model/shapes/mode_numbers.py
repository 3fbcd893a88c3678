"""Constants of sloshing modes that have no closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from itertools import pairwise

from slosh_model.errors import SloshModelError

LEAST, MOST = 3, 6
"""Number of modes that are computed along an axis: three, or as many as a model asks for."""

FILM = 0.65
"""Layer of a surface film in `layer_damping`, of that of a film that does not yield."""
_FLAT = 1e-6
"""Height relative to the wall's that is none."""


@dataclass(frozen=True, slots=True)
class ModeNumbers:
    """Computed constants of one sloshing mode along one axis.

    Attributes:
        axis: 0 along x, 1 along y; 0 alone for a round container.
        natural_frequency: ω [rad/s].
        reach: R, distance from the axis to the place on the wall whose height is given [m].
        mass_ratio: sloshing mass over the liquid's.
        height_per_displacement: at the wall, per displacement of that mass [1].
        mass_height: height of that mass above the still surface [m].
        crest_ratio: largest height over the surface, of that at the wall; above 1 the crest is
            inside.
        crest_place: where it is: distance from the axis [m].
        layer_damping: ζ per √ν from the layer at the wall [s^½/m].
        bulk_damping: ζ per ν from the rest of the liquid [s/m²].
        turn: azimuth of the mode's motion, from x or y [rad].
        surface: distance from the axis [m] and height relative to the wall's; empty: not kept.
    """

    axis: int
    natural_frequency: float
    reach: float
    mass_ratio: float
    height_per_displacement: float
    mass_height: float
    crest_ratio: float
    crest_place: float
    layer_damping: float
    bulk_damping: float
    turn: float = 0.0
    surface: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        for name in ("natural_frequency", "reach", "mass_ratio", "crest_ratio"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise SloshModelError(f"{name} = {getattr(self, name)!r} must be above 0", (name,))
        if self.axis not in (0, 1):
            raise SloshModelError(f"axis = {self.axis!r} must be 0 (x) or 1 (y)", ("axis",))

    @property
    def turns(self) -> int:
        """Number of times that the mode's surface crosses the still level from axis to wall."""
        heights = [height for _, height in self.surface if abs(height) > _FLAT]
        return sum(a * b < 0.0 for a, b in pairwise(heights))

    def damping_ratio(self, kinematic_viscosity: float) -> float:
        """Returns the damping ratio ζ for a liquid of viscosity ν [m²/s]."""
        layer = self.layer_damping * math.sqrt(kinematic_viscosity)
        return layer + self.bulk_damping * kinematic_viscosity


NAMES = tuple(item.name for item in fields(ModeNumbers) if item.name != "surface")
"""Fields that travel in a model file."""
