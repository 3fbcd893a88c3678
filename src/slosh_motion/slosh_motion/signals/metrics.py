"""Metrics of how well modelled heights agree with measured ones.

The indices of DL22 and TM20. Every function takes two series of the same length, in the same unit,
and leaves out the moments at which one of them is not finite.

The indices of TM20 of profiles η(x, t) over a container's width. x is measured from its middle, η
from the still level; a frame is one row of a profile.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slosh_base.types import Array
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


def line_slopes(x: ArrayLike, eta: ArrayLike) -> Array:
    """Returns the slope of the line nearest to each surface profile (TM20, eqs. (11), (12)).

    The squares' sum is a parabola in θ: its lowest point needs no iteration.

    Args:
        x: (I,) [m].
        eta: (J, I) [m]; NaN: no sample there.

    Returns:
        (J,) [1], NaN where a frame has no sample off the middle.

    Raises:
        SloshMotionError: shapes that do not match.
    """
    places, frames = _profile(x, eta)
    known = np.isfinite(frames)
    sizes = known @ places**2
    products = np.where(known, frames, 0.0) @ places
    slopes: Array = np.divide(products, sizes, out=np.full(len(frames), np.nan), where=sizes > 0.0)
    return slopes


def line_approximation_error(x: ArrayLike, eta: ArrayLike) -> float:
    """Returns ε̄, the rms distance of profiles from their fitted lines [m] (TM20, eq. (13)).

    The printed equation has lost its root: only with it is ε̄ the length that its limit is.

    Args:
        x: (I,) [m].
        eta: (J, I) [m], the frames of the motion phase; NaN: no sample there.

    Raises:
        SloshMotionError: shapes that do not match, or no sample.
    """
    places, frames = _profile(x, eta)
    residual = frames - np.outer(line_slopes(places, frames), places)
    known = residual[np.isfinite(residual)]
    if not len(known):
        raise SloshMotionError("no frame with a sample: a line cannot be compared with nothing")
    return float(np.sqrt(np.mean(known**2)))


def effective_height(t: ArrayLike, x: ArrayLike, eta: ArrayLike) -> float:
    """Returns η_eff, the effective surface height over a dwell [m] (TM20, eq. (17)).

    Args:
        t: (J,) times of the frames, from the dwell's start to its end [s].
        x: (I,) from wall to wall [m].
        eta: (J, I) [m]; frames with a gap are left out, and the integral goes on over them.

    Raises:
        SloshMotionError: shapes that do not match, or fewer than two frames or places.
    """
    return math.sqrt(_mean_square(t, x, eta))


def effective_difference(
    t: ArrayLike, x: ArrayLike, measured: ArrayLike, slopes: ArrayLike
) -> float:
    """Returns Δη, the RMS distance [m] of surface profiles from given straight lines in a dwell.

    With the lines that are nearest to the frames it is Δη_appr (TM20, eq. (18)), with those of a
    simulation Δη_simul (19).

    Args:
        t: (J,) times of the frames, from the dwell's start to its end [s].
        x: (I,) from wall to wall [m].
        measured: (K, J, I) of K repetitions, or (J, I) of one [m].
        slopes: θ of the lines, (K, J), or (J,) the same for all repetitions.

    Raises:
        SloshMotionError: shapes that do not match, or fewer than two frames or places.
    """
    repetitions = np.asarray(measured, dtype=np.float64)
    if repetitions.ndim == 2:
        repetitions = repetitions[np.newaxis]
    if repetitions.ndim != 3:
        raise SloshMotionError(f"measured has the shape {repetitions.shape}, expected (K, J, I)")
    try:
        lines = np.broadcast_to(np.asarray(slopes, dtype=np.float64), repetitions.shape[:2])
    except ValueError:
        raise SloshMotionError(
            f"slopes {np.shape(slopes)} do not match measured {repetitions.shape}"
        ) from None
    places = np.asarray(x, dtype=np.float64)
    squares = [
        _mean_square(t, x, eta - np.outer(theta, places))
        for eta, theta in zip(repetitions, lines, strict=True)
    ]
    return math.sqrt(float(np.mean(squares)))


def _mean_square(t: ArrayLike, x: ArrayLike, eta: ArrayLike) -> float:
    """Returns the mean square of the surface height over time and width, by trapezoids [m²]."""
    places, frames = _profile(x, eta)
    times = np.asarray(t, dtype=np.float64)
    if times.shape != frames.shape[:1]:
        raise SloshMotionError(f"t {times.shape} does not match eta {frames.shape}")
    whole = np.isfinite(frames).all(axis=1)
    times, frames = times[whole], frames[whole]
    if len(times) < 2 or len(places) < 2:
        raise SloshMotionError(
            "an effective height needs at least two whole frames and two places"
        )
    return float(_mean_over(times, _mean_over(places, frames.T**2)))


def _mean_over(t: Array, values: Array) -> Array:
    """Returns the mean over the first axis by the trapezoidal rule."""
    mean: Array = 0.5 * np.diff(t) @ (values[1:] + values[:-1]) / (t[-1] - t[0])
    return mean


def _profile(x: ArrayLike, eta: ArrayLike) -> tuple[Array, Array]:
    places = np.asarray(x, dtype=np.float64)
    frames = np.asarray(eta, dtype=np.float64)
    if places.ndim != 1 or frames.ndim != 2 or frames.shape[1] != len(places):
        raise SloshMotionError(
            f"eta has the shape {frames.shape}, x {places.shape}; expected (J, I) and (I,)"
        )
    return places, frames
