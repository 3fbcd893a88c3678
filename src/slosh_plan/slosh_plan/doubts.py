"""Checks the gravity, units and attitude of a planned motion for plausibility."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.types import Array
from slosh_model.gaps import unresolved, unresolved_text
from slosh_model.model import Model
from slosh_model.tilt import largest_tilt
from slosh_motion.checks.table_checks import InputDoubt, motion_doubts
from slosh_plan.planning.waypoints import Waypoints
from slosh_plan.trajectory import Trajectory

FAR = 50.0
"""No arm carries a container over a longer path [m]: it is in mm."""
FAST = 20.0
"""No container moves faster on the average [m/s]: the path is in mm."""


def rows_doubt(spacing: float, model: Model) -> tuple[InputDoubt, ...]:
    """Returns a warning if a motion's rows are too far apart for the liquid.

    Args:
        spacing: longest interval between rows while it moves [s].
        model: of the liquid.
    """
    text = unresolved_text(spacing, model)
    return (InputDoubt(text, unresolved(spacing, model) == math.inf),) if text else ()


def trajectory_doubts(motion: Trajectory, model: Model) -> tuple[InputDoubt, ...]:
    """Returns one warning for each implausible gravity, unit, attitude or spacing of a motion."""
    sparse = rows_doubt(motion.spacing, model)
    if any(doubt.wrong for doubt in sparse):
        # What such rows tell of rest and gravity says nothing.
        return sparse
    return (*sparse, *_motion_doubts(motion))


def _motion_doubts(motion: Trajectory) -> tuple[InputDoubt, ...]:
    found = motion_doubts(motion.t, motion.acceleration, motion.attitude, motion.position)
    return (*attitude_doubts(motion.attitude), *found)


def attitude_doubts(attitude: Array | None) -> tuple[InputDoubt, ...]:
    """Returns a warning if a container is upside down, e.g. due to a wrong tool frame.

    Args:
        attitude: (N, 4) quaternions x, y, z, w, world ← container; None: upright.
    """
    tilt = 0.0 if attitude is None else largest_tilt(attitude)
    if tilt <= 0.5 * np.pi:
        return ()
    text = (
        f"the container is turned upside down (tilted by {np.degrees(tilt):.0f} degrees): z of "
        "its frame must point up, along its axis; tool frames often point down: add a fixed link"
    )
    return (InputDoubt(text),)


def path_doubts(path: Waypoints) -> tuple[InputDoubt, ...]:
    """Returns a warning if a path's length suggests that its positions are in mm."""
    length = float(np.linalg.norm(np.diff(path.position, axis=0), axis=1).sum())
    lasts = float(path.t[-1] - path.t[0])
    if length <= FAR and length <= FAST * lasts:
        return ()
    pace = "" if length > FAR else f", to be passed in {lasts:.3g} s"
    text = f"the path is {length:.4g} m long{pace}: are its positions in mm? They must be m"
    return (InputDoubt(text),)
