"""What looks wrong in a planned motion: gravity, units, attitude."""

from __future__ import annotations

import math

import numpy as np

from slosh_plan.planning.waypoints import Waypoints
from slosh_plan.trajectory import Trajectory
from slosh_report.constant_meaning import attitude_doubt
from slosh_report.input_checks import IDENTITY, up_of
from slosh_report.table_checks import InputDoubt, motion_doubts

FAR = 50.0
"""No arm carries a container over a longer path [m]: it is in mm."""


def trajectory_doubts(motion: Trajectory) -> tuple[InputDoubt, ...]:
    """What looks wrong in a motion, one sentence each; empty: nothing does."""
    return motion_doubts(motion.t, motion.acceleration, motion.attitude, motion.position)


def path_doubts(path: Waypoints) -> tuple[InputDoubt, ...]:
    """What looks wrong in a path, one sentence each; empty: nothing does."""
    found = []
    length = float(np.linalg.norm(np.diff(path.position, axis=0), axis=1).sum())
    if length > FAR:
        text = f"the path is {length:.4g} m long: are its positions in mm? They must be m"
        found.append(InputDoubt(text))
    if path.attitude is not None:
        x, y, z, w = path.attitude.tolist()
        first = 1.0 - 2.0 * (y * y + z * z) > math.cos(math.radians(20.0))
        doubt = attitude_doubt(up_of(x, y, z, w), IDENTITY, first=first)
        if doubt is not None:
            found.append(InputDoubt.of(doubt))
    return tuple(found)
