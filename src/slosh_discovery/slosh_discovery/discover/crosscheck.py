"""How well an explanation predicts motions that were left out of its fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slosh_discovery.discover.fitting import Evaluator, Fit, fit
from slosh_discovery.discover.problem import PreparedMotion

FOLDS = 3


@dataclass(frozen=True, slots=True)
class HeldOut:
    """The residual of motions that were predicted with parameters fitted to others.

    Attributes:
        chi_square: sum of its squares, in units of the noise.
        rms: its root mean square [m].
    """

    chi_square: float
    rms: float


def held_out(one: Fit, motions: Sequence[PreparedMotion]) -> HeldOut:
    """Predicts each motion with parameters fitted to others.

    The motions are left out in turns, a third of them at a time. A single motion is predicted
    with its own parameters: there are no others.
    """
    if len(motions) < 2:
        noise = motions[0].noise
        return HeldOut(one.chi_square, noise * float(np.sqrt(np.mean(one.residual**2))))
    chi_square, squares, count = 0.0, 0.0, 0
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
            residual = Evaluator.part(motion, answer, offset)
            power = float(residual @ residual)
            chi_square += power
            squares += power * motion.noise**2
            count += len(residual)
    return HeldOut(chi_square, float(np.sqrt(squares / count)))
