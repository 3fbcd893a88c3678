"""What looks like a wrong unit in a motion table: telling beats a peak of eighteen metres."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from slosh_bag.motion_table import MotionTable
from slosh_bringup.errors import SloshBringupError
from slosh_model.constants import GRAVITY
from slosh_model.model import Model
from slosh_report.input_faults import find_input_faults

IMPOSSIBLE = 1e6
"""No container survives such an acceleration [m/s²]: the table is refused."""
UNLIKELY = 100.0
"""Ten times what the models hold for [m/s²]; machines that carry liquid stay below."""
GRAVITY_SHARE = 0.1
"""Upward acceleration so close to g, most of the time, is gravity that was left in."""
MOST_OF_A_PERIOD = 0.5
"""Of the liquid's first mode: rows that are farther apart do not tell its motion."""


def check_possible(path: Path, motion: MotionTable) -> None:
    """Refuses a table whose accelerations no container undergoes.

    Raises:
        SloshBringupError: one does; the text names the file, the time and the value.
    """
    # The greatest component: a norm of 1e300 overflows.
    greatest = np.abs(motion.acceleration).max(axis=1)
    row = int(np.argmax(greatest))
    if greatest[row] > IMPOSSIBLE:
        raise SloshBringupError(
            f"{path}: line {row + 2}: an acceleration of {greatest[row]:.3g} m/s² is not possible;"
            " ax, ay, az are in m/s²"
        )


def doubts(model: Model, motion: MotionTable) -> tuple[str, ...]:
    """What looks wrong in a table, one text each; empty: nothing does."""
    found = []
    vertical = float(np.median(motion.acceleration[:, 2]))
    if abs(abs(vertical) - GRAVITY) < GRAVITY_SHARE * GRAVITY:
        found.append(
            f"az is {vertical:.2f} m/s² most of the time: gravity is included? Take it out"
        )
    fastest = float(np.linalg.norm(motion.acceleration, axis=1).max())
    if fastest > UNLIKELY:
        found.append(
            f"accelerations up to {fastest:.4g} m/s²: are they in mm/s²? They must be m/s²"
        )
    period = 2.0 * math.pi / model.mode_frequency(1)
    step = float(np.median(np.diff(motion.t))) if len(motion.t) > 1 else 0.0
    if step > MOST_OF_A_PERIOD * period:
        found.append(
            f"rows are {step:.3g} s apart, the liquid's period is {period:.2g} s: is t in s? "
            "Sample the motion more often"
        )
    found += [fault.text() for fault in find_input_faults(motion.t, motion.acceleration)]
    return tuple(found)
