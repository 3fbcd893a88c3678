"""Containers with vertical walls over an outline: trays, L-shapes, hexagonal jars.

The modes of an outline with an axis of symmetry move along this axis or across it: the models have
these as their axes, wherever they are. Those of any other outline have a direction each.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np

from slosh_base.types import Array
from slosh_model.checks import within
from slosh_model.containers import DIMENSIONS, PRISMATIC, X_AXIS
from slosh_model.errors import SloshModelError
from slosh_model.outline_wall import few_corners
from slosh_model.shapes.contour import (
    Piece,
    Points,
    arc,
    check_simple,
    checked_points,
    line,
    through,
)
from slosh_model.shapes.mode_numbers import LEAST, ModeNumbers
from slosh_model.shapes.solved import SolvedContainer, solved_modes, solver

_ALIKE = 1e-4
"""Relative difference of the frequencies along x and y below which every direction is alike."""
_QUARTER = 0.5 * math.pi
NARROWEST = 0.02
"""Least area of an outline, by the square of its furthest point's distance."""


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class PrismaticContainer(SolvedContainer):
    """A container with vertical walls, whose liquid rotates with it about the z axis.

    Raises:
        SloshModelError: an impossible outline, fill height or rim height.
    """

    section: ClassVar[str] = PRISMATIC
    surface_known: ClassVar[bool] = False
    built_in: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType(
        {
            "quasi_static_modes": MappingProxyType({"kappa": 1.0}),
            "yaw_coupling": MappingProxyType({"kappa": 1.0}),
        }
    )

    def __post_init__(self) -> None:
        self._check_outline()
        self._check_heights()

    def _check_outline(self) -> None:
        """Raises SloshModelError for an impossible outline."""

    @property
    def widening(self) -> float:
        """Change of the wall's distance from the axis with height [1]; 0 for vertical walls."""
        return 0.0

    @property
    def one_directional(self) -> bool:
        """Whether modes oscillate in fixed directions, so that each mode number has two modes."""
        return len({row.turn for row in self._rows}) > 1

    @property
    def alike(self) -> bool:
        """Whether the first mode has the same frequency along x and y, as in a hexagon."""
        if self.one_directional:
            return False
        along, across = (
            SolvedContainer.numbers(self, 1, axis).natural_frequency for axis in (0, 1)
        )
        return abs(across / along - 1.0) <= _ALIKE

    @property
    def cornered(self) -> bool:
        """Whether wave heights along x and y add up in corners: their frequencies differ."""
        return not self.alike and not any(row.turn for row in self._rows)

    def numbers(self, n: int, axis: int = X_AXIS) -> ModeNumbers:
        """Returns the constants of the n-th mode along an axis.

        Of modes with a direction each, those nearer to x and to y are in turns the n-th.

        Raises:
            SloshModelError: there are not so many, or they cannot be computed.
        """
        if self.one_directional:
            return SolvedContainer.numbers(self, (n + 1) // 2, (n - 1) % 2)
        return SolvedContainer.numbers(self, n, axis)

    def direction(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the azimuth of a mode's motion from the container's +x [rad]."""
        found = self.numbers(n, axis)
        return found.turn + 0.5 * math.pi * found.axis

    def axes(self, masses: int) -> float:
        """Returns the azimuth of a model's axes from the container's +x [rad].

        Those of the symmetry; or where there is none, those along which a constant acceleration
        lifts the surface along itself, beyond what the modes do.
        """
        if self.one_directional:
            return _static_axes(self, masses)
        return 0.0 if self.alike else self._rows[0].turn

    @property
    def reaches(self) -> tuple[float, float]:
        """Distances from the centre at which the liquid heights along x and y are computed [m].

        Half extents, or where the modes' axes are not x and y, or alike, that of the furthest
        corner.
        """
        if self.cornered:
            return self.numbers(1, 0).reach, self.numbers(1, 1).reach
        return (_furthest(self),) * 2

    def curved_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the liquid height at the wall per displacement of the mode's mass [1]."""
        if self.alike:
            # One for both: that along which the crest is furthest out.
            axis = int(self.height_distance(1, 1) > self.height_distance(1, 0))
        own = self.numbers(n, axis)
        return own.height_per_displacement * (self.reaches[axis] / own.reach)

    def height_distance(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the distance from the centre to where a mode is highest at the wall [m]."""
        return self.numbers(n, axis).reach

    def mode_damping(self, kinematic_viscosity: float, n: int) -> float:
        """Returns mode n's damping ratio ζₙ from the viscosity ν [m²/s].

        Of waves along two axes that of the slower ones, for both.
        """
        slower = self.natural_frequency(1, 1) < self.natural_frequency(1, 0)
        return self.numbers(n, int(slower)).damping_ratio(kinematic_viscosity)

    @property
    def corners(self) -> Array:
        """Corners (K, 2) of the wall; x and y are divided by the distances `reaches` [1]."""
        return np.asarray(_wall_corners(self) / np.array(self.reaches))

    @property
    def _rows(self) -> tuple[ModeNumbers, ...]:
        return self._own or solved_modes(self, LEAST)

    @property
    def places(self) -> Array:
        """Positions (N, 2) on the outline [m], relative to its centre."""
        return np.vstack([piece.fine()[:-1] for piece in self.contour])

    @property
    def highest_fill(self) -> float:
        """Highest possible fill height [m]; infinite, since the walls have no end."""
        return math.inf

    def solved(self, count: int) -> tuple[ModeNumbers, ...]:
        """Computes the first sloshing modes along x and along y."""
        # Another fill height has the same outline.
        outline = replace(self, fill_height=1.0, rim_height=None, table=None)
        plane = _plane_modes(outline, count)
        modes: tuple[ModeNumbers, ...] = solver().prism_modes(plane, self.fill_height)
        return modes

    def surface_shape(self, n: int, axis: int = 0) -> tuple[Array, Array]:
        """Returns a straight line as the surface's shape, since the model stores no mode shape."""
        places = np.linspace(0.0, self.reaches[axis], 2)
        return places, places / places[-1]

    @property
    def silhouette(self) -> Array:
        """Returns the right half of the view along y (N, 2) [m], z from the still surface."""
        rim = (self.rim_height or 1.3 * self.fill_height) - self.fill_height
        floor, reach = -self.fill_height, 0.5 * self.size
        return np.array([[0.0, floor], [reach, floor], [reach, rim]])

    @property
    def size(self) -> float:
        """Extent of the container along x [m]."""
        return float(np.ptp(self.places[:, 0]))

    @property
    def size_name(self) -> str:
        """Name of the characteristic dimension, 'width'."""
        return "width"

    @property
    def described(self) -> str:
        """Text that describes the container's dimensions [mm]."""
        wide, deep = (1e3 * np.ptp(self.places, axis=0)).tolist()
        return f"{self.shape} {wide:.4g} × {deep:.4g} mm, filled to {1e3 * self.fill_height:g} mm"

    @property
    def volume(self) -> float:
        """Volume of the liquid [m³]."""
        return area_and_centre(self.contour)[0] * self.fill_height


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Prism(PrismaticContainer):
    """A container with vertical walls over any outline.

    >>> from slosh_model.shapes import Prism
    >>> square = ((0.0, 0.0), (0.06, 0.0), (0.06, 0.06), (0.0, 0.06))
    >>> Prism(outline=square, fill_height=0.04)
    Prism(prism 60 × 60 mm, filled to 40 mm)

    Attributes:
        outline: (x, y) around the inner wall [m]; its centre is the container's origin.
        smooth: whether a smooth curve passes through the points, not straight lines.
    """

    shape: ClassVar[str] = "prism"

    outline: Points = field(metadata={"kind": "points"})
    smooth: bool = field(default=False, metadata={"kind": "flag"})

    def _check_outline(self) -> None:
        key = "container.outline"
        points = checked_points(self.outline, key, 3)
        if math.dist(points[0], points[-1]) < 1e-9:
            points = points[:-1]
        if len(points) < 3:
            raise SloshModelError(f"{key} needs three different points", ("container", "outline"))
        object.__setattr__(self, "outline", points)
        check_simple(self._as_given, key, closed=True)
        places = np.array(points)
        extent = float(np.hypot(*(places - places.mean(axis=0)).T).max())
        area = abs(area_and_centre(self._as_given)[0])
        if area < NARROWEST * extent**2:
            what = "no area" if area < 1e-8 else "too little area: a gap, or a point is wrong"
            raise SloshModelError(f"{key} encloses {what}", ("container", "outline"))

    @property
    def _as_given(self) -> tuple[Piece, ...]:
        return through((*self.outline, self.outline[0]), smooth=self.smooth)

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The outline as counter-clockwise curves about its centre."""
        pieces = self._as_given
        area, centre = area_and_centre(pieces)
        moved = [_moved(piece, centre) for piece in pieces]
        if area > 0.0:
            return tuple(moved)
        return tuple(piece.part(1.0, 0.0) for piece in reversed(moved))

    def widened(self, factor: float) -> Self:
        """Returns the prism with a scaled outline."""
        return replace(self, outline=tuple((factor * x, factor * y) for x, y in self.outline))


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Tray(PrismaticContainer):
    """A rectangular container with rounded corners.

    Attributes:
        width: inner width along x [m].
        depth: inner depth along y [m].
        corner_radius: of its corners [m].
    """

    shape: ClassVar[str] = "tray"

    width: float
    depth: float
    corner_radius: float

    def _check_outline(self) -> None:
        for name in ("width", "depth", "corner_radius"):
            within(f"container.{name}", getattr(self, name), "m", *DIMENSIONS)
        half = 0.5 * min(self.width, self.depth)
        if self.corner_radius >= half:
            raise SloshModelError(
                f"container.corner_radius = {self.corner_radius:g} m must be below half of its "
                f"smaller side, {half:g} m",
                ("container", "corner_radius"),
            )

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The outline: four sides and four corners, counter-clockwise."""
        r = self.corner_radius
        x, y = 0.5 * self.width - r, 0.5 * self.depth - r
        corners = ((x, y), (-x, y), (-x, -y), (x, -y))
        found: list[Piece] = []
        for k, (centre, following) in enumerate(
            zip(corners, (*corners[1:], corners[0]), strict=True)
        ):
            turned = arc(centre, (r, r), k * _QUARTER, (k + 1) * _QUARTER)
            away = (r * math.cos((k + 1) * _QUARTER), r * math.sin((k + 1) * _QUARTER))
            start = (centre[0] + away[0], centre[1] + away[1])
            end = (following[0] + away[0], following[1] + away[1])
            found += [turned, line(start, end)]
        return tuple(found)

    def widened(self, factor: float) -> Self:
        """Returns the tray with a scaled outline."""
        return replace(
            self, width=factor * self.width, depth=factor * self.depth,
            corner_radius=factor * self.corner_radius,
        )  # fmt: skip


@lru_cache(maxsize=256)
def _wall_corners(container: PrismaticContainer) -> Array:
    """Returns the corners (K, 2) of the wall [m]; bends are divided into short sides."""
    ends = [
        piece.at(np.linspace(0.0, 1.0, 2 if piece.straight else 129))[:-1]
        for piece in container.contour
    ]
    found = few_corners(np.vstack(ends))
    found.setflags(write=False)
    return found


@lru_cache(maxsize=256)
def _furthest(container: PrismaticContainer) -> float:
    """Returns the largest distance from the outline's centre to the wall [m]."""
    return float(np.hypot(*container.places.T).max())


def _static_axes(container: PrismaticContainer, masses: int) -> float:
    """Returns the azimuth of the main axis of the quasi-static height without the modes [rad]."""
    across = difference = 0.0
    for n in range(1, masses + 1):
        part = container.curved_gain(n) / container.natural_frequency(n) ** 2
        across += part * math.sin(2.0 * container.direction(n))
        difference += part * math.cos(2.0 * container.direction(n))
    return math.remainder(0.5 * math.atan2(across, difference), _QUARTER)


@lru_cache(maxsize=16)
def _plane_modes(container: PrismaticContainer, count: int) -> Any:
    plane_modes = solver().plane_modes
    logging.getLogger("slosh_model").info(
        "computing the modes of a %s once: up to a minute", container.shape
    )
    return plane_modes(container.contour, count)


def _moved(piece: Piece, centre: Array) -> Piece:
    return replace(piece, at=lambda t: piece.at(t) - centre)


def area_and_centre(pieces: tuple[Piece, ...]) -> tuple[float, Array]:
    """Returns the area [m²], positive counter-clockwise, and the centroid (2,) [m]."""
    a = np.vstack([piece.at(np.linspace(0.0, 1.0, 2001)[:-1]) for piece in pieces])
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - b[:, 0] * a[:, 1]
    area = 0.5 * float(cross.sum())
    if area == 0.0:
        return 0.0, a.mean(axis=0)
    return area, np.asarray(((a + b) * cross[:, None]).sum(axis=0) / (6.0 * area))
