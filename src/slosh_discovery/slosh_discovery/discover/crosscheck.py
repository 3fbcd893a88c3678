"""Cross-validates a fit: predicts motions that were left out of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.fitting import Evaluator, Fit, fit
from slosh_discovery.discover.problem import PreparedMotion

FOLDS = 3
MotionSet = list[tuple[PreparedMotion, float]]


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Residuals of motions that were predicted with parameters fitted to other motions.

    Attributes:
        chi_square: sum of its squares, in units of the noise.
        rms: its root mean square [m].
    """

    chi_square: float
    rms: float


def held_out(one: Fit, motions: Sequence[PreparedMotion]) -> HeldOut:
    """Predicts motions, or parts of motions, with parameters fitted to the other motions."""
    chi_square, squares, count = 0.0, 0.0, 0
    for seen, left_out in _folds(motions, one.clock_offsets):
        vector = one.vector
        if len(vector):
            vector = fit(
                one.explanation,
                [motion for motion, _ in seen],
                vector,
                [offset for _, offset in seen],
                evaluations=6,
            ).vector
        evaluator = Evaluator(one.explanation, [motion for motion, _ in left_out])
        for (motion, offset), answer in zip(left_out, evaluator.answers(vector), strict=True):
            residual = Evaluator.part(motion, answer, offset)
            chi_square += float(residual @ residual)
            squares += float(np.sum(motion.in_metres(residual) ** 2))
            count += len(residual)
    return HeldOut(chi_square, float(np.sqrt(squares / count)))


def _folds(
    motions: Sequence[PreparedMotion], offsets: Sequence[float]
) -> Iterator[tuple[MotionSet, MotionSet]]:
    """Yields cross-validation folds (fitted motions, left-out motions); each leaves out a third.

    Of fewer than three motions a third of each one's time is left out instead. Of each group as
    many are left out as can be: what is its own can only be seen in its own motions.
    """
    pairs = sorted(zip(motions, offsets, strict=True), key=lambda pair: pair[0].motion.group or "")
    for fold in range(FOLDS):
        if len(pairs) >= FOLDS:
            yield (
                [pair for i, pair in enumerate(pairs) if i % FOLDS != fold],
                pairs[fold::FOLDS],
            )
            continue
        blocks = [_block(motion, fold) for motion, _ in pairs]
        yield (
            [(_only(motion, ~b), o) for (motion, o), b in zip(pairs, blocks, strict=True)],
            [(_only(motion, b), o) for (motion, o), b in zip(pairs, blocks, strict=True)],
        )


def _block(motion: PreparedMotion, fold: int) -> NDArray[np.bool_]:
    """Returns a mask (M, 1) of the samples in one third of a motion's duration."""
    number = np.arange(len(motion.t)) * FOLDS // len(motion.t)
    return np.asarray(number == fold)[:, np.newaxis]


def _only(motion: PreparedMotion, samples: NDArray[np.bool_]) -> PreparedMotion:
    return replace(motion, kept=motion.kept & samples)
