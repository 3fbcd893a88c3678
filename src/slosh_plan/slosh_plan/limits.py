"""What a motion must keep."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_plan.errors import SloshPlanError

HIGHEST = 10.0
"""A greater limit [m] is a unit mistaken for another."""


@dataclass(frozen=True, slots=True)
class HeightLimits:
    """Limits of the liquid's height above the still level.

    Attributes:
        height: of the maximum over the wall, at any time [m]; infinite: none.
        residual: of the same after the motion's end [m]; infinite: none.

    Raises:
        SloshPlanError: a limit that is not positive, or higher than HIGHEST.
    """

    height: float = math.inf
    residual: float = math.inf

    def __post_init__(self) -> None:
        for name in ("height", "residual"):
            value = getattr(self, name)
            if not (0.0 < value <= HIGHEST or value == math.inf):
                raise SloshPlanError(
                    f"{name} limit = {value!r} m must lie above 0 and up to {HIGHEST:g} m"
                )

    @property
    def given(self) -> bool:
        """Whether there is one."""
        return min(self.height, self.residual) < math.inf
