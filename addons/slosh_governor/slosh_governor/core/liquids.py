"""Compiled functions for the liquids apart from the governor's steps.

They advance them over the time by which a step is late.
"""

from __future__ import annotations

import numpy as np
from numba.types import float64, void

from slosh_base.compiled.compilation import (
    CHANGED_1,
    CHANGED_2,
    GIVEN_1,
    GIVEN_2,
    compiled,
    entry_point,
)
from slosh_governor.core.carried import carry_on
from slosh_governor.core.chain import felt_at
from slosh_governor.core.layout import MODELS, PLACE, POINT, RATE, SIZE, VELOCITY
from slosh_model.kernel import UPRIGHT, advance
from slosh_model.layout import records


@compiled
def advance_all(stores, cups, chosen, period):  # type: ignore[no-untyped-def]
    """Advances the models of all containers by a step, to the accelerations at its end.

    Args:
        stores: (C MODELS, …) the models; changed.
        cups: (C, CUP).
        chosen: (P, 3) acceleration at each point [m/s²].
        period: of the step [s].
    """
    for number in range(stores.shape[0]):
        cup = cups[number // MODELS]
        runs, modes = records(stores[number, : int(cup[SIZE])])
        felt = chosen[int(cup[POINT])]
        advance(runs[0], modes, felt[0], felt[1], felt[2], 0.0, UPRIGHT, period)


@entry_point(void(GIVEN_2, GIVEN_2, CHANGED_2, CHANGED_2))
def feel(joints, points, motion, felt):  # type: ignore[no-untyped-def]
    """Computes the acceleration of points on a robot's last link; arguments as `chain.felt_at`."""
    felt_at(joints, points, motion, felt, np.empty(3))


@entry_point(
    void(
        CHANGED_2, CHANGED_2, float64, GIVEN_2, GIVEN_2, GIVEN_2, GIVEN_2, GIVEN_2, GIVEN_1,
        CHANGED_2, CHANGED_1, CHANGED_2,
    )
)  # fmt: skip
def hold(  # type: ignore[no-untyped-def]
    stores, motion, period, cups, joints, points, links, ranges, goal, carrying, refused, chosen,
):  # fmt: skip
    """Advances motion and models by a time in which the robot holds its velocity.

    The acceleration of the motion stays stored: the next step goes on from there.

    Args:
        stores: (C MODELS, …) the models of all containers; changed.
        motion: (3, D); its position is changed.
        period: [s].
        cups, joints, points, links, ranges, goal, carrying, refused: see `kernel.govern`.
        chosen: (P, 3) receives the acceleration at each point [m/s²].
    """
    motion[PLACE] += period * motion[VELOCITY]
    steady = motion.copy()
    steady[RATE] = 0.0
    chosen[:] = 0.0
    if joints.shape[0] > 0:
        felt_at(joints, points, steady, chosen, np.empty(3))
    carry_on(steady, period, (links, ranges, goal, carrying, refused))
    advance_all(stores, cups, chosen, period)
