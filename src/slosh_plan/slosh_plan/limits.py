"""Limits of the liquid's height during and after a motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Self

from slosh_model.checks import mistaken_unit
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.wall import rim_name
from slosh_plan.errors import SloshPlanError

HIGHEST = 1.0
"""A greater limit [m] is a unit mistaken for another."""


@dataclass(frozen=True, slots=True)
class HeightLimits:
    """Limits of the liquid's height above the still level, during and after a motion.

    >>> from slosh_plan import HeightLimits
    >>> HeightLimits(height=0.02).residual
    inf

    Attributes:
        height: of the maximum over the wall, at any time [m]; infinite: none.
        residual: of the same after the motion's end [m]; infinite: none.
        rim_distance: least vertical distance of the liquid to the container's rim, which is
            another way to limit the height [m]; 0: the rim itself.
        at_rim: whether the limit of the height is the rim, or that distance to it.

    Raises:
        SloshPlanError: a limit that is not positive, or higher than HIGHEST; a negative distance.
    """

    height: float = math.inf
    residual: float = math.inf
    rim_distance: float = field(default=0.0, kw_only=True)
    at_rim: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        for name in ("height", "residual"):
            value = getattr(self, name)
            if not (0.0 < value <= HIGHEST or value == math.inf):
                meant = mistaken_unit(value, "m", 0.0, HIGHEST)
                raise SloshPlanError(
                    f"{name} limit = {value!r} m must lie above 0 and up to {HIGHEST:g} m{meant}"
                )
        if not 0.0 <= self.rim_distance <= HIGHEST:
            meant = mistaken_unit(self.rim_distance, "m", 0.0, HIGHEST)
            raise SloshPlanError(
                f"rim distance = {self.rim_distance!r} m must be 0 … {HIGHEST:g} m{meant}"
            )

    def under_rim(self, model: Model) -> Self:
        """Returns the limits, lowered to the rim's height minus `rim_distance` if that is lower.

        Raises:
            SloshPlanError: a distance that the still liquid does not keep, or to a rim that is
                not known.
        """
        try:
            bound = model.container.height_below_rim(self.rim_distance)
        except SloshModelError as error:
            raise SloshPlanError(str(error)) from None
        if bound is None or bound >= self.height:
            return self
        return replace(self, height=bound, at_rim=True)

    @property
    def height_name(self) -> str:
        """Describes in words whether the height limit is the user's or the rim."""
        return rim_name(self.rim_distance) if self.at_rim else "limit"

    @property
    def given(self) -> bool:
        """Whether a limit of the liquid's height, or a distance to the rim, is set."""
        return min(self.height, self.residual) < math.inf or self.rim_distance > 0.0


def rim_words(distance: float) -> str:
    """Describes how far below or above the rim the liquid reaches; empty if that is unknown."""
    if math.isnan(distance):
        return ""
    return f", {1e3 * abs(distance):.1f} mm {'below' if distance >= 0.0 else 'above'} the rim"
