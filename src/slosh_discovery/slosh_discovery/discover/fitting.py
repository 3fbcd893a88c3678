"""Fits the parameters of a candidate model to measured motions.

Where the clocks of inputs and heights are not one, each motion's offset is a parameter of its own;
where the still level is unknown, each motion's mean residual is taken out. Both are nuisances:
they are fitted with every explanation alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from slosh_base.types import Array
from slosh_discovery.discover.explanation import Explanation
from slosh_discovery.discover.problem import Answer, PreparedMotion, simulate_all
from slosh_discovery.discover.tuning import TUNING
from slosh_model.model import Model

STEP = 1e-3
"""Step of the derivatives, relative to a parameter's plausible width."""
CLOCK_STEP = 1e-3
"""Step of the derivative by a clock offset [s]."""
TOLERANCE = 1e-4
IMPOSSIBLE = 1e3
"""Residual, in units of the noise, where a model has no answer."""


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Fitted parameters and residuals of a candidate model.

    Attributes:
        explanation: what was fitted.
        vector: (P,) the free parameters.
        clock_offsets: measured minus inputs' clock of each motion [s].
        residual: (N,) in units of the noise, all motions in a row, only where there are samples.
        jacobian: (N, P) of the residual by the free parameters.
        chi_square: sum of the squared residuals.
        information: (P, P) JᵀJ.
    """

    explanation: Explanation
    vector: Array
    clock_offsets: tuple[float, ...]
    residual: Array
    jacobian: Array
    chi_square: float = field(init=False)
    information: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "chi_square", float(self.residual @ self.residual))
        object.__setattr__(self, "information", self.jacobian.T @ self.jacobian)

    @property
    def model(self) -> Model:
        """The fitted model, without effects whose parameters differ between groups of motions."""
        return self.model_of(None)

    def model_of(self, group: str | None) -> Model:
        """Returns the fitted model for the motions of one group."""
        model = self.explanation.model(self.vector, group)
        assert model is not None  # a fit ends within its bounds
        return model


@dataclass(slots=True)
class Evaluator:
    """Computes the residuals of one candidate model over several motions."""

    explanation: Explanation
    motions: Sequence[PreparedMotion]

    def answers(self, vector: Array) -> list[Answer | None]:
        """Returns the model's response to each motion, or None for a motion without a solution."""
        rows = range(len(self.motions))
        return self._answers([(vector, row) for row in rows])

    def _answers(self, asked: Sequence[tuple[Array, int]]) -> list[Answer | None]:
        """Returns the responses for pairs of a parameter vector and the index of a motion."""
        models: dict[tuple[bytes, str | None], Model | None] = {}
        pairs: list[tuple[Model, PreparedMotion] | None] = []
        for vector, row in asked:
            motion = self.motions[row]
            key = vector.tobytes(), motion.motion.group
            if key not in models:
                models[key] = self.explanation.model(vector, motion.motion.group)
            model = models[key]
            pairs.append(None if model is None else (model, motion))
        found = iter(simulate_all([pair for pair in pairs if pair is not None]))
        return [None if pair is None else next(found) for pair in pairs]

    def residual(self, answers: Sequence[Answer | None], clock_offsets: Array) -> Array:
        """Returns measured minus predicted heights (N,) in noise standard deviations."""
        parts = [
            self.part(motion, answer, offset)
            for motion, answer, offset in zip(
                self.motions, answers, clock_offsets.tolist(), strict=True
            )
        ]
        return np.concatenate(parts)

    @staticmethod
    def part(motion: PreparedMotion, answer: Answer | None, offset: float) -> Array:
        """Returns the residual of one motion, in standard deviations of the noise."""
        if answer is None:
            return np.full(int(motion.kept.sum()), IMPOSSIBLE)
        heights = answer.at(motion.t, offset)
        difference = (motion.heights - heights)[motion.kept]
        # Ten times as fast as nan_to_num, which looks for infinities, too: there are none.
        difference[np.isnan(difference)] = IMPOSSIBLE * motion.noise
        if not motion.motion.level_known:
            difference = difference - difference.mean()
        return np.clip(motion.in_noises(difference), -1e6, 1e6)

    def derivative(self, vector: Array, clock_offsets: Array, residual: Array) -> Array:
        """Returns the derivatives (N, P) of the residual with respect to the free parameters."""
        _, upper = self.explanation.bounds
        steps = STEP * self.explanation.widths
        steps[vector + steps > upper] *= -1.0
        if not len(steps):
            return np.zeros((len(residual), 0))
        # A group's own parameter moves nothing in the motions of another.
        asked = [
            (column, row)
            for column, free in enumerate(self.explanation.free)
            for row, motion in enumerate(self.motions)
            if free.group in (None, motion.motion.group)
        ]
        moved = vector + np.diag(steps)
        answers = self._answers([(moved[column], row) for column, row in asked])
        ends = np.cumsum([0, *(int(motion.kept.sum()) for motion in self.motions)])
        slopes = np.zeros((len(residual), len(steps)))
        for (column, row), answer in zip(asked, answers, strict=True):
            rows = slice(ends[row], ends[row + 1])
            part = self.part(self.motions[row], answer, float(clock_offsets[row]))
            slopes[rows, column] = (part - residual[rows]) / steps[column]
        return slopes

    def clock_derivative(self, answers: Sequence[Answer | None], clock_offsets: Array) -> Array:
        """Returns the residual's derivatives (N, C) with respect to unknown clock offsets."""
        lengths = [int(motion.kept.sum()) for motion in self.motions]
        ends = np.cumsum(lengths)
        free = [i for i, motion in enumerate(self.motions) if not motion.motion.same_clock]
        columns = np.zeros((int(ends[-1]), len(free)))
        for column, i in enumerate(free):
            ahead = self.part(self.motions[i], answers[i], clock_offsets[i] + CLOCK_STEP)
            behind = self.part(self.motions[i], answers[i], clock_offsets[i] - CLOCK_STEP)
            columns[ends[i] - lengths[i] : ends[i], column] = (ahead - behind) / (2 * CLOCK_STEP)
        return columns


