"""How far a planning is, told to the client of an action's goal."""

from __future__ import annotations

import math
from typing import Any

from slosh_msgs.action import PlanMotion
from slosh_plan.planning.progress import PlanProgress

PERIOD = 0.5
"""Between two reports without news [s]."""


class GoalFeedback:
    """Tells the client of a goal how far it is: at each news, and twice a second."""

    def __init__(self, goal: Any) -> None:
        self._goal = goal
        self._told = PlanProgress("", math.inf, -math.inf)

    def tell(self, progress: PlanProgress) -> None:
        """Takes progress, however often it is told."""
        told = self._told
        same = (progress.phase, progress.duration) == (told.phase, told.duration)
        if same and progress.elapsed - told.elapsed < PERIOD:
            return
        self._told = progress
        duration = progress.duration if math.isfinite(progress.duration) else math.nan
        self._goal.publish_feedback(
            PlanMotion.Feedback(phase=progress.phase, duration=duration, elapsed=progress.elapsed)
        )

    @property
    def cancelled(self) -> bool:
        """Whether the client has had enough."""
        return bool(self._goal.is_cancel_requested)
