"""How well an explanation predicts motions that were left out of its fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slosh_discovery.discover.fitting import Evaluator, Fit, fit
from slosh_discovery.discover.problem import PreparedMotion

FOLDS = 3


def held_out_rms(one: Fit, motions: Sequence[PreparedMotion]) -> float:
    """Rms of the residual of each motion, predicted with parameters fitted to the others [m].

    The motions are left out in turns, a third of them at a time. NaN where there is only one.
    """
    if len(motions) < 2:
        return float("nan")
    squares, count = 0.0, 0
    for fold in range(min(FOLDS, len(motions))):
        out = range(fold, len(motions), FOLDS) if len(motions) >= FOLDS else [fold]
        left_out = [motions[i] for i in out]
        offsets = np.array([one.clock_offsets[i] for i in out])
        seen = [i for i in range(len(motions)) if i not in out]
        vector = one.vector
        if len(vector):
            vector = fit(
                one.explanation,
                [motions[i] for i in seen],
                vector,
                [one.clock_offsets[i] for i in seen],
                evaluations=6,
            ).vector
        evaluator = Evaluator(one.explanation, left_out)
        for motion, answer, offset in zip(
            left_out, evaluator.answers(vector), offsets.tolist(), strict=True
        ):
            residual = Evaluator.part(motion, answer, offset) * motion.noise
            squares += float(residual @ residual)
            count += len(residual)
    return float(np.sqrt(squares / count))