def fit(
    explanation: Explanation,
    motions: Sequence[PreparedMotion],
    start: Array,
    clock_offsets: Sequence[float],
    *,
    evaluations: int = 12,
) -> Fit:
    """Fits the free parameters by least squares from one initial vector.

    Args:
        explanation: what to fit.
        motions: the data.
        start: (P,) within the bounds.
        clock_offsets: of each motion [s]; kept where the clocks are one.
        evaluations: most evaluations of the residual.
    """
    return _Fitting(explanation, motions, np.array(clock_offsets, dtype=np.float64)).run(
        start, evaluations
    )


class _Fitting:
    def __init__(
        self, explanation: Explanation, motions: Sequence[PreparedMotion], offsets: Array
    ) -> None:
        self._evaluator = Evaluator(explanation, motions)
        self._offsets = offsets
        self._free_clocks = [i for i, m in enumerate(motions) if not m.motion.same_clock]
        self._count = len(explanation.free)
        self._last: tuple[bytes, list[Answer | None], Array] | None = None

    def run(self, start: Array, evaluations: int) -> Fit:
        explanation = self._evaluator.explanation
        free = self._offsets[self._free_clocks]
        vector = np.concatenate([start, free])
        if len(vector):
            lower, upper = explanation.bounds
            bounds = (
                np.concatenate([lower, free - TUNING.clock_span]),
                np.concatenate([upper, free + TUNING.clock_span]),
            )
            scale = np.concatenate([explanation.widths, np.full(len(free), 0.05)])
            solution = least_squares(
                self._residual_and_prior,
                np.clip(vector, bounds[0] + 1e-9 * scale, bounds[1] - 1e-9 * scale),
                jac=self._derivative_and_prior,
                bounds=bounds,
                x_scale=scale,
                ftol=TOLERANCE,
                xtol=TOLERANCE,
                gtol=1e-12,
                max_nfev=evaluations,
            )
            vector = solution.x
        residual, _ = self._evaluate(vector)
        offsets = self._all_offsets(vector)
        shared = vector[: self._count]
        jacobian = self._evaluator.derivative(shared, offsets, residual)
        return Fit(explanation, shared, tuple(offsets.tolist()), residual, jacobian)

    def _all_offsets(self, vector: Array) -> Array:
        offsets = self._offsets.copy()
        offsets[self._free_clocks] = vector[self._count :]
        return offsets

    def _evaluate(self, vector: Array) -> tuple[Array, list[Answer | None]]:
        key = vector.tobytes()
        if self._last is None or self._last[0] != key:
            answers = self._evaluator.answers(vector[: self._count])
            residual = self._evaluator.residual(answers, self._all_offsets(vector))
            self._last = (key, answers, residual)
        return self._last[2], self._last[1]

    def _residual_and_prior(self, vector: Array) -> Array:
        explanation = self._evaluator.explanation
        prior = (vector[: self._count] - explanation.centres) / explanation.spreads
        return np.concatenate([self._evaluate(vector)[0], prior])

    def _derivative_and_prior(self, vector: Array) -> Array:
        residual, answers = self._evaluate(vector)
        offsets = self._all_offsets(vector)
        shared = self._evaluator.derivative(vector[: self._count], offsets, residual)
        clocks = self._evaluator.clock_derivative(answers, offsets)
        prior = np.zeros((self._count, len(vector)))
        prior[:, : self._count] = np.diag(1.0 / self._evaluator.explanation.spreads)
        return np.vstack([np.hstack([shared, clocks]), prior])
