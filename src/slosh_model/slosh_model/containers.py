"""Containers: their dimensions and what follows from them alone.

Those here are upright, of constant cross-section and symmetric about their x and their y axis.
Their antisymmetric waves n = 1, 2, … along an axis have the wave number ξₙ/R, with R from the axis
to the wall and roots ξₙ that are those of the cross-section's shape. Those whose modes have no
such closed form are in `slosh_model.shapes`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar, NotRequired, Self, TypedDict, Unpack, cast

import numpy as np

from slosh_base.types import Array
from slosh_model.bessel import (
    MAXIMUM_MODE,
    bessel_derivative_root,
    check_mode,
    radial_shape,
)
from slosh_model.checks import within
from slosh_model.constants import GRAVITY
from slosh_model.errors import SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.wall import Wall

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
# The formula's own rounding of the first root of J1'.
FIRST_ROOT = 1.84

_SHAPES: dict[str, type[Container]] = {}
SHAPES: Mapping[str, type[Container]] = MappingProxyType(_SHAPES)
"""Every kind of container by the name of its shape."""
_PLANS = ({"diameter"}, {"radius"}, {"width", "depth"})


class CupLengths(TypedDict):
    """Inner lengths of a cup [m]: a diameter or a radius, or a width and a depth.

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
    """What the models need to know of a container.

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
    most_modes: ClassVar[int] = MAXIMUM_MODE

    @staticmethod
    def of(**lengths: Unpack[CupLengths]) -> Cylinder | Rectangle:
        """A container by its lengths.

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
        kind: type[Cylinder | Rectangle] = Cylinder if "radius" in given else Rectangle
        return kind(**given, **heights)

    def __repr__(self) -> str:
        rim = "" if self.rim_height is None else f", rim at {1e3 * self.rim_height:g} mm"
        return f"{type(self).__name__}({self.described}{rim})"

    @abstractmethod
    def root(self, n: int) -> float:
        """ξₙ of the n-th antisymmetric mode.

        Raises:
            SloshModelError: n is not in 1 … MAXIMUM_MODE.
        """

    @property
    @abstractmethod
    def reaches(self) -> tuple[float, float]:
        """R along x and along y: from the axis to the wall [m]."""

    @property
    @abstractmethod
    def size(self) -> float:
        """The dimension on which its waves depend most [m]."""

    @property
    @abstractmethod
    def size_name(self) -> str:
        """What `size` is, for people."""

    @property
    @abstractmethod
    def described(self) -> str:
        """Its dimensions for people [mm]."""

    @abstractmethod
    def mass_ratio(self, n: int, axis: int = X_AXIS) -> float:
        """mₙ/m_F, the share of the liquid's mass that sloshes in mode n."""

    @abstractmethod
    def plane_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Wall height per displacement of a mode's mass where the surface is a plane [1]."""

    @abstractmethod
    def curved_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Wall height per displacement of a mode's mass where it has the mode's shape [1]."""

    @abstractmethod
    def widened(self, factor: float) -> Self:
        """The same container with its horizontal dimensions larger by a factor."""

    @abstractmethod
    def damping_ratio(self, kinematic_viscosity: float) -> float:
        """ζ₁ from the viscosity ν [m²/s] where none was measured."""

    def mode_damping(self, kinematic_viscosity: float, n: int) -> float:
        """ζₙ from the viscosity ν [m²/s]; where nothing else is known that of the first mode."""
        return self.damping_ratio(kinematic_viscosity)

    def mass_height(self, n: int, axis: int = X_AXIS) -> float:
        """Height of a mode's mass above the still surface [m]: -(2R/ξ) tanh(ξh/2R).

        Of vertical walls: Ibrahim 2005, ch. 5; Dodge 2000, ch. 3.
        """
        slenderness = self.root(n) / self.reaches[axis]
        return -2.0 / slenderness * math.tanh(0.5 * slenderness * self.fill_height)

    def crest(self, n: int, axis: int = X_AXIS) -> tuple[float, float]:
        """A mode's largest height over the surface, relative to the wall's, and its place [m]."""
        return 1.0, self.reaches[axis]

    @property
    def volume(self) -> float:
        """Of the liquid [m³]; NaN: unknown."""
        return math.nan

    def surface_shape(self, n: int) -> tuple[Array, Array]:
        """Places along x from the axis to the wall [m], and a mode's height there."""
        places = np.linspace(0.0, self.reaches[X_AXIS], 41)
        if self.cornered:
            shape = np.sin(self.root(n) * places / places[-1])
            return places, shape / shape[-1]
        return places, radial_shape(n, places / places[-1])

    @property
    def silhouette(self) -> Array:
        """(N, 2) its wall's right half from the side, z from the still surface [m]."""
        reach, rim = self.reaches[X_AXIS], self.rim_height or 1.3 * self.fill_height
        floor = -self.fill_height
        return np.array([[0.0, floor], [reach, floor], [reach, rim - self.fill_height]])

    @property
    def wall(self) -> Wall:
        """Its wall about the still level: what a height is on it, and how far from the rim."""
        reaches = self.reaches
        radius = reaches[X_AXIS] if self.section == ROUND else math.nan
        return Wall.vertical(radius, self.freeboard)

    def height_below_rim(self, distance: float = 0.0) -> float | None:
        """Height at the wall at which the highest place is a distance below the rim [m].

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
        """Height from which its only model, the linear one, fails [m]; else infinite."""
        return math.inf

    @property
    def digest(self) -> str:
        """Of all that its modes depend on, where they travel with the model; else empty."""
        return ""

    def __init_subclass__(cls) -> None:
        if "shape" in cls.__dict__:
            _SHAPES[cls.shape] = cls

    def filled_to(self, fill_height: float, rim_height: float | None) -> Self:
        """The same container with other heights of liquid and rim above the floor [m]."""
        changed: Self = replace(cast(Any, self), fill_height=fill_height, rim_height=rim_height)
        return changed

    @property
    def cornered(self) -> bool:
        """Whether the heights along x and y add up in a corner of the wall."""
        return self.section == RECTANGULAR

    def msh(self, sh_x: Array, sh_y: Array) -> Array:
        """Maximum sloshing height over the wall [m] (DL22, Table 2).

        Args:
            sh_x, sh_y: heights on the wall at +x and +y, of equal shapes [m].
        """
        if self.cornered:
            return np.abs(sh_x) + np.abs(sh_y)
        return np.hypot(sh_x, sh_y)

    def azimuth(self, sh_x: Array, sh_y: Array) -> Array:
        """Azimuth of the maximum [rad], in (-π, π] (DL22, eq. (26)).

        In a rectangle that of its corner, or of a side's middle where all of it is as high.
        """
        if self.cornered:
            reach_x, reach_y = self.reaches
            return np.arctan2(reach_y * np.sign(sh_y), reach_x * np.sign(sh_x))
        return np.arctan2(sh_y, sh_x)

    @property
    def freeboard(self) -> float | None:
        """Height of the rim above the still level [m]; None: unknown."""
        return None if self.rim_height is None else self.rim_height - self.fill_height

    def depth_factor(self, n: int, axis: int = X_AXIS) -> float:
        """tanh(ξₙ h/R), the share of the deep-liquid frequency squared that this depth leaves."""
        return math.tanh(self.root(n) * self.fill_height / self.reaches[axis])

    def natural_frequency(self, n: int, axis: int = X_AXIS) -> float:
        """ωₙ [rad/s] (DL22, eq. (3); TM20, eq. (20))."""
        return math.sqrt(GRAVITY * self.root(n) / self.reaches[axis] * self.depth_factor(n, axis))

    def _check_heights(self) -> None:
        """Raises SloshModelError: a height outside DIMENSIONS, or the rim not above the liquid."""
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


@dataclass(frozen=True, slots=True, repr=False)
class Cylinder(Container):
    """An upright circular cylinder.

    >>> from slosh_model import Cylinder
    >>> cup = Cylinder(radius=0.04, fill_height=0.06, rim_height=0.11)
    >>> cup.size  # m
    0.04

    Attributes:
        radius: inner radius R [m].
        fill_height: height h of the still liquid above the floor [m].
        rim_height: height of the rim above the floor [m]; None: unknown.

    Raises:
        SloshModelError: a dimension is outside DIMENSIONS, or the rim not above the liquid.
    """

    shape: ClassVar[str] = "cylinder"
    section: ClassVar[str] = ROUND
    nonlinear_effect: ClassVar[str] = "surface_nonlinearity"
    built_in: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType({})
    straight_alone: ClassVar[bool] = False
    validated: ClassVar[ValidityLimits] = ValidityLimits()

    radius: float
    fill_height: float
    rim_height: float | None = None

    def __post_init__(self) -> None:
        within("container.radius", self.radius, "m", *DIMENSIONS)
        self._check_heights()

    def root(self, n: int) -> float:
        """ξₙ, the n-th root of J₁′."""
        return bessel_derivative_root(n)

    @property
    def reaches(self) -> tuple[float, float]:
        """The radius, twice [m]."""
        return self.radius, self.radius

    @property
    def volume(self) -> float:
        """πR²h [m³]."""
        return math.pi * self.radius**2 * self.fill_height

    @property
    def described(self) -> str:
        """Its dimensions for people [mm]."""
        return f"radius {1e3 * self.radius:g} mm, filled to {1e3 * self.fill_height:g} mm"

    @property
    def size(self) -> float:
        """The radius [m]."""
        return self.radius

    @property
    def size_name(self) -> str:
        """Its name."""
        return "radius"

    def mass_ratio(self, n: int, axis: int = X_AXIS) -> float:
        """mₙ/m_F, the share of the liquid's mass that sloshes in mode n (DL22, eq. (4))."""
        xi = bessel_derivative_root(n)
        slenderness = xi * self.fill_height / self.radius
        return 2.0 * self.depth_factor(n) / (slenderness * (xi**2 - 1.0))

    def plane_gain(self, n: int, axis: int = X_AXIS) -> float:
        """4 h mₙ/(m_F R) (DL22, eq. (22))."""
        slenderness = self.fill_height / self.radius
        return 4.0 * slenderness * self.mass_ratio(n)

    def curved_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Of the Bessel surface: ξₙ² h mₙ/(m_F R) (DL22, eq. (24))."""
        return self.plane_gain(n) * self.root(n) ** 2 / 4.0

    def widened(self, factor: float) -> Self:
        """The same with a larger radius."""
        return replace(self, radius=self.radius * factor)

    def damping_ratio(self, kinematic_viscosity: float) -> float:
        """ζ₁ of a smooth cylinder.

        The empirical formula in Ibrahim, *Liquid Sloshing Dynamics* (2005), and Dodge, *The New
        "Dynamic Behavior of Liquids in Moving Containers"* (2000).
        """
        viscous = math.sqrt(kinematic_viscosity / math.sqrt(GRAVITY * self.radius**3))
        ratio = self.fill_height / self.radius
        # 1/sinh and 1/cosh by exp(-x): a deep container must not overflow.
        decay = math.exp(-FIRST_ROOT * ratio)
        inverse_sinh = 2.0 * decay / (1.0 - decay**2)
        inverse_cosh = 2.0 * decay / (1.0 + decay**2)
        return 0.92 * viscous * (1.0 + 0.318 * inverse_sinh * (1.0 + (1.0 - ratio) * inverse_cosh))


@dataclass(frozen=True, slots=True, repr=False)
class Rectangle(Container):
    """An upright container of rectangular cross-section.

    Its liquid follows its yaw: the modes' axes are its own.

    >>> from slosh_model import Rectangle
    >>> tray = Rectangle(width=0.2, depth=0.1, fill_height=0.03)
    >>> tray.size  # m
    0.2

    Attributes:
        width: inner width w along the container's x [m].
        depth: inner depth d along the container's y [m].
        fill_height: height h of the still liquid above the floor [m].
        rim_height: height of the rim above the floor [m]; None: unknown.

    Raises:
        SloshModelError: a dimension is outside DIMENSIONS, or the rim not above the liquid.
    """

    shape: ClassVar[str] = "rectangle"
    section: ClassVar[str] = RECTANGULAR
    nonlinear_effect: ClassVar[str] = "pendulum_nonlinearity"
    built_in: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType(
        {"yaw_coupling": MappingProxyType({"kappa": 1.0})}
    )
    straight_alone: ClassVar[bool] = True
    # The motions that TM20 measured, quintic with a stroke of 100 mm and b = 0.4: the slowest and
    # the fastest of the speeds up to which the surface is a line (Table 4: 42 … 57 1/min).
    validated: ClassVar[ValidityLimits] = ValidityLimits(
        acceleration=3.3, jerk=80.0, planar_acceleration=1.8, planar_jerk=32.0
    )

    width: float
    depth: float
    fill_height: float
    rim_height: float | None = None

    def __post_init__(self) -> None:
        within("container.width", self.width, "m", *DIMENSIONS)
        within("container.depth", self.depth, "m", *DIMENSIONS)
        self._check_heights()

    def root(self, n: int) -> float:
        """ξₙ = (2n - 1) π/2: half a wave, three halves and so on lie between the walls."""
        check_mode(n)
        return (2 * n - 1) * math.pi / 2.0

    @property
    def reaches(self) -> tuple[float, float]:
        """Half the width and half the depth [m]."""
        return self.width / 2.0, self.depth / 2.0

    @property
    def volume(self) -> float:
        """W d h [m³]."""
        return self.width * self.depth * self.fill_height

    @property
    def described(self) -> str:
        """Its dimensions for people [mm]."""
        sides = f"width {1e3 * self.width:g} mm, depth {1e3 * self.depth:g} mm"
        return f"{sides}, filled to {1e3 * self.fill_height:g} mm"

    @property
    def size(self) -> float:
        """The width [m]."""
        return self.width

    @property
    def size_name(self) -> str:
        """Its name."""
        return "width"

    def mass_ratio(self, n: int, axis: int = X_AXIS) -> float:
        """mₙ/m_F = 2 R tanh(ξₙ h/R)/(ξₙ³ h) (Ibrahim 2005, ch. 5; Dodge 2000, ch. 3)."""
        xi = self.root(n)
        return 2.0 * self.depth_factor(n, axis) * self.reaches[axis] / (xi**3 * self.fill_height)

    def plane_gain(self, n: int, axis: int = X_AXIS) -> float:
        """ωₙ² R/g: the straight line takes all of a static tilt (TM20, eq. (9), η = θ w/2)."""
        return self.root(n) * self.depth_factor(n, axis)

    def curved_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Of a standing wave, sin(ξₙ x/R): 2/ξₙ² of the line's, together with all others all."""
        return 2.0 / self.root(n) ** 2 * self.plane_gain(n, axis)

    def widened(self, factor: float) -> Self:
        """The same with a larger width and depth."""
        return replace(self, width=self.width * factor, depth=self.depth * factor)

    def damping_ratio(self, kinematic_viscosity: float) -> float:
        """ζ₁ along the longer side, from the layers on floor and walls (Keulegan 1959)."""
        along, across = max(self.width, self.depth), min(self.width, self.depth)
        axis = X_AXIS if self.width >= self.depth else Y_AXIS
        omega, k = self.natural_frequency(1, axis), math.pi / along
        # 2kh/sinh(2kh) by exp(-x): a deep container must not overflow.
        decay = math.exp(-2.0 * k * self.fill_height)
        floor = 2.0 * k * self.fill_height * 2.0 * decay / (1.0 - decay**2)
        layers = floor / (2.0 * self.fill_height) + (1.0 - floor) / along + 1.0 / across
        return math.sqrt(kinematic_viscosity / (2.0 * omega)) * layers
