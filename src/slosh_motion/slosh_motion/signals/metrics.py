"""Metrics of how well modelled heights agree with measured ones.

The indices of DL22 and TM20. Every function takes two series of the same length, in the same unit,
and leaves out the moments at which one of them is not finite.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_motion.errors import SloshMotionError

NAN = float("nan")


def peak_error(measured: ArrayLike, model: ArrayLike) -> float:
    """Returns ε, the model's relative error of the maximum; positive if too high (DL22, eq. (32)).

    >>> round(peak_error(measured=[0.0, 0.010, 0.004], model=[0.0, 0.011, 0.005]), 3)
    0.1

    Raises:
        SloshMotionError: the series do not match or share no finite moment.
    """
    return _accuracy(measured, model).epsilon


def mean_absolute_error(measured: ArrayLike, model: ArrayLike) -> float:
    """Returns the mean absolute error (DL22, eq. (33)) in the unit of the series.

    >>> round(mean_absolute_error(measured=[0.0, 0.010, 0.004], model=[0.0, 0.011, 0.006]), 6)
    0.001

    Raises:
        SloshMotionError: the series do not match or share no finite moment.
    """
    return _accuracy(measured, model).sigma


def rms_error(measured: ArrayLike, model: ArrayLike) -> float:
    """Returns the root-mean-square difference of two series, in their unit.

    >>> round(rms_error(measured=[0.003, 0.010], model=[0.003, 0.012]), 6)
    0.001414

    Raises:
        SloshMotionError: the series do not match or share no finite moment.
    """
    return _accuracy(measured, model).rms


def relative_peak_error(measured_peak: float, model_peak: float) -> float:
    """Returns (model - measured) / measured, or NaN if the measured peak is not positive.

    >>> round(relative_peak_error(measured_peak=0.010, model_peak=0.011), 3)
    0.1
    """
    if not measured_peak > 0.0:
        return NAN
    return (model_peak - measured_peak) / measured_peak


class RunningAccuracy:
    """ε, mean absolute error and rms error of a stream of height pairs.

    >>> accuracy = RunningAccuracy()
    >>> accuracy.update(0.010, 0.011)
    >>> accuracy.count, round(accuracy.sigma, 6)
    (1, 0.001)

    Attributes:
        count: pairs that were taken.
    """

    __slots__ = ("_absolute_sum", "_measured_peak", "_model_peak", "_squared_sum", "count")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Resets the error statistics to the state before the first pair of heights."""
        self.count = 0
        self._absolute_sum = self._squared_sum = 0.0
        self._measured_peak = -math.inf
        self._model_peak = -math.inf

    def update(self, measured: float, model: float) -> None:
        """Adds one pair of heights; ignores a pair that is not finite."""
        if not (math.isfinite(measured) and math.isfinite(model)):
            return
        difference = abs(measured - model)
        self._take(1, difference, difference * difference, measured, model)

    def update_many(self, measured: NDArray[np.float64], model: NDArray[np.float64]) -> None:
        """Adds N pairs of heights; ignores pairs that are not finite."""
        both = np.isfinite(measured) & np.isfinite(model)
        if not both.any():
            return
        reference, estimate = measured[both], model[both]
        difference = reference - estimate
        with np.errstate(over="ignore"):  # a forged height: its square is infinite
            squared = float((difference**2).sum())
        self._take(
            len(difference),
            float(np.abs(difference).sum()),
            squared,
            float(reference.max()),
            float(estimate.max()),
        )

    def _take(
        self, count: int, absolute: float, squared: float, measured_peak: float, model_peak: float
    ) -> None:
        self.count += count
        self._absolute_sum += absolute
        self._squared_sum += squared
        self._measured_peak = max(self._measured_peak, measured_peak)
        self._model_peak = max(self._model_peak, model_peak)

    @property
    def sigma(self) -> float:
        """Mean absolute error so far; NaN before the first pair."""
        return self._absolute_sum / self.count if self.count else NAN

    @property
    def epsilon(self) -> float:
        """Relative peak error ε so far; NaN before a positive measured height."""
        return relative_peak_error(self._measured_peak, self._model_peak) if self.count else NAN

    @property
    def rms(self) -> float:
        """Root mean square error so far; NaN before the first pair."""
        return math.sqrt(self._squared_sum / self.count) if self.count else NAN


def _accuracy(measured: ArrayLike, model: ArrayLike) -> RunningAccuracy:
    reference = np.asarray(measured, dtype=np.float64)
    estimate = np.asarray(model, dtype=np.float64)
    if reference.ndim != 1 or reference.shape != estimate.shape:
        raise SloshMotionError(
            f"series of the shapes {reference.shape} and {estimate.shape} cannot be compared"
        )
    accuracy = RunningAccuracy()
    accuracy.update_many(reference, estimate)
    if not accuracy.count:
        raise SloshMotionError("the two series share no finite moment")
    return accuracy
