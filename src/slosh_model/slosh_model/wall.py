"""Relates a wave height to the container's wall and to the distance from the rim."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from slosh_base.types import Array


class WallPlace(NamedTuple):
    """Position that the liquid reaches on the wall, and its distances from the rim.

    Attributes:
        surface_height: highest place of the whole surface above the still level [m]: at the wall,
            or above that where the crest is inside.
        height_along_wall: from the still level to the contact line along the wall [m]; NaN:
            above the wall's end.
        contact_radius: of the contact line [m]; NaN: above the wall's end, or not round.
        distance_to_rim: vertical, from the highest place up to the rim [m]; below 0: above it;
            NaN: the rim is not known.
        distance_along_wall: from the contact line up to the rim along the wall [m]; NaN: as above.
    """

    surface_height: float
    height_along_wall: float
    contact_radius: float
    distance_to_rim: float
    distance_along_wall: float


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """The wall of a container near the still level.

    Attributes:
        heights: (N,) increasing, above the still level [m].
        lengths: (N,) along the wall from the still level, negative below it [m].
        radii: (N,) of the wall there [m]; NaN: not round.
        freeboard: height of the rim above the still level [m]; NaN: unknown.
        crest_ratio: highest place of the surface, of the height at the wall, in the first mode.
        crest_place: its distance from the axis [m].
        leans: whether a height along the wall is another than a vertical one.
    """

    heights: Array
    lengths: Array
    radii: Array
    freeboard: float
    crest_ratio: float = 1.0
    crest_place: float = math.nan
    leans: bool = False

    @classmethod
    def vertical(cls, radius: float, freeboard: float | None) -> Wall:
        """Creates a vertical wall with a radius and a freeboard [m]."""
        at = np.array([-_FAR, 0.0, _FAR])
        rim = math.nan if freeboard is None else freeboard
        return cls(at, at, np.full(3, radius), rim)

    @property
    def crest_inside(self) -> bool:
        """Whether the surface is highest away from the wall, as in a bulb-shaped container."""
        return self.crest_ratio > 1.0

    def place(self, height: float) -> WallPlace:
        """Returns the highest position of the liquid on the wall for a wave height [m]."""
        return WallPlace(*self._columns(height))

    def places(self, heights: Array) -> dict[str, Array]:
        """Returns the fields of WallPlace, by name, as arrays (N,) for wave heights (N,) [m]."""
        return dict(zip(WallPlace._fields, self._columns(heights), strict=True))

    def _columns(self, height: Any) -> tuple[Any, ...]:
        surface = self.crest_ratio * height
        if self.lengths is self.heights:  # vertical: nothing is interpolated for each estimate
            radius = self.radii.item(0) + 0.0 * height  # NaN with the height
            return surface, height, radius, self.freeboard - surface, self.freeboard - height
        along = self._at(height, self.lengths)
        left = self._at(self.freeboard, self.lengths) - along
        radius = self._at(height, self.radii)
        return surface, along, radius, self.freeboard - surface, left

    def height_at(self, distance: float = 0.0) -> float:
        """Returns the height at the wall [m] of a crest at a distance below the rim; NaN if none.

        NaN: the rim is not known. Not above 0: no wave leaves so much.
        """
        return (self.freeboard - distance) / self.crest_ratio

    def _at(self, height: Any, values: Array) -> Any:
        # `interp` would repeat the first and the last value beyond the wall.
        return np.interp(height, self.heights, values, left=math.nan, right=math.nan)


def rim_name(distance: float) -> str:
    """Names what limits the liquid height: the rim, or a distance [m] below the rim."""
    return "rim limit" if distance > 0.0 else "rim"


_FAR = 1e3  # m; beyond all containers
