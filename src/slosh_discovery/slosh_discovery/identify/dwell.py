"""Computes the liquid's residual vibration during a dwell, measured and simulated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.identify.result import DwellVibration, FittedMotion
from slosh_discovery.identify.trials import rise_span
from slosh_discovery.identify.tuning import TUNING
from slosh_motion.signals.metrics import (
    effective_difference,
    effective_height,
    line_slopes,
)


def dwell_vibration(
    motions: Sequence[MeasuredMotion], shown: Sequence[FittedMotion], half_width: float
) -> tuple[DwellVibration, ...]:
    """Returns the residual vibration at each operating point, from measured surface profiles.

    Args:
        motions: as measured.
        shown: what the identified model says of each.
        half_width: of the container [m].
    """
    found: dict[str, list[tuple[float, float, float]]] = {}
    for motion, answer in zip(motions, shown, strict=True):
        if motion.profile is None or motion.profile_x is None:
            continue
        dwell = motion.t > rise_span(motion.inputs)[1]
        if np.count_nonzero(dwell) < TUNING.least_frames:
            continue
        t, x, eta = motion.t[dwell], motion.profile_x, motion.profile[dwell]
        simulated = answer.after[dwell, 0] / half_width
        found.setdefault(answer.point, []).append(
            (
                effective_height(t, x, eta),
                effective_difference(t, x, eta, line_slopes(x, eta)),
                effective_difference(t, x, eta, simulated),
            )
        )
    return tuple(
        DwellVibration(
            point,
            len(rows),
            max(row[0] for row in rows),
            float(np.sqrt(np.mean([row[1] ** 2 for row in rows]))),
            float(np.sqrt(np.mean([row[2] ** 2 for row in rows]))),
        )
        for point, rows in found.items()
    )
