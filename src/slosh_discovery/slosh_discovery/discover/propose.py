"""Proposes a generic equation term for an error that no listed effect removes.

Sparse regression, forwards: every term of a library is tried in the model's own equations of
motion, at some sizes and both signs; the best few are fitted together with those that are in
already, and the best of these stays. One term at a time, and only while it helps on motions that
it was not fitted to.

The regression is not on the terms' first-order responses: a force that acts for some periods
shifts the phase so far that the responses of all terms to a small force no longer resemble it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from slosh_base.types import Array
from slosh_discovery.discover.finding import Proposal
from slosh_discovery.discover.generic.response import MotionWithTerms
from slosh_discovery.discover.generic.terms import LIBRARY, Term
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.noise import is_white, removable
from slosh_discovery.discover.tuning import TUNING
from slosh_model.errors import SloshModelError
from slosh_model.model import Model

SIZES = (0.003, 0.01, 0.025, 0.06, 0.12, 0.25)
"""First tries of a term, in units of the spring's force."""
FOLDS = 4
"""Parts of a single motion that are left out in turn."""


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """Regression of missing equation terms over all motions.

    Attributes:
        settings: one for each motion.
        measured: (M, K) heights above the still level [m].
        kept: (M, K) where they are finite.
        units: size at which each term of the library is as large as the spring [SI]; 0: it never
            acts.
    """

    settings: tuple[MotionWithTerms, ...]
    measured: tuple[Array, ...]
    kept: tuple[NDArray[np.bool_], ...]
    units: Array

    def residuals(self, support: Sequence[int], coefficients: Sequence[float]) -> list[Array]:
        """Returns measured minus modelled heights [m] of the valid samples, by motion.

        Raises:
            SloshModelError: no solution.
        """
        terms = [LIBRARY[index] for index in support]
        found = []
        for setting, measured, kept in zip(self.settings, self.measured, self.kept, strict=True):
            residual = (measured - setting.heights(terms, coefficients))[kept]
            found.append(residual if setting.motion.level_known else residual - residual.mean())
        return found

    def part(self, fit: _Fit) -> _Problem:
        """Returns the problem for only the motions in which a fit leaves the largest residual."""
        order = np.argsort([-float(np.sum(each**2)) for each in fit.residuals], kind="stable")
        chosen = order[: TUNING.scanned].tolist()
        return replace(
            self,
            settings=tuple(self.settings[index] for index in chosen),
            measured=tuple(self.measured[index] for index in chosen),
            kept=tuple(self.kept[index] for index in chosen),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Fitted coefficients of selected equation terms, and the residuals.

    Attributes:
        support: indices into LIBRARY, in the order of their choice.
        coefficients: of these [SI].
        residuals: motion by motion [m].
        foreseen: sum of squares on motions left out of the fit [m²].
    """

    support: tuple[int, ...]
    coefficients: tuple[float, ...]
    residuals: list[Array]
    foreseen: float

    @property
    def terms(self) -> list[Term]:
        return [LIBRARY[index] for index in self.support]

    @property
    def cost(self) -> float:
        return _square(self.residuals)


def propose(
    motions: Sequence[MeasuredMotion],
    model: Model,
    *,
    clock_offsets: Sequence[float] | None = None,
    levels: Sequence[float] | None = None,
) -> Proposal | None:
    """Proposes the term that the equation of motion lacks; returns None if no term helps.

    Args:
        motions: measured motions.
        model: the best model that listed effects make.
        clock_offsets: measured minus inputs' clock of each motion [s]; None: 0.
        levels: height at rest of each motion [m]; None: 0.

    Returns:
        the proposal; None: nothing is left to explain, or no term of the library helps.

    Raises:
        SloshModelError: the model itself has no solution.
    """
    problem = _problem_of(motions, model, clock_offsets, levels)
    residuals = problem.residuals((), ())
    best = base = _Fit((), (), residuals, _square(residuals))
    gap = _gap(problem, base)
    while len(best.support) < TUNING.most_terms and not _white(problem, best):
        further = _extended(problem, best)
        if further is None or best.foreseen - further.foreseen < TUNING.least_gain * gap:
            break
        best = further
    if not best.support:
        return None
    explained = 1.0 - _gap(problem, best) / gap if gap > 0.0 else 0.0
    return _proposal(best, min(max(explained, 0.0), 1.0))


def _problem_of(
    motions: Sequence[MeasuredMotion],
    model: Model,
    clock_offsets: Sequence[float] | None,
    levels: Sequence[float] | None,
) -> _Problem:
    motions = [_thinned(motion) for motion in motions]
    offsets = [0.0] * len(motions) if clock_offsets is None else clock_offsets
    zeros = [0.0] * len(motions) if levels is None else levels
    settings = tuple(
        MotionWithTerms.of(model, motion, offset)
        for motion, offset in zip(motions, offsets, strict=True)
    )
    measured = tuple(motion.heights - level for motion, level in zip(motions, zeros, strict=True))
    pairs = [setting.sizes(LIBRARY) for setting in settings]
    squares = np.sum([terms for terms, _ in pairs], axis=0)
    spring = sum(spring for _, spring in pairs)
    units = np.sqrt(spring / np.where(squares > 0.0, squares, np.inf))
    return _Problem(settings, measured, tuple(np.isfinite(each) for each in measured), units)


def _thinned(motion: MeasuredMotion) -> MeasuredMotion:
    """Keeps at most COLUMNS azimuths of a motion's heights, since neighbours are redundant."""
    if (
        motion.eta is None
        or motion.eta_azimuth is None
        or motion.eta.shape[1] <= TUNING.proposal_columns
    ):
        return motion
    chosen = np.linspace(0, motion.eta.shape[1], TUNING.proposal_columns, endpoint=False).astype(
        int
    )
    return replace(motion, eta_azimuth=motion.eta_azimuth[chosen], eta=motion.eta[:, chosen])


def _extended(problem: _Problem, start: _Fit) -> _Fit | None:
    """Returns the best fit with one more term, or None if no term improves the fit."""
    scanned = problem.part(start)
    tries: list[tuple[float, int, float]] = []
    for index in range(len(LIBRARY)):
        if index in start.support or problem.units[index] == 0.0:
            continue
        tried = _try(scanned, start, index)
        if tried is not None:
            cost, coefficient = tried
            tries.append((cost, index, coefficient))
    tries.sort()
    fits = [
        _fitted(problem, (*start.support, index), (*start.coefficients, coefficient))
        for _, index, coefficient in tries[: TUNING.fitted]
    ]
    found = [fit for fit in fits if fit is not None and fit.cost < start.cost]
    return min(found, key=lambda fit: fit.cost, default=None)


def _try(problem: _Problem, start: _Fit, index: int) -> tuple[float, float] | None:
    """Returns an equation term's best sum of squares and initial coefficient, or None."""
    tried = []
    for size in (*SIZES, *(-size for size in SIZES)):
        coefficient = size * float(problem.units[index])
        try:
            residuals = problem.residuals(
                (*start.support, index), (*start.coefficients, coefficient)
            )
        except SloshModelError:
            continue
        tried.append((_square(residuals), coefficient))
    return min(tried, default=None)


def _fitted(
    problem: _Problem, support: tuple[int, ...], coefficients: tuple[float, ...]
) -> _Fit | None:
    """Fits all coefficients together, or returns None if the initial ones have no solution."""
    scale = np.abs(np.array(coefficients))
    last: list[Array] = []

    def residual(relative: Array) -> Array:
        try:
            return np.concatenate(problem.residuals(support, (scale * relative).tolist()))
        except SloshModelError:
            return np.concatenate([1e3 * part for part in last])

    try:
        last = problem.residuals(support, coefficients)
    except SloshModelError:
        return None
    step = np.full(len(coefficients), 1e-3)
    solution = optimize.least_squares(
        residual, np.sign(coefficients), diff_step=step, xtol=1e-4, ftol=1e-5, max_nfev=15
    )
    lengths = np.cumsum([len(each) for each in last])[:-1]
    residuals = np.split(solution.fun, lengths)
    slopes = np.split(np.asarray(solution.jac), lengths)
    fitted = tuple((scale * solution.x).tolist())
    return _Fit(support, fitted, residuals, _foreseen(residuals, slopes))


def _foreseen(residuals: Sequence[Array], slopes: Sequence[Array]) -> float:
    """Returns the sum of squared residuals that linearised cross-validation predicts."""
    if len(residuals) == 1:
        residuals = np.array_split(residuals[0], FOLDS)
        slopes = np.array_split(slopes[0], FOLDS)
    total = 0.0
    for out, (residual, slope) in enumerate(zip(residuals, slopes, strict=True)):
        others = [part for index, part in enumerate(residuals) if index != out]
        theirs = [part for index, part in enumerate(slopes) if index != out]
        step = np.linalg.lstsq(np.concatenate(theirs), -np.concatenate(others), rcond=None)[0]
        total += float(np.sum((residual + slope @ step) ** 2))
    return total


def _square(residuals: Sequence[Array]) -> float:
    return float(sum(np.sum(each**2) for each in residuals))


def _full(problem: _Problem, fit: _Fit) -> list[tuple[Array, Array]]:
    """Returns times and residuals (times, azimuths) of each motion, NaN if not measured."""
    found = []
    for setting, kept, residual in zip(problem.settings, problem.kept, fit.residuals, strict=True):
        full = np.full(kept.shape, math.nan)
        full[kept] = residual
        found.append((setting.motion.t, full))
    return found


def _white(problem: _Problem, fit: _Fit) -> bool:
    return all(is_white(t, residual) for t, residual in _full(problem, fit))


def _gap(problem: _Problem, fit: _Fit) -> float:
    """Returns the sum of squared residuals that a better model could remove [m²]."""
    return sum(
        removable(t, residual).mean_square * int(np.isfinite(residual).sum())
        for t, residual in _full(problem, fit)
    )


def _proposal(fit: _Fit, explained: float) -> Proposal:
    terms = tuple(
        (term.label, value, term.unit)
        for term, value in zip(fit.terms, fit.coefficients, strict=True)
    )
    added = " ".join(
        f"{'−' if value < 0.0 else '+'} {abs(value):.3g} {_factor(unit)}{label}"
        for label, value, unit in terms
    )
    return Proposal(terms, f"q̈ + 2ζω q̇ + ω² q + … = −a {added}", explained)


def _factor(unit: str) -> str:
    return "" if unit == "1" else f"{unit} · "
