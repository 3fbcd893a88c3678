"""What looks wrong in a motion table: telling beats a peak of eighteen metres."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from slosh_bringup.errors import SloshBringupError
from slosh_metrics.input_checks.table_checks import InputDoubt, motion_doubts
from slosh_model.model import Model
from slosh_tables.motion_table import MotionTable

IMPOSSIBLE = 1e6
"""No container survives such an acceleration [m/s²]: the table is refused."""
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
            f"{path}: line {row + 2}: an acceleration of {greatest[row]:.3g} m/s² is not "
            "possible; ax, ay, az must be in m/s²"
        )


def doubts(model: Model, motion: MotionTable) -> tuple[InputDoubt, ...]:
    """What looks wrong in a table, one text each; empty: nothing does."""
    period = 2.0 * math.pi / model.mode_frequency(1)
    step = float(np.median(np.diff(motion.t))) if len(motion.t) > 1 else 0.0
    if step > MOST_OF_A_PERIOD * period:
        # What such rows tell of rest and gravity says nothing.
        return (
            InputDoubt(
                f"rows are {step:.3g} s apart, the liquid's period is {period:.2g} s: is t in s? "
                "Sample the motion more often"
            ),
        )
    return motion_doubts(motion.t, motion.acceleration, motion.attitude)
