"""Robust least squares with autocorrelated noise, and the covariance of the result.

The residual is freed of its colour, and what still stands out counts by its size, not by its
square (Huber). Colour and fit are found in turns. The covariance is the sandwich A⁻¹BA⁻¹ of an
M-estimator: A from the slopes of Huber's function, B from the scores of whole images, also of
neighbouring ones. So what the colour leaves counts, and what the heights of one image share.

The solver is the trust-region reflective form of Levenberg-Marquardt: it keeps to bounds, as a
damping ratio must, and takes a loss, and away from the bounds it ends where MINPACK's does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import special
from scipy.optimize import least_squares

from slosh_base.types import Array
from slosh_discovery.discover.colour import Colour, Neighbours, Whitening, estimate_colour
from slosh_discovery.discover.driven import with_input_noise
from slosh_discovery.discover.input_noise import estimate_input_noise
from slosh_discovery.discover.problem import SharedNoise
from slosh_discovery.identify.problem import Problem
from slosh_discovery.identify.trials import neighbours_of
from slosh_discovery.identify.tuning import TUNING

TOLERANCE = 1e-9
EVALUATIONS = 60
SINGULAR = 1e-12
"""Relative size of eigenvalues of the information that are none."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedVector:
    """Fitted values of all unknowns, with their covariance.

    Attributes:
        problem: what was fitted.
        vector: (V,) parameters, then nuisances.
        covariance: (V, V) of the vector.
        noise: that of sensor and inputs.
        residual: (N,) measured minus predicted [m].
        jacobian: (N, V) of the residual.
        outliers: share of the samples that stand out.
        scatter: by how much the standard errors were raised, as motions differ by more than their
            noise explains; 1: they do not.
        degrees: of freedom for confidence intervals.
    """

    problem: Problem
    vector: Array
    covariance: Array
    noise: White
    residual: Array
    jacobian: Array
    outliers: float
    scatter: float
    degrees: float

    @property
    def colour(self) -> Colour:
        """Standard deviation and autocorrelation of the sensor's noise."""
        return self.noise.colour

    @property
    def values(self) -> Array:
        """Fitted values (P,) of the parameters."""
        return self.vector[: len(self.problem.parameters)]

    @property
    def shared(self) -> Array:
        """Covariance (P, P) of the parameters."""
        count = len(self.problem.parameters)
        return self.covariance[:count, :count]

    @property
    def standard_errors(self) -> Array:
        """Standard errors (P,) of the parameters."""
        errors: Array = np.sqrt(np.diag(self.shared))
        return errors

    @property
    def correlations(self) -> Array:
        """Correlations (P, P) of the parameters."""
        errors = self.standard_errors
        scale = np.where(errors > 0.0, errors, 1.0)
        correlations: Array = self.shared / np.outer(scale, scale)
        return correlations

    def interval(self, confidence: float = 0.95) -> tuple[Array, Array]:
        """Returns lower and upper ends (P,) of the parameters' confidence intervals."""
        reach = self.quantile(confidence) * self.standard_errors
        return self.values - reach, self.values + reach

    def quantile(self, confidence: float = 0.95) -> float:
        """Returns the half width of a confidence interval in standard errors."""
        return float(special.stdtrit(self.degrees, 0.5 + 0.5 * confidence))

    def band(self) -> Array:
        """Standard error (N,) of the predicted heights [m]."""
        variances = np.einsum("ij,jk,ik->i", self.jacobian, self.covariance, self.jacobian)
        band: Array = np.sqrt(np.maximum(variances, 0.0))
        return band


def fit(problem: Problem, start: Array) -> FittedVector:
    """Fits parameters, clock offsets and initial states to measured heights by least squares.

    Args:
        problem: the data and what is free.
        start: (V,) where to begin.
    """
    vector = start
    residual = problem.residuals([vector])[:, 0]
    neighbours = neighbours_of(problem.trials)
    white = White.of(
        problem,
        Colour(estimate_colour(residual, neighbours, 0).stddev, 0.0),
        driven_by(problem, start),
    )
    bounds = problem.bounds(start)
    for turn in range(TUNING.turns):
        if turn:
            white = _whitening(problem, white, vector, residual)
        if problem.size:
            vector = _solve(problem, white, vector, bounds)
        residual = problem.residuals([vector])[:, 0]
    return _estimate(problem, _whitening(problem, white, vector, residual), vector, residual)


def _whitening(problem: Problem, before: White, vector: Array, residual: Array) -> White:
    """Creates the whitening from a residual without the part that input noise causes."""
    left = before.without_inputs(residual)
    colour = estimate_colour(left, before.neighbours, problem.size)
    return White.of(problem, colour, driven_by(problem, vector) if before.shared else ())


