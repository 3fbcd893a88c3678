"""Containers by their wall's contour in a vertical plane: r or y to the right, z up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self, cast

import numpy as np

from slosh_base.types import Array
from slosh_model.checks import within
from slosh_model.containers import DIMENSIONS, REVOLVED, X_AXIS, Y_AXIS
from slosh_model.errors import SloshModelError
from slosh_model.shapes.contour import Piece, wetted
from slosh_model.shapes.mode_numbers import LEAST, MOST
from slosh_model.shapes.solved import SolvedContainer, solved_modes
from slosh_model.wall import Wall

NO_LENGTHS = ("fill_height", "rim_height", "table")
"""Fields of every shape that are not among its own lengths."""
INSIDE = 1.001
"""Largest height over the surface, of that at the wall, from which the crest is inside."""


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class ProfiledContainer(SolvedContainer):
    """A container whose wall rises from the floor's centre to the rim, leaning or not.

    One that is given by lengths in metres has a `contour` and `wide` alone.

    Raises:
        SloshModelError: impossible lengths, profile, fill height or rim height.
    """

    wide: ClassVar[tuple[str, ...]] = ()
    """Its lengths across the axis."""

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
        """Raises SloshModelError for impossible lengths."""
        for item in fields(cast(Any, self)):
            value = getattr(self, item.name)
            if item.name not in NO_LENGTHS and not item.metadata and value is not None:
                within(f"container.{item.name}", value, "m", *DIMENSIONS)
        self._check_lengths()

    def _check_lengths(self) -> None:
        """Raises SloshModelError for inconsistent lengths."""

    def _below(self, length: str, other: str, factor: float = 1.0) -> None:
        """Raises SloshModelError unless one length is below a multiple of another length."""
        given, limit = getattr(self, length), factor * getattr(self, other)
        if not given < limit:
            times = "" if factor == 1.0 else f"{factor:g} "
            raise SloshModelError(
                f"container.{length} = {given:g} m must be below {times}{other} = {limit:g} m",
                ("container", length),
            )

    def widened(self, factor: float) -> Self:
        """Returns the container with its horizontal lengths (those in `wide`) scaled."""
        given = {name: getattr(self, name) for name in self.wide}
        changed = {name: factor * size for name, size in given.items() if size is not None}
        return cast(Self, replace(cast(Any, self), **changed))

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

    @property
    def widening(self) -> float:
        """Change of the wall's distance from the axis with height at the still surface [1]."""
        below, at = wetted(self.contour, self.level)[-1].at(np.array([0.999, 1.0]))
        return float((at[0] - below[0]) / max(at[1] - below[1], 1e-12))

    @property
    def surface_half(self) -> float:
        """Distance of the contact line from the axis at rest [m]."""
        return float(wetted(self.contour, self.level)[-1].one(1.0)[0])

    @property
    def wall_line(self) -> tuple[Array, Array, Array]:
        """Lengths along the wall, heights above the still level, distances from the axis [m]."""
        return _joined(self._upwards, self._downwards)

    @property
    def wall(self) -> Wall:
        """The container's wall near the still level."""
        lengths, heights, radii = self.wall_line
        rim = math.nan if self.rim_height is None else self.rim_height - self.fill_height
        ratio, place = max(self.crest(1, axis) for axis in (X_AXIS, Y_AXIS))
        if self.section != REVOLVED:
            radii = np.full(len(radii), np.nan)
        inside = {"crest_ratio": ratio, "crest_place": place} if ratio > INSIDE else {}
        leans = self.widening != 0.0
        return Wall(heights, lengths, radii, rim, leans=leans, **inside)

    def side_view(self, axis: int = X_AXIS) -> Array:
        """Returns the contour (N, 2) up to the rim, z from the still surface [m]."""
        ends = (np.linspace(0.0, 1.0, 2 if piece.straight else 65) for piece in self.contour)
        places = np.vstack([piece.at(t) for piece, t in zip(self.contour, ends, strict=True)])
        rim = self.floor + (self.rim_height or self.top)
        return cut_above(places, rim) - [0.0, self.level]

    def surface_shape(self, n: int, axis: int = X_AXIS) -> tuple[Array, Array]:
        """Returns positions from the axis or core to the wall [m], and a mode's heights there."""
        rows = self.numbers(n, axis).surface
        if not rows:  # a model file holds none
            every = solved_modes(self, LEAST if n <= LEAST else MOST)
            rows = self._along(every, axis)[n - 1].surface
        places, heights = np.array(rows).T
        return places, heights

    @property
    def _upwards(self) -> list[Piece]:
        """Returns the wall's contour above the still surface, from bottom to top."""
        found: list[Piece] = []
        for piece in reversed(self.contour):
            cuts = piece.shares_at(self.level, 1)
            if cuts:
                return [piece.part(cuts[-1], 1.0), *found]
            found.insert(0, piece)
        return found

    @property
    def _downwards(self) -> list[Piece]:
        """Returns the wall's contour below the still surface, from top to bottom."""
        return [piece.part(1.0, 0.0) for piece in reversed(wetted(self.contour, self.level))]


def cut_above(places: Array, height: float) -> Array:
    """Returns a contour's points up to where the contour rises above a height."""
    above = np.flatnonzero(places[:, 1] > height)
    above = above[above > np.argmin(places[:, 1])]
    if not len(above):
        return places
    low, high = places[above[0] - 1], places[above[0]]
    share = (height - low[1]) / (high[1] - low[1])
    return np.vstack([places[: above[0]], low + share * (high - low)])


def _joined(above: Sequence[Piece], below: Sequence[Piece]) -> tuple[Array, Array, Array]:
    """Returns the wall's arc lengths, heights above the still surface, and radii [m].

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
