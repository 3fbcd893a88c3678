"""Containers: their dimensions and the quantities derived from them.

A container is symmetric about its x and its y axis. Its antisymmetric waves n = 1, 2, … along an
axis have the wave number ξₙ/R, with R from the axis to the wall. Each shape is a module of
`slosh_model.shapes`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, NotRequired, Self, TypedDict, Unpack, cast

import numpy as np

from slosh_base.types import Array
from slosh_model.bessel import (
    MAXIMUM_MODE,
    radial_shape,
)
from slosh_model.checks import within
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.outline_wall import highest_of_many
from slosh_model.wall import Wall

if TYPE_CHECKING:
    from slosh_model.shapes.cylinder import Cylinder
    from slosh_model.shapes.rectangle import Rectangle

ROUND, RECTANGULAR = "round", "rectangular"
REVOLVED, PRISMATIC = "revolved", "prismatic"
"""Kinds of body: which effects have a meaning depends on them, and how heights add up. The first
two are the cylinder and the rectangle, the others any body of revolution and any prism."""
SECTIONS: Mapping[str, str] = MappingProxyType(
    {
        ROUND: "cylinder",
        REVOLVED: "body of revolution",
        RECTANGULAR: "rectangle",
        PRISMATIC: "prism",
    }
)
"""What each kind is, for people."""
DIMENSIONS = (1e-4, 10.0)  # m; any other value is a unit mistaken for another
X_AXIS, Y_AXIS = 0, 1
_NO_CORNERS = np.empty((0, 2))

_SHAPES: dict[str, type[Container]] = {}
SHAPES: Mapping[str, type[Container]] = MappingProxyType(_SHAPES)
"""Every kind of container by the name of its shape."""
_PLANS = ({"diameter"}, {"radius"}, {"width", "depth"})


class CupLengths(TypedDict):
    """Inner lengths of a cup [m]: diameter or radius, or width and depth.

    Attributes:
        diameter, radius: of a round one.
        width, depth: of a rectangular one, along its x and its y.
        fill_height: of the liquid at rest, above the inner floor.
        rim_height: of the rim, above the inner floor; left out: unknown.
    """

    diameter: NotRequired[float]
    radius: NotRequired[float]
    width: NotRequired[float]
    depth: NotRequired[float]
    fill_height: float
    rim_height: NotRequired[float | None]


class Container(ABC):
    """Interface of all container shapes, which the models use.

    A new shape is a subclass in a module of its own: defined, it can be named in model.yaml.
    Callers ask its methods; none asks for its class.

    >>> import slosh
    >>> slosh.Container.of(diameter=0.08, fill_height=0.06, rim_height=0.11)
    Cylinder(radius 40 mm, filled to 60 mm, rim at 110 mm)

    Attributes:
        fill_height: height h of the still liquid above the floor [m].
        rim_height: height of the rim above the floor [m]; None: unknown.
        shape: its name, as in model.yaml.
        section: its kind, one of SECTIONS.
        nonlinear_effect: the effect that makes its linear model the nonlinear one; empty: there
            is none, and the nonlinear answer is the linear one.
        built_in: effects that its shape has by itself, with their parameters.
        straight_alone: whether the surface of its linear model is straight with one mode only:
            with more of them it has their own shapes.
        validated: where its models were validated.
        surface_known: whether `surface_shape` is a mode's own, not a straight line.
        most_modes: number of modes that its models may have.
    """

    __slots__ = ()
    fill_height: float
    rim_height: float | None
    shape: ClassVar[str]
    section: ClassVar[str]
    nonlinear_effect: ClassVar[str]
    built_in: ClassVar[Mapping[str, Mapping[str, float]]]
    straight_alone: ClassVar[bool]
    validated: ClassVar[ValidityLimits]
    surface_known: ClassVar[bool] = True
    most_modes: ClassVar[int] = MAXIMUM_MODE

    @staticmethod
    def of(**lengths: Unpack[CupLengths]) -> Cylinder | Rectangle:
        """Creates a cylinder or a rectangle from its lengths [m].

        Raises:
            SloshModelError: a length that is missing, too much, unknown or impossible.
        """
        told: dict[str, Any] = {**lengths}
        given = {name: value for name, value in told.items() if value is not None}
        for name, value in given.items():
            if name not in CupLengths.__annotations__:
                known = ", ".join(CupLengths.__annotations__)
                raise SloshModelError(f"{name} is no length of a cup (known: {known})")
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise SloshModelError(f"{name} = {value!r} must be a number of metres")
        if "fill_height" not in given:
            raise SloshModelError("fill_height is missing: the height of the liquid at rest [m]")
        heights = {
            name: given.pop(name) for name in ("fill_height", "rim_height") if name in given
        }
        if set(given) not in _PLANS:
            raise SloshModelError(
                "a cup has a diameter, or a radius, or a width and a depth; given: "
                + (" and ".join(given) or "nothing")
            )
        if "diameter" in given:
            within("diameter", given["diameter"], "m", *(2.0 * size for size in DIMENSIONS))
            given = {"radius": given["diameter"] / 2.0}
        kind = cast(
            "type[Cylinder | Rectangle]", _SHAPES["cylinder" if "radius" in given else "rectangle"]
        )
        return kind(**given, **heights)

    def __repr__(self) -> str:
        rim = "" if self.rim_height is None else f", rim at {1e3 * self.rim_height:g} mm"
        return f"{type(self).__name__}({self.described}{rim})"

    @abstractmethod
    def root(self, n: int) -> float:
        """Returns ξₙ, the dimensionless wave number of the n-th antisymmetric mode.

        Raises:
            SloshModelError: n is not in 1 … MAXIMUM_MODE.
        """

    @property
    @abstractmethod
    def reaches(self) -> tuple[float, float]:
        """Distances from the axis to the wall along x and y [m]."""

    @property
    @abstractmethod
    def size(self) -> float:
        """Characteristic dimension of the container for its waves [m]."""

    @property
    @abstractmethod
    def size_name(self) -> str:
        """Name of the characteristic dimension `size`, such as 'radius'."""

    @property
    @abstractmethod
    def described(self) -> str:
        """Text that describes the container's dimensions [mm]."""

    @abstractmethod
    def mass_ratio(self, n: int, axis: int = X_AXIS) -> float:
        """Returns mₙ/m_F, the fraction of the liquid's mass that sloshes in mode n."""

    @abstractmethod
    def plane_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns a plane surface's height at the wall per displacement of a mode's mass [1]."""

    @abstractmethod
    def curved_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns a mode shape's height at the wall per displacement of the mode's mass [1]."""

    @abstractmethod
    def widened(self, factor: float) -> Self:
        """Returns the container with horizontal dimensions scaled by a factor."""

    @abstractmethod
    def damping_ratio(self, kinematic_viscosity: float) -> float:
        """Returns the first mode's damping ratio ζ₁, estimated from the viscosity ν [m²/s]."""

    def mode_damping(self, kinematic_viscosity: float, n: int) -> float:
        """Returns mode n's damping ratio ζₙ, estimated from the viscosity ν [m²/s]."""
        return self.damping_ratio(kinematic_viscosity)

    def mass_height(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the height of a mode's mass above the still surface [m]: -(2R/ξ) tanh(ξh/2R).

        Of vertical walls: Ibrahim 2005, ch. 5; Dodge 2000, ch. 3.
        """
        slenderness = self.root(n) / self.reaches[axis]
        return -2.0 / slenderness * math.tanh(0.5 * slenderness * self.fill_height)

    def height_distance(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the distance from the axis to where a mode is highest at the wall [m]."""
        return self.reaches[axis]

    def crest(self, n: int, axis: int = X_AXIS) -> tuple[float, float]:
        """Returns a mode's maximum height relative to that at the wall, and its position [m]."""
        return 1.0, self.reaches[axis]

    @property
    def volume(self) -> float:
        """Volume of the liquid [m³], or NaN if unknown."""
        return math.nan

    def surface_shape(self, n: int, axis: int = X_AXIS) -> tuple[Array, Array]:
        """Returns positions along an axis up to the wall [m], and a mode's heights there."""
        places = np.linspace(0.0, self.reaches[axis], 41)
        if self.cornered:
            shape = np.sin(self.root(n) * places / places[-1])
            return places, shape / shape[-1]
        return places, radial_shape(n, places / places[-1])

    @property
    def silhouette(self) -> Array:
        """Returns half of the wall's contour (N, 2) along x [m], z from the still level."""
        return self.side_view(X_AXIS)

    def side_view(self, axis: int = X_AXIS) -> Array:
        """Returns half of the wall's contour (N, 2) along an axis [m], z from the still level."""
        reach, rim = self.reaches[axis], self.rim_height or 1.3 * self.fill_height
        floor = -self.fill_height
        return np.array([[0.0, floor], [reach, floor], [reach, rim - self.fill_height]])

    @property
    def wall(self) -> Wall:
        """The container's wall near the still level, with the distance to the rim."""
        reaches = self.reaches
        radius = reaches[X_AXIS] if self.section == ROUND else math.nan
        return Wall.vertical(radius, self.freeboard)

    def height_below_rim(self, distance: float = 0.0) -> float | None:
        """Returns the height at the wall [m] of a crest `distance` below the rim; None if unknown.

        Args:
            distance: vertical [m]; 0: at the rim.

        Returns:
            the height; None: the rim is not known.

        Raises:
            SloshModelError: an impossible distance, or one of which the rim is not known or below
                which the still liquid is not.
        """
        if self.freeboard is None:
            if distance == 0.0:
                return None
            raise SloshModelError(
                f"a distance to the rim of {distance:g} m cannot be kept: the rim is not known; "
                "give container.rim_height in the model"
            )
        if not 0.0 <= distance < self.freeboard:
            raise SloshModelError(
                f"the distance to the rim must be 0 … {self.freeboard:g} m, the distance of the "
                f"still liquid; given {distance:g} m"
            )
        return self.wall.height_at(distance)

    @property
    def linear_height(self) -> float:
        """Wave height [m] above which the linear model fails; infinite with a nonlinear model."""
        return math.inf

    @property
    def digest(self) -> str:
        """Digest of the dimensions to which precomputed modes belong; empty if there are none."""
        return ""

    def __init_subclass__(cls) -> None:
        if "shape" in cls.__dict__:
            _SHAPES[cls.shape] = cls

    def filled_to(self, fill_height: float, rim_height: float | None) -> Self:
        """Returns the container with other heights of liquid and rim above the floor [m]."""
        changed: Self = replace(cast(Any, self), fill_height=fill_height, rim_height=rim_height)
        return changed

    @property
    def cornered(self) -> bool:
        """Whether the maximum height is the sum of the wave heights along x and y, in a corner."""
        return self.section == RECTANGULAR

    @property
    def follows_yaw(self) -> bool:
        """Whether the liquid turns about the vertical with the container, as in a box."""
        return self.section in (RECTANGULAR, PRISMATIC)

    @property
    def corners(self) -> Array:
        """Corners (K, 2) of the outline, relative to the distances to the wall along x and y [1].

        None where it is round or a rectangle.
        """
        return _NO_CORNERS

    @property
    def one_directional(self) -> bool:
        """Whether modes oscillate in fixed directions, so that each mode number has two modes."""
        return False

    def axes(self, masses: int) -> float:
        """Returns the azimuth of the axes of a model's modes from the container's +x [rad].

        Args:
            masses: number of the model's sloshing masses.
        """
        return 0.0

    def direction(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the azimuth of a mode's motion from the container's +x [rad]."""
        return 0.5 * math.pi * axis

    def msh(self, sh_x: Array, sh_y: Array) -> Array:
        """Returns the maximum sloshing height over the wall [m] (DL22, Table 2).

        Args:
            sh_x, sh_y: heights on the wall at +x and +y, of equal shapes [m].
        """
        if len(self.corners):
            return self._highest(sh_x, sh_y)[0]
        if self.cornered:
            return np.abs(sh_x) + np.abs(sh_y)
        return np.hypot(sh_x, sh_y)

    def azimuth(self, sh_x: Array, sh_y: Array) -> Array:
        """Returns the azimuth of the maximum height [rad], in (-π, π] (DL22, eq. (26)).

        In a rectangle that of its corner, or of a side's middle where all of it is as high.
        """
        if len(self.corners):
            return self._highest(sh_x, sh_y)[1]
        if self.cornered:
            reach_x, reach_y = self.reaches
            return np.arctan2(reach_y * np.sign(sh_y), reach_x * np.sign(sh_x))
        return np.arctan2(sh_y, sh_x)

    def _highest(self, sh_x: Array, sh_y: Array) -> tuple[Array, Array]:
        """Returns maximum heights [m] and azimuths [rad] on a wall with corners."""
        heights = np.stack(np.broadcast_arrays(sh_x, sh_y), axis=-1).astype(np.float64)
        found, azimuth = np.empty(heights[..., 0].size), np.empty(heights[..., 0].size)
        highest_of_many(
            self.corners, np.array(self.reaches), heights.reshape(-1, 2), found, azimuth
        )
        shape = heights.shape[:-1]
        return found.reshape(shape), azimuth.reshape(shape)

    @property
    def freeboard(self) -> float | None:
        """Height of the rim above the still level [m], or None if unknown."""
        return None if self.rim_height is None else self.rim_height - self.fill_height

    def depth_factor(self, n: int, axis: int = X_AXIS) -> float:
        """Returns tanh(ξₙ h/R), the reduction of the squared frequency by finite depth."""
        return math.tanh(self.root(n) * self.fill_height / self.reaches[axis])

    def natural_frequency(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the natural frequency ωₙ [rad/s] (DL22, eq. (3); TM20, eq. (20))."""
        return math.sqrt(GRAVITY * self.root(n) / self.reaches[axis] * self.depth_factor(n, axis))

    def _check_heights(self) -> None:
        """Raises SloshModelError for an impossible height, or a rim below the liquid."""
        within("container.fill_height", self.fill_height, "m", *DIMENSIONS)
        if self.rim_height is None:
            return
        within("container.rim_height", self.rim_height, "m", *DIMENSIONS)
        if self.rim_height <= self.fill_height:
            raise SloshModelError(
                f"container.rim_height = {self.rim_height:g} m must lie above "
                f"fill_height = {self.fill_height:g} m",
                ("container", "rim_height"),
            )
