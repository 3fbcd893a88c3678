"""What a plan's page shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_plan.planning.checked import Checked
from slosh_plan.planning.plan import Plan
from slosh_plan.planning.time_law import STEP

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ShownMotion:
    """A motion along the path, as it is drawn.

    Attributes:
        title: for people.
        found: the motion and what it reaches.
    """

    title: str
    found: Checked

    @property
    def times(self) -> Array:
        """(M,) of the heights, which go on after the motion's end [s]."""
        return STEP * np.arange(len(self.found.msh), dtype=np.float64)

    @property
    def acceleration(self) -> Array:
        """(N,) ‖a‖ [m/s²]."""
        return np.asarray(np.linalg.norm(self.found.motion.acceleration, axis=1))

    @property
    def jerk(self) -> Array:
        """(N - 1,) change of the acceleration from row to row, by time [m/s³]."""
        steps = np.diff(self.found.motion.acceleration, axis=0)
        return np.asarray(np.linalg.norm(steps, axis=1) / STEP)


@dataclass(frozen=True, slots=True, eq=False)
class PlanReport:
    """A plan and what its reader compares it with.

    Attributes:
        plan: the plan.
        model: the model's name.
        planned, scaled: the motion that was planned, and the best of known laws.
        proposal: the waypoints in their own times; None: they tell no motion.
        waypoints: (N, 3) [m].
        band: (2, M) lower and upper end of the planned motion's heights (95 %) [m]; None: the
            model's error is not known.
        subtitle: where model and path come from; may be empty.
        notes: what the reader must know, a sentence each.
    """

    plan: Plan
    model: str
    planned: ShownMotion
    scaled: ShownMotion
    proposal: ShownMotion | None
    waypoints: Array
    band: Array | None
    subtitle: str = ""
    notes: tuple[str, ...] = ()

    @property
    def upper(self) -> tuple[float, float] | None:
        """Upper ends of the band: of the peak, and of the height after the end [m]."""
        if self.band is None:
            return None
        end = len(self.planned.found.motion.t) - 1
        return float(self.band[1].max()), float(self.band[1][end:].max())

    @property
    def motions(self) -> tuple[ShownMotion, ...]:
        """What was there before, then what was planned; a scaled law that is the plan once."""
        before = () if self.proposal is None else (self.proposal,)
        if self.scaled.found is self.planned.found:
            return (*before, self.planned)
        return (*before, self.scaled, self.planned)
