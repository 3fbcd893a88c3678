"""Runs PySINDy's methods: thresholded least squares, ensemble, SINDy-PI and weak form."""

from __future__ import annotations

import contextlib
import io
import itertools
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar, cast

import numpy as np
import pysindy as ps
from numpy.typing import NDArray
from pysindy.optimizers import SINDyPI

from validation.peers.library import TERMS
from validation.peers.oracle import Latent
from validation.peers.regression import Problem, Signals, signals, strong, weak

Array = NDArray[np.float64]
Settings = Mapping[str, float]
T = TypeVar("T")

MODELS = 20
"""Of an ensemble."""
RIDGE = 1e-6
NARROW = 0.05
"""Smoothing before the weak form [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """The coefficients of the equation terms that a method finds for a test case.

    Attributes:
        coefficients: (TERMS,) 0 where a term is not in the support.
        inclusion: by term of the support: share of the ensemble that has it; empty: no ensemble.
    """

    coefficients: Array
    inclusion: Mapping[str, float] = field(default_factory=dict)

    @property
    def support(self) -> tuple[str, ...]:
        """Names of the terms with non-zero coefficients."""
        return tuple(np.array(TERMS)[self.coefficients != 0.0].tolist())


class Data:
    """A test case with a given noise, as regression problems that are computed once."""

    def __init__(self, motions: Sequence[Latent], noise: float, seed: int) -> None:
        self._motions, self._noise, self._seed = motions, noise, seed
        self._made: dict[tuple[str, ...], Any] = {}

    def strong(self, window: float) -> Problem:
        """Returns the pointwise regression problem, compressed to few rows."""
        return self.once(
            lambda: strong(self._signals(window)).compressed(), "strong", window=window
        )

    def weak(self, half_width: float) -> Problem:
        """Returns the regression problem in weak form, with all rows."""
        return self.once(
            lambda: weak(self._signals(NARROW), half_width, self._seed), "weak", width=half_width
        )

    def once(self, make: Callable[[], T], what: str, **settings: float) -> T:
        """Returns a value for given settings; computes it only the first time."""
        key = (what, *map(str, settings.items()))
        if key not in self._made:
            self._made[key] = make()
        return cast(T, self._made[key])

    def _signals(self, window: float) -> list[Signals]:
        random = np.random.default_rng(self._seed)
        return [signals(motion, self._noise, window, random) for motion in self._motions]


def stlsq(data: Data, settings: Settings) -> Answer:
    """Fits the terms by sequentially thresholded least squares, pointwise."""
    return _thresholded(data.strong(settings["window"]), settings)


def weak_form(data: Data, settings: Settings) -> Answer:
    """Fits the terms by sequentially thresholded least squares in weak form."""
    return _thresholded(data.weak(settings["half_width"]).compressed(), settings)


def ensemble(data: Data, settings: Settings) -> Answer:
    """Fits an ensemble of weak-form models; keeps the terms that enough of them have."""
    width, threshold = settings["half_width"], settings["threshold"]
    problem = data.weak(width)
    share = data.once(
        lambda: _shares(problem, threshold), "shares", width=width, threshold=threshold
    )
    kept = share >= settings["inclusion"]
    said = {TERMS[problem.which[k]]: float(share[k]) for k in np.flatnonzero(kept)}
    return Answer(_refitted(problem, kept).coefficients, said)


def _shares(problem: Problem, threshold: float) -> Array:
    """Returns the share (K,) of the ensemble's models that have each term."""
    state = np.random.get_state()  # noqa: NPY002
    np.random.seed(0)  # noqa: NPY002 - PySINDy draws its bags by the global generator
    single = ps.STLSQ(threshold, RIDGE * len(problem.target))
    optimizer = ps.EnsembleOptimizer(single, bagging=True, n_models=MODELS)
    with warnings.catch_warnings(action="ignore"):
        optimizer.fit(problem.columns, problem.target[:, np.newaxis])
    np.random.set_state(state)  # noqa: NPY002
    return np.asarray(np.mean(np.array(optimizer.coef_list).reshape(MODELS, -1) != 0.0, axis=0))


def sindy_pi(data: Data, settings: Settings) -> Answer:
    """Fits the terms by SINDy-PI's sparse regression, without small weights.

    Terms with q̈ are in the library, as in every method; the left side is the residual.
    """
    window, weight = settings["window"], settings["weight"]
    problem = data.strong(window)
    weights = data.once(lambda: _lasso(problem, weight), "lasso", window=window, weight=weight)
    return _refitted(problem, np.abs(weights) > settings["threshold"])


def _lasso(problem: Problem, weight: float) -> Array:
    """Returns the weights (K,) of the terms by SINDy-PI, with the residual as left side."""
    both = np.column_stack([problem.columns, problem.target])
    left = both.shape[1] - 1
    optimizer = SINDyPI(reg_weight_lam=weight, tol=1e-8, model_subset=[left])
    with warnings.catch_warnings(action="ignore"), contextlib.redirect_stdout(io.StringIO()):
        optimizer.fit(both, both)
    return np.asarray(optimizer.coef_)[left, :left]


def _thresholded(problem: Problem, settings: Settings) -> Answer:
    optimizer = ps.STLSQ(threshold=settings["threshold"], alpha=RIDGE)
    with warnings.catch_warnings(action="ignore"):
        optimizer.fit(problem.columns, problem.target[:, np.newaxis])
    return Answer(problem.coefficients(np.ravel(optimizer.coef_)))


def _refitted(problem: Problem, kept: NDArray[np.bool_]) -> Answer:
    """Fits the selected terms again by plain least squares."""
    weights = np.zeros(len(kept))
    if kept.any():
        weights[kept] = np.linalg.lstsq(problem.columns[:, kept], problem.target, rcond=None)[0]
    return Answer(problem.coefficients(weights))


METHODS: Mapping[str, Callable[[Data, Settings], Answer]] = {
    "STLSQ": stlsq,
    "SINDy-PI": sindy_pi,
    "weak form": weak_form,
    "ensemble": ensemble,
}

THRESHOLDS = (0.003, 0.005, 0.01, 0.02, 0.04, 0.08, 0.16)
"""Of a term's part in the residual, root mean square [m/s²]."""
WINDOWS = (0.02, 0.05, 0.1)
HALF_WIDTHS = (0.12, 0.25)
RANGES: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "STLSQ": {"window": WINDOWS, "threshold": THRESHOLDS},
    "SINDy-PI": {"window": WINDOWS, "threshold": THRESHOLDS, "weight": (1e-5, 1e-4, 1e-3, 1e-2)},
    "weak form": {"half_width": HALF_WIDTHS, "threshold": THRESHOLDS},
    "ensemble": {
        "half_width": HALF_WIDTHS,
        "threshold": THRESHOLDS,
        "inclusion": (0.5, 0.7, 0.9, 1.0),
    },
}


def grid(method: str) -> list[dict[str, float]]:
    """Returns every combination of a method's settings."""
    names = list(RANGES[method])
    return [
        dict(zip(names, values, strict=True))
        for values in itertools.product(*RANGES[method].values())
    ]
