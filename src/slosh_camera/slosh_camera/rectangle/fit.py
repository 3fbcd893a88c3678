"""Fits the contact line in a side view by a level, a straight line and waves.

The straight line of TM20, eqs. (11) and (12), is the least-squares line over the whole width.
Over a rectangle's face a steady acceleration inclines a line, and linear theory adds the standing
waves cos(n pi (x + w/2) / w) [Ibrahim 2005; Faltinsen and Timokha 2009]. On a round wall all first
modes are a cos and a sine of the azimuth; their second order adds those of twice the azimuth
[Faltinsen and Timokha 2009, ch. 9]. Seen from the side the sine is a line and the cosine a bow
that stands on both ends, where the wall turns away.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from slosh_camera.optics.box import BoxView
from slosh_camera.optics.round_body import RoundView
from slosh_camera.rectangle.tuning import TUNING

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
        floor: least scatter that is assumed [m].
        bounds: places and heights above which the line is known to lie there [m].
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


MODES = 3
FUNCTIONS = 2 + MODES
BOW = 2
"""Number of the function that is a round wall's bow."""
_FLAT_PRIOR = np.array([np.inf, 0.5, 0.5, 0.15, 0.08])
_ROUND_PRIOR = np.array([np.inf, 0.5, 0.5, 1.0, 1.0])
_SECOND_ORDER, _AT_REST = 0.02, 1e-6


@dataclass(frozen=True, slots=True)
class Waves(ABC):
    """Basis functions of the contact line for one type of container.

    Attributes:
        width: that the line has at rest [m].
        is_round: whether they are those on a round wall.
    """

    width: float
    is_round: ClassVar[bool] = False

    @abstractmethod
    def basis(self, x: FloatArray) -> FloatArray:
        """Returns the basis functions (N, FUNCTIONS) at distances x (N,) from the middle [m]."""

    @property
    @abstractmethod
    def prior(self) -> FloatArray:
        """Expected amplitude (FUNCTIONS,) of each basis function [m], used as a prior."""


@dataclass(frozen=True, slots=True)
class FlatWaves(Waves):
    """Basis functions of the contact line on a rectangular container's face."""

    def basis(self, x: FloatArray) -> FloatArray:
        """Returns level, straight line and sloshing modes at positions x (N,) [m]."""
        phase = np.pi * (x / self.width + 0.5)
        functions = np.empty((x.size, FUNCTIONS))
        functions[:, 0] = 1.0
        functions[:, 1] = 2.0 * x / self.width
        functions[:, 2] = np.cos(phase)
        # cos 2p and cos 3p by cos p; a cosine costs as much as all else here.
        functions[:, 3] = 2.0 * functions[:, 2] ** 2 - 1.0
        functions[:, 4] = functions[:, 2] * (2.0 * functions[:, 3] - 1.0)
        return functions

    @property
    def prior(self) -> FloatArray:
        """Expected amplitude of each basis function [m], proportional to the width."""
        return _FLAT_PRIOR * self.width


@dataclass(frozen=True, slots=True)
class RoundWaves(Waves):
    """Basis functions of the contact line on a round wall.

    Attributes:
        bore: inner radius as a part of the outer one.
        second_order: expected size of the second order, as a part of the width.
    """

    is_round: ClassVar[bool] = True

    bore: float
    index: float
    second_order: float = _SECOND_ORDER

    def at_rest(self) -> RoundWaves:
        """Returns the basis without second-order waves, which occur only in moving liquid."""
        return replace(self, second_order=_AT_REST)

    def basis(self, x: FloatArray) -> FloatArray:
        """Returns constant and Fourier terms of the wall azimuth at positions x (N,) [m]."""
        sine, cosine = self._azimuth(x)
        columns = (np.ones(x.size), sine, cosine, 1.0 - 2.0 * sine**2, 2.0 * sine * cosine)
        return np.column_stack(columns)

    @property
    def prior(self) -> FloatArray:
        """Expected amplitude of each basis function [m], proportional to the width."""
        prior: FloatArray = _ROUND_PRIOR * self.width
        prior[3:] *= self.second_order
        return prior

    def _azimuth(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns sine and cosine of the wall azimuths that are seen at positions x.

        A ray that meets the outer wall so far from the axis keeps n times its distance in the
        wall (Bouguer); its azimuth changes by the difference of the angles at both sides.
        """
        side = np.clip(2.0 * x / self.width, -1.0, 1.0)
        inside = np.clip(side / (self.index * self.bore), -1.0, 1.0)
        azimuth = np.arcsin(side) - np.arcsin(side / self.index) + np.arcsin(inside)
        return np.sin(azimuth), np.cos(azimuth)


def waves_of(view: BoxView) -> Waves:
    """Returns the basis functions for the container in a side view."""
    if isinstance(view, RoundView):
        return RoundWaves(view.box.width, view.bore, view.box.wall_refractive_index)
    return FlatWaves(view.box.width)
