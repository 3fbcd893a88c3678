"""Fits the contact line in a side view by a level, a straight line and waves.

The straight line of TM20, eqs. (11) and (12), is the least-squares line over the whole width.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.rectangle.tuning import TUNING
from slosh_camera.rectangle.waves import FUNCTIONS, Waves

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_SAMPLES = 96
_POINTS = 6
_ITERATIONS = 6
_MAD = 1.4826
_GRID = 201


@dataclass(frozen=True, slots=True, eq=False)
class FittedLine:
    """Fitted shape of the contact line in a side view.

    Attributes:
        waves: the shapes.
        coefficients: (FUNCTIONS,) of them [m].
        covariance: (FUNCTIONS, FUNCTIONS) of the coefficients for unit variance of a point.
        scatter: robust standard deviation of the points about the shape [m].
    """

    waves: Waves
    coefficients: FloatArray
    covariance: FloatArray
    scatter: float

    @property
    def width(self) -> float:
        """Inner width of the container [m]."""
        return self.waves.width

    def at(self, x: FloatArray) -> FloatArray:
        """Returns heights (N,) of the fitted line at positions x (N,) [m]."""
        heights: FloatArray = self.waves.basis(x) @ self.coefficients
        return heights

    def highest(self) -> tuple[float, float, FloatArray]:
        """Returns x and height [m] of the fitted line's maximum, and the basis functions there."""
        x = np.linspace(-0.5 * self.width, 0.5 * self.width, _GRID)
        functions = self.waves.basis(x)
        heights = functions @ self.coefficients
        peak = int(np.argmax(heights))
        return float(x[peak]), float(heights[peak]), functions[peak]


def first_shape(x: FloatArray, z: FloatArray, waves: Waves, draws: FloatArray) -> FittedLine:
    """Returns the contact-line shape that agrees with most points, by random sampling.

    Args:
        x: (N,) places [m].
        z: (N,) heights [m].
        waves: the shapes.
        draws: (samples, points) numbers in [0, 1) that choose the samples' points.

    Returns:
        The shape; its scatter is that of the nearest half of the points.
    """
    functions, width = waves.basis(x), waves.width
    chosen = (draws * x.size).astype(np.intp)
    few, heights = functions[chosen], z[chosen]
    normal = np.einsum("spi,spj->sij", few, few) + _ridge(waves, 1e-3 * width)
    right = np.einsum("spi,sp->si", few, heights)
    coefficients = np.linalg.solve(normal, right[:, :, np.newaxis])[:, :, 0]
    residuals = np.abs(coefficients @ functions.T - z)
    cost = np.minimum(residuals, TUNING.truncation * width).sum(axis=1)
    best = int(np.argmin(cost))
    scatter = _MAD * float(np.median(residuals[best]))
    return FittedLine(waves, coefficients[best], np.zeros((FUNCTIONS, FUNCTIONS)), scatter)


def sample_draws() -> FloatArray:
    """Returns fixed random numbers that select the samples of `first_shape`."""
    strata = np.arange(_POINTS) + np.random.default_rng(0).random((_SAMPLES, _POINTS))
    return strata / _POINTS


def refined_shape(
    x: FloatArray,
    z: FloatArray,
    start: FittedLine,
    floor: float,
    bounds: tuple[FloatArray, FloatArray],
) -> FittedLine:
    """Refines a contact-line shape by robust least squares with Tukey's weights.

    Args:
        x: (N,) places [m].
        z: (N,) heights [m].
        start: first shape.
        floor: least scatter that is assumed [m].
        bounds: places and heights above which the line is known to lie there [m].

    Returns:
        The shape.
    """
    functions = np.vstack((start.waves.basis(x), start.waves.basis(bounds[0])))
    target = np.concatenate((z, bounds[1]))
    coefficients, scatter = start.coefficients, max(start.scatter, floor)
    covariance = start.covariance
    for _ in range(_ITERATIONS):
        residual = target - functions @ coefficients
        weight = np.maximum(1.0 - (residual / (TUNING.tukey * scatter)) ** 2, 0.0) ** 2
        # A bound pulls only where the shape lies below it.
        weight[x.size :] = residual[x.size :] > 0.0
        weighted = functions * weight[:, np.newaxis]
        covariance = np.linalg.inv(weighted.T @ functions + _ridge(start.waves, scatter))
        coefficients = covariance @ (weighted.T @ target)
        own = np.abs(z - functions[: x.size] @ coefficients)
        scatter = max(_MAD * float(np.median(own)), floor)
    return FittedLine(start.waves, coefficients, covariance, scatter)


def straight_line(x: FloatArray, z: FloatArray) -> tuple[float, float]:
    """Fits the straight line z = level + slope x to a curve by least squares.

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
    """Returns weights (N,) that give the line's slope [1/m] from heights at positions (N,)."""
    part = trapezoid(x)
    away = x - part @ x
    weights: FloatArray = part * away / (part @ away**2)
    return weights


def trapezoid(x: FloatArray) -> FloatArray:
    """Returns trapezoidal integration weights (N,) of positions (N,), with sum 1."""
    steps = np.diff(x)
    part = np.zeros(x.size)
    part[:-1] += 0.5 * steps
    part[1:] += 0.5 * steps
    return part / float(np.sum(part))


def _ridge(waves: Waves, scatter: float) -> FloatArray:
    return np.diag((scatter / waves.prior) ** 2 + 1e-12)
