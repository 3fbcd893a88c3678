"""Troughs: a constant cross-section along the horizontal x axis, between vertical end walls."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np

from slosh_base.types import Array
from slosh_model.checks import within
from slosh_model.constants import GRAVITY
from slosh_model.containers import DIMENSIONS, PRISMATIC, X_AXIS, Y_AXIS, Container
from slosh_model.errors import SloshModelError
from slosh_model.shapes.contour import (
    Piece,
    Points,
    arc,
    check_simple,
    checked_points,
    line,
    through,
    wetted,
)
from slosh_model.shapes.mode_numbers import ModeNumbers
from slosh_model.shapes.profiled import ProfiledContainer
from slosh_model.shapes.solved import SHALLOW, STEEP, WIDENING, solver

HALF_ANGLES = (math.radians(1.0), math.radians(89.0))  # rad; any other value is no wedge's
_QUARTER = 0.5 * math.pi
_SAME = 1e-9
_UNLIKE = 1e-4
"""Distance of a symmetric section from its mirror image, of its width."""


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class TroughContainer(ProfiledContainer):
    """A container with a constant, mirror-symmetric cross-section along its length.

    Longitudinal modes move the liquid along x, transverse ones along y. Modes that do both carry
    no net force: no acceleration drives them, and they are left out. The liquid rotates with the
    container about the z axis.

    Attributes:
        length: distance between the end walls, along x [m].

    Raises:
        SloshModelError: an impossible section, length, fill height or rim height.
    """

    section: ClassVar[str] = PRISMATIC
    built_in: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType(
        {
            "quasi_static_modes": MappingProxyType({"kappa": 1.0}),
            "yaw_coupling": MappingProxyType({"kappa": 1.0}),
        }
    )

    length: float

    def _check_profile(self) -> None:
        super(TroughContainer, self)._check_profile()
        start, _ = self.contour[0].at(np.array([0.0, 1.0]))
        if start[1] - self.floor >= self.fill_height:
            raise SloshModelError(
                f"container.fill_height = {self.fill_height:g} m lies below the middle of the "
                f"floor at {start[1] - self.floor:g} m: there are two troughs; model one of them",
                ("container", "fill_height"),
            )

    def solved(self, count: int) -> tuple[ModeNumbers, ...]:
        """Computes the first longitudinal modes (along x), then as many transverse ones."""
        modes: tuple[ModeNumbers, ...] = solver().trough_modes(
            self.contour, self.level, self.length, count
        )
        return modes

    @property
    def cornered(self) -> bool:
        """True: the wave heights along x and y add up at the ends of the side walls."""
        return True

    @property
    def reaches(self) -> tuple[float, float]:
        """Half the length, and half the still surface's width [m]."""
        return 0.5 * self.length, self.surface_half

    @property
    def size(self) -> float:
        """Extent of the container along x [m]."""
        return self.length

    @property
    def size_name(self) -> str:
        """Name of the characteristic dimension, 'length'."""
        return "length"

    @property
    def described(self) -> str:
        """Text that describes the container's dimensions [mm]."""
        return (
            f"{self.shape}, length {1e3 * self.length:.4g} mm, surface width "
            f"{2e3 * self.surface_half:.4g} mm, filled to {1e3 * self.fill_height:g} mm"
        )

    @property
    def volume(self) -> float:
        """Volume of the liquid [m³], by Gauss's theorem over the wetted wall."""
        area = 0.0
        for piece in wetted(self.contour, self.level):
            at = piece.at(np.linspace(0.0, 1.0, 2001))
            area += float((np.diff(at[:, 1]) * (at[1:, 0] + at[:-1, 0])).sum())
        return area * self.length

    def mode_damping(self, kinematic_viscosity: float, n: int) -> float:
        """Returns the damping ratio ζₙ along the axis whose waves are slower."""
        slow = min((X_AXIS, Y_AXIS), key=lambda axis: self.natural_frequency(1, axis))
        return self.numbers(n, slow).damping_ratio(kinematic_viscosity)

    @property
    def linear_height(self) -> float:
        """Wave height [m] above which the linear model fails: too steep, or on a sloping wall."""
        fastest = max(self.natural_frequency(1, axis) for axis in (X_AXIS, Y_AXIS))
        slope = abs(self.widening)
        return min(
            STEEP * GRAVITY / fastest**2,
            SHALLOW * self.fill_height,
            WIDENING * self.surface_half / slope if slope > 0.0 else math.inf,
        )

    def side_view(self, axis: int = X_AXIS) -> Array:
        """Returns half of the side view [m]: a rectangle along x, the cross-section along y."""
        if axis == X_AXIS:
            return Container.side_view(self, axis)
        return super(TroughContainer, self).side_view(axis)


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Trough(TroughContainer):
    """A trough whose section is given by points.

    >>> from slosh_model.shapes import Trough
    >>> gutter = ((-0.06, 0.05), (-0.04, 0.0), (0.04, 0.0), (0.06, 0.05))
    >>> Trough(profile=gutter, length=0.3, fill_height=0.03)
    Trough(trough, length 300 mm, surface width 104 mm, filled to 30 mm, rim at 50 mm)

    Attributes:
        profile: (y, z) of the inner wall from rim to rim, or from the floor's middle at y = 0 to
            one rim [m]; its middle is the container's origin.
        smooth: whether a smooth curve passes through the points, not straight lines.
    """

    shape: ClassVar[str] = "trough"

    profile: Points = field(metadata={"kind": "points"})
    smooth: bool = field(default=False, metadata={"kind": "flag"})

    def _check_profile(self) -> None:
        key, keys = "container.profile", ("container", "profile")
        points = checked_points(self.profile, key, 2)
        if math.dist(points[0], points[-1]) < _SAME:
            raise SloshModelError(
                f"{key} is closed at the top: leave the lid out, from rim to rim", keys
            )
        if points[0][0] > points[-1][0]:
            points = points[::-1]
        object.__setattr__(self, "profile", points)
        check_simple(through(self._both, smooth=self.smooth), key, closed=False)
        places = self._places
        if float(np.ptp(places[:, 0])) < _SAME or float(np.ptp(places[:, 1])) < _SAME:
            raise SloshModelError(f"{key} encloses no area", keys)
        self._check_symmetry(places)
        super(Trough, self)._check_profile()

    def _check_symmetry(self, places: Array) -> None:
        """Raises SloshModelError unless the section (N, 2) is its own mirror image."""
        other = places[::-1] * [-1.0, 1.0]
        start, step = places[:-1], np.diff(places, axis=0)
        long = np.maximum((step * step).sum(axis=1), 1e-300)
        away = []
        for place in other:
            share = np.clip(((place - start) * step).sum(axis=1) / long, 0.0, 1.0)
            gap = np.hypot(*(place - start - share[:, None] * step).T)
            away.append(float(gap.min()))
        worst = int(np.argmax(away))
        if away[worst] > _UNLIKE * float(np.ptp(places[:, 0])):
            y, z = (other[worst] * [-1.0, 1.0]).tolist()
            raise SloshModelError(
                f"container.profile: near ({y:.4g}, {z:.4g}) m from its middle it differs from "
                f"its mirror image by {1e3 * away[worst]:.3g} mm; sections that are not symmetric "
                "about their middle are not computed",
                ("container", "profile"),
            )

    @property
    def _both(self) -> Points:
        """Section's points from rim to rim, centred on y = 0; a half section is mirrored."""
        points = self.profile
        if points[0][0] == 0.0 < points[1][0] and points[0][1] < points[-1][1]:
            return (*((-y, z) for y, z in points[:0:-1]), *points)
        middle = 0.5 * (min(y for y, _ in points) + max(y for y, _ in points))
        return tuple((y - middle, z) for y, z in points)

    @property
    def _places(self) -> Array:
        ends = through(self._both, smooth=self.smooth)
        return np.vstack([piece.at(np.linspace(0.0, 1.0, 2 if piece.straight else 65))
                          for piece in ends])  # fmt: skip

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The right half of the section, from the floor's middle to the rim."""
        pieces = through(self._both, smooth=self.smooth)
        for index, piece in enumerate(pieces):
            cuts = piece.shares_at(0.0, 0)
            if cuts:
                first = (piece.part(cuts[-1], 1.0),) if cuts[-1] < 1.0 - _SAME else ()
                return (*first, *pieces[index + 1 :])
        return pieces

    def widened(self, factor: float) -> Self:
        """Returns the trough with a scaled width and length."""
        wider = tuple((factor * y, z) for y, z in self.profile)
        return replace(self, profile=wider, length=factor * self.length)


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Wedge(TroughContainer):
    """A trough whose section is a V, by its width and height or by its half angle.

    >>> from slosh_model.shapes import Wedge
    >>> Wedge(top_width=0.12, height=0.06, length=0.3, fill_height=0.04)
    Wedge(wedge, length 300 mm, surface width 80 mm, filled to 40 mm, rim at 60 mm)

    Attributes:
        top_width: inner width at the rim [m]; None: by the half angle.
        height: of the rim above the edge at the bottom [m]; None: unknown.
        half_angle: between a wall and the vertical [rad]; None: by width and height.
    """

    shape: ClassVar[str] = "wedge"

    top_width: float | None = field(default=None, metadata={"asked": True})
    height: float | None = field(default=None, metadata={"asked": True})
    half_angle: float | None = field(default=None, metadata={"asked": False})

    def _check_profile(self) -> None:
        for name in ("top_width", "height"):
            if getattr(self, name) is not None:
                within(f"container.{name}", getattr(self, name), "m", *DIMENSIONS)
        if self.half_angle is not None:
            self._check_angle(self.half_angle)
        elif self.top_width is None or self.height is None:
            raise SloshModelError(
                "a wedge has a top_width and a height [m], or a half_angle [rad]", ("container",)
            )
        super(Wedge, self)._check_profile()

    def _check_angle(self, angle: float) -> None:
        low, high = HALF_ANGLES
        if not low <= angle <= high:
            meant = math.radians(angle)
            hint = f"; did you mean {meant:.4g} rad ({angle:g} deg)?" * (low <= meant <= high)
            raise SloshModelError(
                f"container.half_angle = {angle:g} rad must be {low:.3g} … {high:.3g} rad{hint}",
                ("container", "half_angle"),
            )
        if self.top_width is not None:
            raise SloshModelError(
                "container.half_angle and top_width: give one of them", ("container", "half_angle")
            )

    @property
    def open_ended(self) -> bool:
        """Whether the height of the rim is unknown."""
        return self.height is None

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The right wall: one straight line."""
        end = self.height or 2.0 * max(self.fill_height, self.rim_height or 0.0)
        if self.half_angle is not None:
            return (line((0.0, 0.0), (end * math.tan(self.half_angle), end)),)
        assert self.top_width is not None  # checked
        return (line((0.0, 0.0), (0.5 * self.top_width, end)),)

    def widened(self, factor: float) -> Self:
        """Returns the wedge with a scaled width and length."""
        angle, width = self.half_angle, self.top_width
        return replace(
            self, length=factor * self.length,
            half_angle=None if angle is None else math.atan(factor * math.tan(angle)),
            top_width=None if width is None else factor * width,
        )  # fmt: skip


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class LyingCylinder(TroughContainer):
    """A circular cylinder that lies along x, such as a tank, or a gutter if the rim is lower.

    Attributes:
        radius: inner radius [m].
    """

    shape: ClassVar[str] = "lying_cylinder"
    # A circle stays one: it is filled to the same part.
    wide: ClassVar[tuple[str, ...]] = ("radius", "length", "fill_height", "rim_height")

    radius: float

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The right half of the circle."""
        return (arc((0.0, self.radius), (self.radius, self.radius), -_QUARTER, _QUARTER),)
