"""How far a planning is, told to the client of an action's goal."""

from __future__ import annotations

import math
import time
from typing import Any

from slosh_msgs.action import PlanMotion

PERIOD = 0.5
"""Between two reports without news [s]."""


class GoalFeedback:
    """Tells the client of a goal how far it is: at each news, and twice a second."""

    def __init__(self, goal: Any) -> None:
        self._goal = goal
        self._began = self._told = time.monotonic()
        self._phase, self._duration = "", math.nan

    def tell(self, phase: str, duration: float) -> None:
        """The phase, and the shortest safe motion so far [s]."""
        self._phase, self._duration = phase, float(duration)
        self._told = time.monotonic()
        self._goal.publish_feedback(
            PlanMotion.Feedback(
                phase=phase, duration=self._duration, elapsed=self._told - self._began
            )
        )

    def cancelled(self) -> bool:
        """Whether the client has had enough; asked often."""
        if time.monotonic() - self._told > PERIOD:
            self.tell(self._phase, self._duration)
        return bool(self._goal.is_cancel_requested)
