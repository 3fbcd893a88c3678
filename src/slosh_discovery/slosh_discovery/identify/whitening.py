"""Whitens the residuals of several trials, with the noise of the sensor and the inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.colour import Colour, Neighbours, Whitening
from slosh_discovery.discover.driven import with_input_noise
from slosh_discovery.discover.input_noise import estimate_input_noise
from slosh_discovery.discover.problem import SharedNoise
from slosh_discovery.identify.problem import Problem
from slosh_discovery.identify.trials import neighbours_of


@dataclass(frozen=True, slots=True, eq=False)
class Driven:
    """Effect of input noise on the heights of a motion that is being fitted.

    Attributes:
        rows: of the trial in the residual of all.
        columns: (n, R) L of the covariance L Lᵀ [m].
        blur: (n,) variance beside it, of each height alone [m²].
    """

    rows: slice
    columns: Array
    blur: Array


@dataclass(frozen=True, slots=True, eq=False)
class White:
    """Whitening of the concatenated residuals of several trials.

    Attributes:
        neighbours: of the samples.
        colour: of the sensor's noise.
        scale: (N,) by how much each height is noisier than the sensor makes it.
        shared: rows of a trial, and what its inputs' noise is where the sensor's is white.
    """

    neighbours: Neighbours
    colour: Colour
    scale: Array
    shared: tuple[tuple[slice, SharedNoise], ...]

    @classmethod
    def of(cls, problem: Problem, colour: Colour, driven: tuple[Driven, ...]) -> White:
        """Creates the whitening for the residuals of a problem."""
        neighbours = neighbours_of(problem.trials)
        shared, scale = [], np.ones(len(neighbours.before))
        for one in driven:
            scale[one.rows] = np.sqrt(1.0 + one.blur / colour.stddev**2)
        for one in driven:
            laid = np.zeros((len(neighbours.before), one.columns.shape[1]))
            laid[one.rows] = one.columns / scale[one.rows, np.newaxis]
            white = neighbours.whitened(laid, colour)[one.rows]
            shared.append((one.rows, SharedNoise.of(white)))
        return cls(neighbours, colour, scale, tuple(shared))

    def applied(self, values: Array) -> Array:
        """Whitens a series of heights [m], or each column of several, to unit variance."""
        scale = self.scale if values.ndim == 1 else self.scale[:, np.newaxis]
        white = self.neighbours.whitened(values / scale, self.colour)
        for rows, noise in self.shared:
            white[rows] = noise.removed(white[rows])
        return white

    def without_inputs(self, residual: Array) -> Array:
        """Subtracts from a residual (N,) [m] the part that the inputs' noise probably causes."""
        if not self.shared:
            return residual
        law = Whitening.of(self.neighbours, self.colour.stddev, self.colour.memory)
        white, expected = law.applied(residual / self.scale), np.zeros_like(residual)
        for rows, noise in self.shared:
            expected[rows] = noise.expected(white[rows])
        return np.asarray(residual - self.scale * law.undone(expected))


def driven_by(problem: Problem, vector: Array) -> tuple[Driven, ...]:
    """Computes the effect of the inputs' noise on the heights of each trial.

    Args:
        problem: the data and what is free.
        vector: (V,) that is likely.
    """
    model = problem.model_at(vector)
    ends = np.cumsum([0, *(trial.count for trial in problem.trials)]).tolist()
    found = []
    for index, trial in enumerate(problem.trials):
        noise = None if trial.free else estimate_input_noise(trial.prepared.motion.inputs)
        if noise is None or model is None:
            continue
        clock = problem.clocks[index]
        offset = float(vector[clock[0]]) if clock else 0.0
        one = with_input_noise(trial.prepared, noise, model, offset)
        if one.driven is not None:
            rows, kept = slice(ends[index], ends[index + 1]), one.driven[one.kept]
            if not trial.prepared.motion.level_known:  # residuals lose their mean, too
                kept = kept - kept.mean(axis=0)
            blur = np.zeros(len(kept)) if one.blur is None else one.blur[one.kept]
            found.append(Driven(rows, kept, blur))
    return tuple(found)
