"""Containers whose modes have no closed form; computed once and stored in the model file."""

from __future__ import annotations

import hashlib
import importlib
import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache, lru_cache
from types import MappingProxyType
from typing import Any, ClassVar, Self, cast

from slosh_base.addons import add_ons
from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Container
from slosh_model.errors import SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.shapes.contour import Piece
from slosh_model.shapes.mode_numbers import LEAST, MOST, ModeNumbers

_GIVEN = ("rim_height", "table")
"""Fields on which the modes do not depend."""
STEEP = 0.3
"""Height of a wave, times ω²/g, from which it is no linear one: its crest is 15 % higher than
its trough is deep (second order of a standing wave: Faltinsen & Timokha 2009, ch. 8)."""
SHALLOW = 0.2
"""And of the liquid's depth: beyond, crests run faster than troughs."""
HOW_TO_GET = (
    "the modes of this container must be computed by the add-on slosh_shapes, which is not "
    "installed (`make setup` installs it); or store them in a model file, with "
    "`slosh modes MODEL -o OUT.yaml` on a machine that has it"
)
WIDENING = 0.1
"""Relative change of the surface's radius by a wave on a sloped wall, from which it is none."""


@dataclass(frozen=True, slots=True)
class ModeTable:
    """The computed modes of a container as stored in its model file.

    Attributes:
        digest: of the container to which they belong.
        rows: first those along x, then those along y; one axis only for a round container.
    """

    digest: str
    rows: tuple[ModeNumbers, ...]