def information(problem: Problem, vector: Array, colour: Colour) -> Array:
    """Returns the Fisher information (P, P) on the parameters if nuisance parameters are free."""
    white = White.of(problem, colour, driven_by(problem, vector))
    derivative = white.applied(problem.derivative(vector))
    return shared_information(derivative.T @ derivative, len(problem.parameters))


def shared_information(full: Array, count: int) -> Array:
    """Eliminates nuisance parameters from an information matrix; returns (P, P) without them."""
    own = full[count:, count:]
    mixed = full[:count, count:]
    shared: Array = full[:count, :count] - mixed @ np.linalg.pinv(own, SINGULAR, True) @ mixed.T
    return shared


def _solve(
    problem: Problem,
    white: White,
    vector: Array,
    bounds: tuple[Array, Array],
) -> Array:
    lower, upper = bounds
    inside = 1e-9 * (upper - lower)

    def missed(vector: Array) -> Array:
        return white.applied(problem.residuals([vector])[:, 0])

    def derivative(vector: Array) -> Array:
        return white.applied(problem.derivative(vector))

    solution = least_squares(
        missed,
        np.clip(vector, lower + inside, upper - inside),
        jac=derivative,
        bounds=bounds,
        method="trf",
        loss="huber",
        f_scale=TUNING.huber,
        x_scale=problem.widths,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=None,
        max_nfev=EVALUATIONS,
    )
    found: Array = solution.x
    return found


def _estimate(problem: Problem, noise: White, vector: Array, residual: Array) -> FittedVector:
    white, neighbours, colour = noise.applied(residual), noise.neighbours, noise.colour
    jacobian = problem.derivative(vector)
    scaled = noise.applied(jacobian) * problem.widths
    inside = np.abs(white) < TUNING.huber
    slopes = scaled.T @ (scaled * inside[:, np.newaxis])
    scores = _frame_scores(
        scaled * np.clip(white, -TUNING.huber, TUNING.huber)[:, np.newaxis], neighbours
    )
    frames = len(scores)
    degrees = max(frames - problem.size, 1)
    inverse: Array = np.linalg.pinv(slopes, SINGULAR, True).astype(np.float64)
    covariance = np.asarray(
        inverse @ _spread(scores, _lags(colour, frames)) @ inverse, np.float64
    ) * (frames / degrees)
    scatter = _scatter(problem, scores, inverse, covariance)
    widths = problem.widths
    return FittedVector(
        problem=problem,
        vector=vector,
        covariance=scatter**2 * covariance * np.outer(widths, widths),
        noise=noise,
        residual=residual,
        jacobian=jacobian,
        outliers=float(np.mean(~inside)) if len(inside) else 0.0,
        scatter=scatter,
        degrees=float(degrees),
    )


def _frame_scores(scores: Array, neighbours: Neighbours) -> Array:
    """Returns, for each image, the sum of the score vectors of its heights."""
    summed = np.zeros((int(neighbours.frames[-1]) + 1, scores.shape[1]))
    np.add.at(summed, neighbours.frames, scores)
    return summed


def _lags(colour: Colour, frames: int) -> int:
    """Returns the number of lags up to which neighbouring images enter the covariance."""
    if colour.memory == colour.correlation:
        return TUNING.lags
    remembered = TUNING.memories / (1.0 - abs(colour.correlation))
    return max(TUNING.lags, min(round(remembered), round(TUNING.most_lags * frames)))


def _spread(scores: Array, lags: int) -> Array:
    """Returns the covariance of summed, autocorrelated scores, with Bartlett weights."""
    spread = scores.T @ scores
    for lag in range(1, min(lags, len(scores) - 1) + 1):
        together = scores[lag:].T @ scores[:-lag]
        spread += (1.0 - lag / (lags + 1.0)) * (together + together.T)
    # Weighted so, it has no negative variance but by rounding.
    values, vectors = np.linalg.eigh(spread)
    even: Array = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return even


def _scatter(problem: Problem, scores: Array, inverse: Array, covariance: Array) -> float:
    """Returns the parameters' scatter between motions divided by the expected one; at least 1.

    Each motion's score says where it would draw the parameters; their scatter is compared with
    the covariance, the parameters taken together.
    """
    count, motions = len(problem.parameters), len(problem.trials)
    if motions < TUNING.least_motions or not count:
        return 1.0
    ends = np.cumsum([len(trial.prepared.t) for trial in problem.trials])[:-1]
    own = np.array([part.sum(axis=0) for part in np.split(scores, ends)])
    drawn = (own @ inverse)[:, :count]
    expected = np.linalg.pinv(covariance[:count, :count], SINGULAR, True)
    square = float(np.einsum("mi,ij,mj->", drawn, expected, drawn)) / count
    degrees = count * (motions - 1)
    ratio = square * motions / (motions - 1)
    if ratio * degrees < special.chdtri(degrees, 1.0 - TUNING.differ):
        return 1.0
    return math.sqrt(ratio)


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
