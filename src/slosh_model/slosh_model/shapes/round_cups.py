"""Bodies of revolution that are defined by a few lengths: cups, bowls, flasks, bottles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

from slosh_model.shapes.contour import Piece, Point, arc, line
from slosh_model.shapes.revolution import RevolvedContainer

_QUARTER = 0.5 * math.pi


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class RoundCup(RevolvedContainer):
    """A body of revolution that is defined by lengths in metres."""


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Cone(RoundCup):
    """A cone with its tip at the bottom, such as a funnel.

    Attributes:
        top_radius: inner radius at the rim [m].
        height: of the rim above the tip [m].
    """

    shape: ClassVar[str] = "cone"
    wide: ClassVar[tuple[str, ...]] = ("top_radius",)

    top_radius: float
    height: float

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The profile: one straight line."""
        return (line((0.0, 0.0), (self.top_radius, self.height)),)


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Frustum(RoundCup):
    """A cup with straight inclined walls, such as a paper cup or a pint glass.

    >>> from slosh_model.shapes import Frustum
    >>> Frustum(bottom_radius=0.028, top_radius=0.04, height=0.09, fill_height=0.06)
    Frustum(frustum, surface radius 36 mm, filled to 60 mm, rim at 90 mm)

    Attributes:
        bottom_radius: inner radius at the floor [m].
        top_radius: inner radius at the rim [m].
        height: of the rim above the floor [m].
    """

    shape: ClassVar[str] = "frustum"
    wide: ClassVar[tuple[str, ...]] = ("bottom_radius", "top_radius")

    bottom_radius: float
    top_radius: float
    height: float

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The profile: floor and wall."""
        return _along((0.0, 0.0), (self.bottom_radius, 0.0), (self.top_radius, self.height))


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Sphere(RoundCup):
    """A hollow sphere, or a bowl if the rim is lower.

    Attributes:
        radius: inner radius [m].
    """

    shape: ClassVar[str] = "sphere"
    # A sphere stays one: it is filled to the same part.
    wide: ClassVar[tuple[str, ...]] = ("radius", "fill_height", "rim_height")

    radius: float

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The profile: half a circle."""
        return (arc((0.0, self.radius), (self.radius, self.radius), -_QUARTER, _QUARTER),)


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Ellipsoid(RoundCup):
    """A hollow ellipsoid of revolution, or a bowl if the rim is lower.

    Attributes:
        radius: inner radius where it is widest [m].
        semi_height: half of its inner height [m].
    """

    shape: ClassVar[str] = "ellipsoid"
    wide: ClassVar[tuple[str, ...]] = ("radius",)

    radius: float
    semi_height: float

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The profile: half an ellipse."""
        return (
            arc((0.0, self.semi_height), (self.radius, self.semi_height), -_QUARTER, _QUARTER),
        )


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Beaker(RoundCup):
    """An upright cylinder with a rounded foot.

    Attributes:
        radius: inner radius [m].
        foot_radius: of the rounding between floor and wall [m].
        height: of the rim above the floor [m]; None: unknown.
    """

    shape: ClassVar[str] = "beaker"
    wide: ClassVar[tuple[str, ...]] = ("radius",)

    radius: float
    foot_radius: float
    height: float | None = None

    def _check_lengths(self) -> None:
        self._below("foot_radius", "radius")
        if self.height is not None:
            self._below("foot_radius", "height")

    @property
    def open_ended(self) -> bool:
        """Whether the height of the rim is unknown."""
        return self.height is None

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The profile: floor, foot and wall."""
        end = self.height or max(self.fill_height, self.rim_height or 0.0) + 2.0 * self.radius
        wall = line((self.radius, self.foot_radius), (self.radius, end))
        return (*_foot(self.radius, self.foot_radius), wall)


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Flask(RoundCup):
    """A conical (Erlenmeyer) flask: wide at the floor, with a straight neck.

    Attributes:
        bottom_radius: inner radius at the floor [m].
        neck_radius: inner radius of the neck [m].
        shoulder_height: where the neck begins [m].
        height: of the rim above the floor [m].
    """

    shape: ClassVar[str] = "flask"
    wide: ClassVar[tuple[str, ...]] = ("bottom_radius", "neck_radius")

    bottom_radius: float
    neck_radius: float
    shoulder_height: float
    height: float

    def _check_lengths(self) -> None:
        self._below("shoulder_height", "height")

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The profile: floor, cone and neck."""
        return _along(
            (0.0, 0.0), (self.bottom_radius, 0.0), (self.neck_radius, self.shoulder_height),
            (self.neck_radius, self.height),
        )  # fmt: skip


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class Bottle(RoundCup):
    """A bottle: rounded foot, straight body, elliptic shoulder, neck.

    Attributes:
        radius: inner radius of the body [m].
        foot_radius: of the rounding between floor and body [m].
        body_height: where the shoulder begins [m].
        neck_radius: inner radius of the neck [m].
        shoulder_height: where the neck begins [m].
        height: of the rim above the floor [m].
    """

    shape: ClassVar[str] = "bottle"
    wide: ClassVar[tuple[str, ...]] = ("radius", "neck_radius")

    radius: float
    foot_radius: float
    body_height: float
    neck_radius: float
    shoulder_height: float
    height: float

    def _check_lengths(self) -> None:
        for length, other in (
            ("foot_radius", "radius"), ("neck_radius", "radius"), ("foot_radius", "body_height"),
            ("body_height", "shoulder_height"), ("shoulder_height", "height"),
        ):  # fmt: skip
            self._below(length, other)

    @property
    def contour(self) -> tuple[Piece, ...]:
        """The profile from the floor's centre to the rim."""
        r, neck = self.radius, self.neck_radius
        low, high = self.body_height, self.shoulder_height
        return (
            *_foot(r, self.foot_radius),
            line((r, self.foot_radius), (r, low)),
            arc((neck, low), (r - neck, high - low), 0.0, _QUARTER),
            line((neck, high), (neck, self.height)),
        )


def _along(*points: Point) -> tuple[Piece, ...]:
    return tuple(line(a, b) for a, b in pairwise(points))


def _foot(radius: float, foot: float) -> tuple[Piece, Piece]:
    """Returns the profile of a floor with a rounded edge."""
    flat = radius - foot
    return line((0.0, 0.0), (flat, 0.0)), arc((flat, foot), (foot, foot), -_QUARTER, 0.0)