@dataclass(frozen=True, slots=True, repr=False, kw_only=True)
class SolvedContainer(Container):
    """A container that is defined by its contour and whose modes are computed.

    Its models are linear: the nonlinear answer is the linear one.

    Attributes:
        fill_height: height h of the still liquid above the deepest place of the floor [m].
        rim_height: height of the rim above it [m]; None: the contour's end.
        table: its modes where they are known already.

    Raises:
        SloshModelError: an impossible contour, fill height or rim height.
    """

    nonlinear_effect: ClassVar[str] = ""
    built_in: ClassVar[Mapping[str, Mapping[str, float]]] = MappingProxyType(
        {"quasi_static_modes": MappingProxyType({"kappa": 1.0})}
    )
    straight_alone: ClassVar[bool] = False
    # Nothing was measured: where a cylinder's linear models were validated.
    validated: ClassVar[ValidityLimits] = ValidityLimits(acceleration=8.0, jerk=60.0)
    most_modes: ClassVar[int] = MOST

    fill_height: float
    rim_height: float | None = None
    table: ModeTable | None = field(default=None, compare=False)

    @property
    @abstractmethod
    def contour(self) -> tuple[Piece, ...]:
        """The contour [m]: a profile of a body of revolution, or the outline of a prism."""

    @abstractmethod
    def solved(self, count: int) -> tuple[ModeNumbers, ...]:
        """Computes the first sloshing modes along each axis.

        Raises:
            SloshModelError: what computes them is missing, or the contour too intricate.
        """

    @property
    @abstractmethod
    def widening(self) -> float:
        """Slope of the wall at the still surface: change of radius with height [1]."""

    @property
    def digest(self) -> str:
        """Digest of everything on which the modes depend."""
        return _digest(self)

    def numbers(self, n: int, axis: int = X_AXIS) -> ModeNumbers:
        """Returns the constants of the n-th mode along an axis.

        Raises:
            SloshModelError: n is not in 1 … MOST, or it cannot be computed.
        """
        if not 1 <= n <= MOST:
            raise SloshModelError(
                f"modes = {n}: of a {self.shape} 1 … {MOST} are computed", ("modes",)
            )
        found = self._along(self._own, axis)
        if n > len(found):
            found = self._along(solved_modes(self, LEAST if n <= LEAST else MOST), axis)
        return found[n - 1]

    def with_table(self, count: int) -> Self:
        """Returns the container with at least `count` computed modes."""
        if len(self._along(self._own, X_AXIS)) >= count:
            return self
        rows = solved_modes(self, LEAST if count <= LEAST else MOST)
        table = ModeTable(self.digest, tuple(replace(row, surface=()) for row in rows))
        return cast(Self, replace(cast(Any, self), table=table))

    @property
    @abstractmethod
    def highest_fill(self) -> float:
        """Highest possible fill height [m], at the contour's end."""

    def filled_to(self, fill_height: float, rim_height: float | None) -> Self:
        """Returns the container with another fill height; interpolates the modes if it is close.

        Raises:
            SloshModelError: an impossible fill height, or modes that cannot be computed.
        """
        filled = super(SolvedContainer, self).filled_to(fill_height, rim_height)
        found = installed_solver()
        return filled if found is None else cast(Self, found.refilled(self, filled))

    @property
    def _own(self) -> tuple[ModeNumbers, ...]:
        """Returns the stored modes, or none if they belong to other dimensions."""
        if self.table is None or self.table.digest != self.digest:
            return ()
        return self.table.rows

    def _along(self, rows: tuple[ModeNumbers, ...], axis: int) -> tuple[ModeNumbers, ...]:
        along = tuple(row for row in rows if row.axis == axis)
        return along or tuple(row for row in rows if row.axis == X_AXIS)

    def root(self, n: int) -> float:
        """Returns ωₙ²R/g along x, the eigenvalue that the literature tabulates."""
        own = self.numbers(n)
        return own.natural_frequency**2 * own.reach / GRAVITY

    def natural_frequency(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the natural frequency ωₙ [rad/s]."""
        return self.numbers(n, axis).natural_frequency

    @property
    def reaches(self) -> tuple[float, float]:
        """Distances from the axis at which the liquid heights along x and y are computed [m]."""
        return self.numbers(1, 0).reach, self.numbers(1, 1).reach

    def mass_ratio(self, n: int, axis: int = X_AXIS) -> float:
        """Returns mₙ/m_F, the fraction of the liquid's mass that sloshes in mode n."""
        return self.numbers(n, axis).mass_ratio

    def plane_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns `curved_gain`; the quasi-static height adds the remainder of a plane surface."""
        return self.curved_gain(n, axis)

    def curved_gain(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the liquid height at the wall per displacement of the mode's mass [1]."""
        return self.numbers(n, axis).height_per_displacement

    def mass_height(self, n: int, axis: int = X_AXIS) -> float:
        """Returns the height of the mode's mass above the still surface [m]."""
        return self.numbers(n, axis).mass_height

    def crest(self, n: int, axis: int = X_AXIS) -> tuple[float, float]:
        """Returns a mode's maximum height relative to that at the wall, and its position [m]."""
        own = self.numbers(n, axis)
        return own.crest_ratio, own.crest_place

    def damping_ratio(self, kinematic_viscosity: float) -> float:
        """Returns the damping ratio ζ₁, computed from the flow of the mode."""
        return self.mode_damping(kinematic_viscosity, 1)

    def mode_damping(self, kinematic_viscosity: float, n: int) -> float:
        """Returns the damping ratio ζₙ, computed from the flow of the mode."""
        return self.numbers(n).damping_ratio(kinematic_viscosity)

    @property
    def linear_height(self) -> float:
        """Wave height [m] above which the linear model fails: too steep, or on a sloping wall."""
        steep = STEEP * GRAVITY / self.natural_frequency(1) ** 2
        slope = abs(self.widening)
        return min(
            steep,
            SHALLOW * self.fill_height,
            WIDENING * self.reaches[0] / slope if slope > 0.0 else math.inf,
        )


@lru_cache(maxsize=256)
def _digest(container: SolvedContainer) -> str:
    values = [
        (item.name, getattr(container, item.name))
        for item in fields(container)
        if item.name not in _GIVEN
    ]
    text = f"{container.shape} {GRAVITY!r} {values!r}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@lru_cache(maxsize=256)
def solved_modes(container: SolvedContainer, count: int) -> tuple[ModeNumbers, ...]:
    """Returns the first modes of a container along each axis, from the cache or computed.

    Raises:
        SloshModelError: they cannot be computed.
    """
    key = f"{container.digest}-{count}"
    known: tuple[ModeNumbers, ...] | None = solver().read(key)
    if known is None:
        known = container.solved(count)
        solver().write(key, known)
    return known


@cache
def installed_solver() -> Any | None:
    """Returns the module that computes modes, of the add-on slosh_shapes; None: it is absent."""
    name = next((one.mode_solver for one in add_ons() if one.mode_solver), "")
    return importlib.import_module(name) if name else None


def solver() -> Any:
    """Returns the module that computes modes: see `slosh_shapes.solver`.

    Raises:
        SloshModelError: the add-on is not installed.
    """
    found = installed_solver()
    if found is None:
        raise SloshModelError(HOW_TO_GET)
    return found
