"""Bodies of revolution about the vertical axis with any profile."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from slosh_base.types import Array
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
from slosh_model.shapes.mode_numbers import LEAST, MOST, ModeNumbers
from slosh_model.shapes.solved import SolvedContainer, solved_modes
from slosh_model.wall import Wall

INSIDE = 1.001
"""Largest height over the surface, of that at the wall, from which the crest is inside."""


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class RevolvedContainer(SolvedContainer):
    """A container that is a body of revolution.

    Raises:
        SloshModelError: an impossible profile, fill height or rim height.
    """

    section: ClassVar[str] = REVOLVED

    def __post_init__(self) -> None:
        self._check_profile()
        top = self.top
        if self.fill_height >= top:
            raise SloshModelError(
                f"container.fill_height = {self.fill_height:g} m must lie below the rim at "
                f"{top:g} m",
                ("container", "fill_height"),
            )
        if self.rim_height is None and not self.open_ended:
            object.__setattr__(self, "rim_height", top)
        elif self.rim_height is not None and self.rim_height > top * (1.0 + 1e-9):
            raise SloshModelError(
                f"container.rim_height = {self.rim_height:g} m lies above the contour's end at "
                f"{top:g} m",
                ("container", "rim_height"),
            )
        self._check_heights()
        wetted(self.contour, self.level)

    def _check_profile(self) -> None:
        """Raises SloshModelError for impossible dimensions."""

    @property
    def open_ended(self) -> bool:
        """Whether the contour ends at an arbitrary point instead of at the rim."""
        return False

    @property
    def level(self) -> float:
        """Height of the still surface in the z coordinate of the contour [m]."""
        return self.floor + self.fill_height

    @property
    def floor(self) -> float:
        """Height of the deepest point in the z coordinate of the contour [m]."""
        return float(min(piece.fine()[:, 1].min() for piece in self.contour))

    @property
    def top(self) -> float:
        """Height of the contour's end above its deepest point [m]."""
        return float(self.contour[-1].one(1.0)[1]) - self.floor

    @property
    def highest_fill(self) -> float:
        """Highest possible fill height [m], at the contour's end."""
        return self.top

    def solved(self, count: int) -> tuple[ModeNumbers, ...]:
        """Computes the first sloshing modes."""
        from slosh_model.potential_flow.axisymmetric import revolution_modes

        return revolution_modes(self.contour, self.level, count)

    @property
    def widening(self) -> float:
        """Change dr/dz of the wall's radius with height at the still surface [1]."""
        below, at = wetted(self.contour, self.level)[-1].at(np.array([0.999, 1.0]))
        return float((at[0] - below[0]) / max(at[1] - below[1], 1e-12))

    @property
    def size(self) -> float:
        """Radius of the still surface [m]."""
        return float(wetted(self.contour, self.level)[-1].one(1.0)[0])

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

    @property
    def wall_line(self) -> tuple[Array, Array, Array]:
        """Lengths along the wall, heights above the still surface, and radii there [m]."""
        return _joined(self._upwards, self._downwards)

    @property
    def wall(self) -> Wall:
        """The container's wall near the still level."""
        lengths, heights, radii = self.wall_line
        rim = math.nan if self.rim_height is None else self.rim_height - self.fill_height
        ratio, place = self.crest(1)
        inside = {"crest_ratio": ratio, "crest_place": place} if ratio > INSIDE else {}
        leans = self.widening != 0.0
        return Wall(heights, lengths, radii, rim, leans=leans, **inside)

    def surface_shape(self, n: int) -> tuple[Array, Array]:
        """Returns positions from the axis or core to the wall [m], and a mode's heights there."""
        rows = (
            self.numbers(n).surface
            or solved_modes(self, LEAST if n <= LEAST else MOST)[n - 1].surface
        )
        places, heights = np.array(rows).T
        return places, heights

    @property
    def silhouette(self) -> Array:
        """Returns the contour (N, 2) up to the rim, z from the still surface [m]."""
        ends = (np.linspace(0.0, 1.0, 2 if piece.straight else 65) for piece in self.contour)
        places = np.vstack([piece.at(t) for piece, t in zip(self.contour, ends, strict=True)])
        rim = self.floor + (self.rim_height or self.top)
        return cut_above(places, rim) - [0.0, self.level]

    @property
    def _upwards(self) -> list[Piece]:
        """Returns the wall above the still surface, upwards."""
        found: list[Piece] = []
        for piece in reversed(self.contour):
            cuts = piece.shares_at(self.level, 1)
            if cuts:
                return [piece.part(cuts[-1], 1.0), *found]
            found.insert(0, piece)
        return found

    @property
    def _downwards(self) -> list[Piece]:
        """Returns the wall below the still surface, downwards."""
        return [piece.part(1.0, 0.0) for piece in reversed(wetted(self.contour, self.level))]


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
        """The profile through the given points."""
        return through(self.profile, smooth=self.smooth)

    def widened(self, factor: float) -> Self:
        """Returns the body with scaled radii."""
        return replace(self, profile=tuple((factor * r, z) for r, z in self.profile))


def cut_above(places: Array, height: float) -> Array:
    """Returns consecutive points up to the place where they exceed a height."""
    above = np.flatnonzero(places[:, 1] > height)
    above = above[above > np.argmin(places[:, 1])]
    if not len(above):
        return places
    low, high = places[above[0] - 1], places[above[0]]
    share = (height - low[1]) / (high[1] - low[1])
    return np.vstack([places[: above[0]], low + share * (high - low)])


def _joined(above: Sequence[Piece], below: Sequence[Piece]) -> tuple[Array, Array, Array]:
    """Returns lengths along a wall, heights above the still surface, and radii there [m].

    Where the wall goes down again on its way, the place is the one that is reached first.
    """
    columns = []
    for pieces, sign in ((below, -1.0), (above, 1.0)):
        places = np.vstack([piece.fine() for piece in pieces])
        steps = np.hypot(*np.diff(places, axis=0).T)
        lengths: Array = np.concatenate([[0.0], np.cumsum(steps)])
        heights = places[:, 1] - places[0, 1]
        furthest = np.maximum.accumulate(sign * heights)
        first = np.concatenate([[True], np.diff(furthest) > 0.0])
        columns.append(np.column_stack([sign * lengths, heights, places[:, 0]])[first])
    down, up = columns
    joined = np.vstack([down[:0:-1], up])
    return joined[:, 0], joined[:, 1], joined[:, 2]
