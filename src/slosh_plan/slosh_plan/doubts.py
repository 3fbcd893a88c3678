"""Checks the gravity, units and attitude of a planned motion for plausibility."""

from __future__ import annotations

import numpy as np

from slosh_metrics.input_checks.table_checks import InputDoubt, motion_doubts
from slosh_plan.planning.waypoints import Waypoints
from slosh_plan.trajectory import Trajectory

FAR = 50.0
"""No arm carries a container over a longer path [m]: it is in mm."""
FAST = 20.0
"""No container moves faster on the average [m/s]: the path is in mm."""


def trajectory_doubts(motion: Trajectory) -> tuple[InputDoubt, ...]:
    """Returns one sentence for each suspected fault of a motion."""
    return motion_doubts(motion.t, motion.acceleration, motion.attitude, motion.position)


def path_doubts(path: Waypoints) -> tuple[InputDoubt, ...]:
    """Returns one sentence for each suspected fault of a path."""
    length = float(np.linalg.norm(np.diff(path.position, axis=0), axis=1).sum())
    lasts = float(path.t[-1] - path.t[0])
    if length <= FAR and length <= FAST * lasts:
        return ()
    pace = "" if length > FAR else f", to be passed in {lasts:.3g} s"
    text = f"the path is {length:.4g} m long{pace}: are its positions in mm? They must be m"
    return (InputDoubt(text),)
