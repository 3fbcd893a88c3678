"""Limits of a motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

from slosh_model.checks import mistaken_unit
from slosh_model.model import Model
from slosh_plan.errors import SloshPlanError

HIGHEST = 1.0
"""A greater limit [m] is a unit mistaken for another."""


@dataclass(frozen=True, slots=True)
class HeightLimits:
    """Limits of the liquid's height above the still level.

    >>> from slosh_plan import HeightLimits
    >>> HeightLimits(height=0.02).residual
    inf

    Attributes:
        height: of the maximum over the wall, at any time [m]; infinite: none.
        residual: of the same after the motion's end [m]; infinite: none.
        at_rim: whether the limit of the height is the container's rim.

    Raises:
        SloshPlanError: a limit that is not positive, or higher than HIGHEST.
    """

    height: float = math.inf
    residual: float = math.inf
    at_rim: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        for name in ("height", "residual"):
            value = getattr(self, name)
            if not (0.0 < value <= HIGHEST or value == math.inf):
                meant = mistaken_unit(value, "m", 0.0, HIGHEST)
                raise SloshPlanError(
                    f"{name} limit = {value!r} m must lie above 0 and up to {HIGHEST:g} m{meant}"
                )

    def under_rim(self, model: Model) -> Self:
        """Returns the limits with the container's rim as height limit if it is lower."""
        freeboard = model.container.freeboard
        if freeboard is None or freeboard >= self.height:
            return self
        return replace(self, height=freeboard, at_rim=True)

    @property
    def height_name(self) -> str:
        """Name of the height limit: limit or rim."""
        return "rim" if self.at_rim else "limit"

    @property
    def given(self) -> bool:
        """Whether any limit of the height is given."""
        return min(self.height, self.residual) < math.inf
