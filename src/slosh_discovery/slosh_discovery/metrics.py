"""How well a model's heights agree with measured ones.

Every function ignores pairs in which a value is not finite (no measurement there) and returns NaN
where nothing is left to compare.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_discovery.errors import SloshDiscoveryError

Array = NDArray[np.float64]


def peak_error(measured: ArrayLike, model: ArrayLike) -> float:
    """Relative error of the maximum, ε (DL22, eq. (32)).

    Args:
        measured: (N,) measured heights [m].
        model: (N,) the model's heights at the same moments [m].

    Returns:
        (max model − max measured) / max measured as a fraction; NaN where the measured maximum is
        not positive.

    Raises:
        SloshDiscoveryError: the two differ in shape.
    """
    heights, answers = _pairs(measured, model)
    if not heights.size:
        return math.nan
    return _relative(float(heights.max()), float(answers.max()))


def mean_absolute_error(measured: ArrayLike, model: ArrayLike) -> float:
    """Mean of |measured − model|, σ (DL22, eq. (33)) [m]; arguments as in `peak_error`."""
    heights, answers = _pairs(measured, model)
    return float(np.mean(np.abs(heights - answers))) if heights.size else math.nan


def rms_error(measured: ArrayLike, model: ArrayLike) -> float:
    """Root of the mean of (measured − model)² [m]; arguments as in `peak_error`."""
    heights, answers = _pairs(measured, model)
    return float(np.sqrt(np.mean((heights - answers) ** 2))) if heights.size else math.nan


def standard_error_of_estimate(measured: ArrayLike, model: ArrayLike) -> float:
    """SEOE (TM20, §2.4): the root mean square deviation over all repetitions and samples.

    Args:
        measured: (K, J) K repetitions of J samples, of an angle [rad] or a height [m]; or (J,).
        model: (J,), the same for each repetition, or (K, J).

    Returns:
        the deviation in the unit of the arguments.

    Raises:
        SloshDiscoveryError: the shapes do not match.
    """
    repetitions = np.asarray(measured, dtype=np.float64)
    try:
        answers = np.broadcast_to(np.asarray(model, dtype=np.float64), repetitions.shape)
    except ValueError:
        raise SloshDiscoveryError(
            f"model has the shape {np.shape(model)}, which does not fit measured "
            f"{repetitions.shape}: give one value per sample"
        ) from None
    return rms_error(repetitions, answers)


class RunningAccuracy:
    """ε and σ of a stream of pairs: the streaming twin of the functions above."""

    __slots__ = ("_absolute", "_count", "_measured_peak", "_model_peak", "_square")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forgets all pairs."""
        self._count = 0
        self._absolute = self._square = 0.0
        self._measured_peak = self._model_peak = -math.inf

    def update(self, measured: float, model: float) -> bool:
        """Takes a pair of heights [m]; returns False where a value is not finite."""
        if not (math.isfinite(measured) and math.isfinite(model)):
            return False
        difference = measured - model
        self._count += 1
        self._absolute += abs(difference)
        self._square += difference * difference
        self._measured_peak = max(self._measured_peak, measured)
        self._model_peak = max(self._model_peak, model)
        return True

    @property
    def count(self) -> int:
        """Pairs taken."""
        return self._count

    @property
    def sigma(self) -> float:
        """Mean absolute error (DL22, eq. (33)) [m]."""
        return self._absolute / self._count if self._count else math.nan

    @property
    def rms(self) -> float:
        """Root mean square error [m]."""
        return math.sqrt(self._square / self._count) if self._count else math.nan

    @property
    def epsilon(self) -> float:
        """Relative error of the maximum as a fraction (DL22, eq. (32))."""
        return _relative(self._measured_peak, self._model_peak) if self._count else math.nan


def _relative(measured_peak: float, model_peak: float) -> float:
    return (model_peak - measured_peak) / measured_peak if measured_peak > 0.0 else math.nan


def _pairs(measured: ArrayLike, model: ArrayLike) -> tuple[Array, Array]:
    heights = np.asarray(measured, dtype=np.float64)
    answers = np.asarray(model, dtype=np.float64)
    if heights.shape != answers.shape:
        raise SloshDiscoveryError(
            f"measured has the shape {heights.shape} and model {answers.shape}: "
            "give one model value per measured value"
        )
    both = np.isfinite(heights) & np.isfinite(answers)
    return heights[both], answers[both]
