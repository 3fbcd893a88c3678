"""Formulates a test case as a regression of the residual acceleration on candidate terms."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pysindy as ps
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from validation.peers.library import TERMS, residual, terms
from validation.peers.oracle import Latent, noisy

Array = NDArray[np.float64]
Random = np.random.Generator

ORDER = 4
"""Of the polynomial that smooths, and of the differences that differentiate."""
DOMAINS = 120
"""Of the weak form, in each motion."""
LEAST = 1e-6
"""A term smaller than this everywhere, in the square mean, is not in the data [m/s²]."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A linear regression: scaled columns of terms and the target, for all motions.

    Attributes:
        columns: (N, K) candidates that the motions show, each of mean square 1 where sampled.
        target: (N,) residual [m/s²].
        scale: (K,) what a column was divided by.
        which: (K,) index of each column in TERMS.
    """

    columns: Array
    target: Array
    scale: Array
    which: NDArray[np.int64]

    def compressed(self) -> Problem:
        """Returns an equivalent least-squares problem with only K + 1 rows."""
        both = np.column_stack([self.columns, self.target]) / np.sqrt(len(self.target))
        triangle = np.asarray(np.linalg.qr(both, mode="r"))
        return Problem(triangle[:, :-1], triangle[:, -1], self.scale, self.which)

    def coefficients(self, weights: Array) -> Array:
        """Returns the terms' coefficients (TERMS,) in physical units from scaled weights."""
        full = np.zeros(len(TERMS))
        full[self.which] = weights / self.scale
        return full


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """Candidate terms and residual acceleration of one motion over time.

    Attributes:
        t: (T,) [s].
        v: (T, 2) velocities, smoothed.
        columns: (T, 2, TERMS).
        steady: (T, 2) the residual's part without q̈ itself, so that residual = q̈ + steady.
        acceleration: (T, 2) differentiated velocities.
    """

    t: Array
    v: Array
    columns: Array
    steady: Array
    acceleration: Array


def signals(exact: Latent, noise: float, window: float, random: Random) -> Signals:
    """Computes a motion's terms and residual from noisy states, smoothed over a window [s]."""
    q, v = noisy(exact, noise, random)
    t = exact.t
    samples = max(ORDER + 1, round(window / float(np.mean(np.diff(t))))) // 2 * 2 + 1
    smooth = {"window_length": samples, "polyorder": ORDER}
    slope = ps.SmoothedFiniteDifference(smoother_kws=smooth, order=ORDER, save_smooth=True)
    uniform = t[0] + np.linspace(0.0, t[-1] - t[0], len(t))
    acceleration = np.asarray(slope(v, uniform))
    v = np.asarray(slope.smoothed_x_)
    q = np.asarray(savgol_filter(q, samples, ORDER, axis=0))
    columns = terms(exact.drive, q, v, acceleration)
    steady = residual(exact.drive, q, v, acceleration) - acceleration
    return Signals(uniform, v, columns, steady, acceleration)


def strong(motions: Sequence[Signals]) -> Problem:
    """Formulates the regression pointwise, with one row per sample."""
    columns = [motion.columns.reshape(-1, len(TERMS)) for motion in motions]
    target = [(motion.acceleration + motion.steady).ravel() for motion in motions]
    return _problem(np.concatenate(columns), np.concatenate(target), _scales(motions))


def weak(motions: Sequence[Signals], half_width: float, seed: int) -> Problem:
    """Formulates the regression in weak form: integrals over test functions of a width [s].

    What multiplies q̈ in a term keeps the differentiated one.
    """
    rows, targets = [], []
    for motion in motions:
        grid = motion.t - motion.t[0]
        library = _weak_library(grid, half_width, seed)
        one = np.ones(len(grid))
        flat = np.column_stack([motion.columns.reshape(len(grid), -1), motion.steady, one])
        signal = ps.AxesArray(flat, _AXES)
        with warnings.catch_warnings(action="ignore"):
            library.fit([signal])
            whole = np.asarray(library.transform([signal])[0])
        slope = np.asarray(library.convert_u_dot_integral(ps.AxesArray(motion.v, _AXES)))
        size = whole[:, -1:]
        rows.append((whole[:, :-3] / size).reshape(-1, len(TERMS)))
        targets.append(((slope + whole[:, -3:-1]) / size).ravel())
    return _problem(np.concatenate(rows), np.concatenate(targets), _scales(motions))


def _weak_library(grid: Array, half_width: float, seed: int) -> ps.WeakPDELibrary:
    """Creates PySINDy's weak-form library over time, with reproducible random domains."""
    state = np.random.get_state()  # noqa: NPY002
    np.random.seed(seed)  # noqa: NPY002
    library = ps.WeakPDELibrary(
        function_library=ps.PolynomialLibrary(degree=1, include_bias=False),
        spatiotemporal_grid=grid,
        K=DOMAINS,
        H_xt=half_width,
    )
    np.random.set_state(state)  # noqa: NPY002
    return library


_AXES = {"ax_time": 0, "ax_coord": 1}


def _scales(motions: Sequence[Signals]) -> Array:
    squares = np.concatenate([motion.columns.reshape(-1, len(TERMS)) for motion in motions])
    return np.asarray(np.sqrt(np.mean(squares**2, axis=0)))


def _problem(columns: Array, target: Array, size: Array) -> Problem:
    which = np.flatnonzero(size > LEAST)
    return Problem(columns[:, which] / size[which], target, size[which], which)
