"""Fits the shape of the liquid's line over a rectangular container's width.

A steady acceleration inclines a plane; linear theory adds the standing waves
cos(n pi (x + w/2) / w) [Ibrahim 2005; Faltinsen and Timokha 2009]. A level, a straight line and
the first three waves are fitted. The straight line of TM20, eqs. (11) and (12), is the
least-squares line over the whole width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.rectangle.tuning import TUNING

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MODES = 3
_FUNCTIONS = 2 + MODES
# Expected size of line and modes, as parts of the width: it tells the line from the first mode
# where they are much alike, and matters where the line is hidden.
_PRIOR = np.array([np.inf, 0.5, 0.5, 0.15, 0.08])
_SAMPLES = 96
_POINTS = 6
_ITERATIONS = 6
_MAD = 1.4826
_GRID = 201


@dataclass(frozen=True, slots=True, eq=False)
class FittedLine:
    """The liquid's line fitted to a side view.

    Attributes:
        width: the container's [m].
        coefficients: (2 + MODES,) level, height of the straight line at the right wall and
            amplitudes of the modes at the left wall [m].
        covariance: (2 + MODES, 2 + MODES) of the coefficients for unit variance of a point.
        scatter: robust standard deviation of the points about the shape [m].
    """

    width: float
    coefficients: FloatArray
    covariance: FloatArray
    scatter: float

    def at(self, x: FloatArray) -> FloatArray:
        """Returns heights (N,) at positions x (N,) [m]."""
        heights: FloatArray = basis(x, self.width) @ self.coefficients
        return heights

    def highest(self) -> tuple[float, float, FloatArray]:
        """Returns position and height [m] of the maximum between the walls, and its basis."""
        x = np.linspace(-0.5 * self.width, 0.5 * self.width, _GRID)
        functions = basis(x, self.width)
        heights = functions @ self.coefficients
        peak = int(np.argmax(heights))
        return float(x[peak]), float(heights[peak]), functions[peak]


def basis(x: FloatArray, width: float) -> FloatArray:
    """Returns level, straight line and modes (N, 2 + MODES) at positions x (N,)."""
    phase = np.pi * (x / width + 0.5)
    functions = np.empty((x.size, _FUNCTIONS))
    functions[:, 0] = 1.0
    functions[:, 1] = 2.0 * x / width
    functions[:, 2] = np.cos(phase)
    # cos 2p and cos 3p by cos p; a cosine costs as much as all else here.
    functions[:, 3] = 2.0 * functions[:, 2] ** 2 - 1.0
    functions[:, 4] = functions[:, 2] * (2.0 * functions[:, 3] - 1.0)
    return functions


def first_shape(x: FloatArray, z: FloatArray, width: float, draws: FloatArray) -> FittedLine:
    """Finds the shape with most agreeing points, from small random samples.

    Args:
        x: (N,) places [m].
        z: (N,) heights [m].
        width: the container's [m].
        draws: (samples, points) numbers in [0, 1) that choose the samples' points.

    Returns:
        The shape; its scatter is that of the nearest half of the points.
    """
    functions = basis(x, width)
    chosen = (draws * x.size).astype(np.intp)
    few, heights = functions[chosen], z[chosen]
    normal = np.einsum("spi,spj->sij", few, few) + _ridge(width, 1e-3 * width)
    right = np.einsum("spi,sp->si", few, heights)
    coefficients = np.linalg.solve(normal, right[:, :, np.newaxis])[:, :, 0]
    residuals = np.abs(coefficients @ functions.T - z)
    cost = np.minimum(residuals, TUNING.truncation * width).sum(axis=1)
    best = int(np.argmin(cost))
    scatter = _MAD * float(np.median(residuals[best]))
    return FittedLine(width, coefficients[best], np.zeros((_FUNCTIONS, _FUNCTIONS)), scatter)


def sample_draws() -> FloatArray:
    """Returns the fixed random numbers that choose the samples of `first_shape`."""
    strata = np.arange(_POINTS) + np.random.default_rng(0).random((_SAMPLES, _POINTS))
    return strata / _POINTS


def refined_shape(
    x: FloatArray,
    z: FloatArray,
    start: FittedLine,
    floor: float,
    bounds: tuple[FloatArray, FloatArray],
) -> FittedLine:
    """Refines a first shape by robust least squares (Tukey's weights).

    Args:
        x: (N,) places [m].
        z: (N,) heights [m].
        start: first shape.
        floor: least scatter that is assumed [m].
        bounds: places and heights above which the line is known to lie there [m].

    Returns:
        The shape.
    """
    functions = np.vstack((basis(x, start.width), basis(bounds[0], start.width)))
    target = np.concatenate((z, bounds[1]))
    coefficients, scatter = start.coefficients, max(start.scatter, floor)
    covariance = start.covariance
    for _ in range(_ITERATIONS):
        residual = target - functions @ coefficients
        weight = np.maximum(1.0 - (residual / (TUNING.tukey * scatter)) ** 2, 0.0) ** 2
        # A bound pulls only where the shape lies below it.
        weight[x.size :] = residual[x.size :] > 0.0
        weighted = functions * weight[:, np.newaxis]
        covariance = np.linalg.inv(weighted.T @ functions + _ridge(start.width, scatter))
        coefficients = covariance @ (weighted.T @ target)
        own = np.abs(z - functions[: x.size] @ coefficients)
        scatter = max(_MAD * float(np.median(own)), floor)
    return FittedLine(start.width, coefficients, covariance, scatter)


def straight_line(x: FloatArray, z: FloatArray) -> tuple[float, float]:
    """Fits the line z = level + slope x to a curve by least squares over its length.

    Args:
        x: (N,) places in order [m].
        z: (N,) heights [m].

    Returns:
        Level [m] at x = 0 and slope [-].
    """
    weights = slope_weights(x)
    slope = float(weights @ z)
    part = trapezoid(x)
    return float(part @ (z - slope * x)), slope


def slope_weights(x: FloatArray) -> FloatArray:
    """Returns weights (N,) that turn heights at positions (N,) into the line's slope [1/m]."""
    part = trapezoid(x)
    away = x - part @ x
    weights: FloatArray = part * away / (part @ away**2)
    return weights


def trapezoid(x: FloatArray) -> FloatArray:
    """Returns the trapezoidal weights (N,) of positions (N,), with sum 1."""
    steps = np.diff(x)
    part = np.zeros(x.size)
    part[:-1] += 0.5 * steps
    part[1:] += 0.5 * steps
    return part / float(np.sum(part))


def _ridge(width: float, scatter: float) -> FloatArray:
    return np.diag((scatter / (_PRIOR * width)) ** 2 + 1e-12)
