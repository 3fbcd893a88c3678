"""Bodies of revolution about the vertical axis with any profile."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from slosh_model.containers import REVOLVED
from slosh_model.errors import SloshModelError
from slosh_model.shapes.contour import (
    Piece,
    Points,
    check_simple,
    checked_points,
    through,
    wetted,
)
from slosh_model.shapes.mode_numbers import ModeNumbers
from slosh_model.shapes.profiled import ProfiledContainer
from slosh_model.shapes.solved import solver


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class RevolvedContainer(ProfiledContainer):
    """A container that is a body of revolution.

    Raises:
        SloshModelError: an impossible profile, fill height or rim height.
    """

    section: ClassVar[str] = REVOLVED

    def solved(self, count: int) -> tuple[ModeNumbers, ...]:
        """Computes the first sloshing modes of the body by potential flow."""
        modes: tuple[ModeNumbers, ...] = solver().revolution_modes(self.contour, self.level, count)
        return modes

    @property
    def size(self) -> float:
        """Radius of the still surface [m]."""
        return self.surface_half

    @property
    def size_name(self) -> str:
        """Name of the characteristic dimension, 'surface radius'."""
        return "surface radius"

    @property
    def described(self) -> str:
        """Text that describes the container's dimensions [mm]."""
        return (
            f"{self.shape}, surface radius {1e3 * self.size:.4g} mm, filled to "
            f"{1e3 * self.fill_height:g} mm"
        )

    @property
    def volume(self) -> float:
        """Volume of the liquid [m³], by Gauss's theorem over the wetted wall."""
        total = 0.0
        for piece in wetted(self.contour, self.level):
            at = piece.at(np.linspace(0.0, 1.0, 2001))
            rise = np.diff(at[:, 1])
            r, s = at[:-1, 0], at[1:, 0]
            total += float((np.pi * rise * (r * r + r * s + s * s) / 3.0).sum())
        return total


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Revolution(RevolvedContainer):
    """A body of revolution whose profile is given by points.

    >>> from slosh_model.shapes import Revolution
    >>> Revolution(profile=((0.0, 0.0), (0.03, 0.0), (0.04, 0.09)), fill_height=0.06)
    Revolution(revolution, surface radius 36.67 mm, filled to 60 mm, rim at 90 mm)

    Attributes:
        profile: (r, z) from the floor's centre, or a core's top, to the rim [m].
        smooth: whether a smooth curve passes through the points, not straight lines.
    """

    shape: ClassVar[str] = "revolution"

    profile: Points = field(metadata={"kind": "points"})
    smooth: bool = field(default=False, metadata={"kind": "flag"})

    def _check_profile(self) -> None:
        key = "container.profile"
        points = checked_points(self.profile, key, 2)
        if points[-1][0] == 0.0 < points[0][0] and points[0][1] > points[-1][1]:
            points = points[::-1]  # from the rim to the floor's centre
        object.__setattr__(self, "profile", points)
        for index, (r, _) in enumerate(points):
            if r < 0.0:
                raise SloshModelError(
                    f"{key}[{index}]: r = {r:g} m must not be below 0; give one half of the "
                    "container, from the axis to the rim",
                    ("container", "profile", index),
                )
        if min(float(piece.fine()[:, 0].min()) for piece in self.contour) < -1e-9:
            raise SloshModelError(
                f"{key}: the smooth curve crosses the axis; give more points near it",
                ("container", "profile"),
            )
        check_simple(self.contour, key, closed=False)

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The body's profile, a curve through the given points."""
        return through(self.profile, smooth=self.smooth)

    def widened(self, factor: float) -> Self:
        """Returns the body with scaled radii."""
        return replace(self, profile=tuple((factor * r, z) for r, z in self.profile))
