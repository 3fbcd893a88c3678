"""Computes the published values of a side view: profile, highest point and slope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_camera.measurement import NAN
from slosh_camera.optics.box import BoxView
from slosh_camera.rectangle.fit import Waves, slope_weights, straight_line
from slosh_camera.rectangle.trace import TracedLine
from slosh_camera.rectangle.tuning import TUNING

FloatArray = NDArray[np.float64]

# Places of the published profile, the walls included.
PLACES = 65


@dataclass(frozen=True, slots=True)
class Highest:
    """Highest point of the contact line, with its standard deviation.

    Attributes:
        x: place [m].
        height: above the still line [m].
        stddev: standard deviation of the height [m].
    """

    x: float
    height: float
    stddev: float


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Heights along the contact line in a side view.

    Attributes:
        x: (PLACES,) at equal distances from the left wall to the right wall [m].
        height: (PLACES,) above the still line [m]; NaN where the line is hidden.
        peak: highest point that is seen.
        peak_pixel: of it in the image [px].
        fitted: highest point of the fitted shape.
        left: height at the left wall [m]; NaN where it is hidden.
        right: height at the right wall [m].
        level: height of the straight line in the middle [m].
        slope_angle: of the straight line [rad], positive where the liquid rises to the right.
        slope_stddev: standard deviation of slope_angle [rad].
    """

    x: FloatArray
    height: FloatArray
    peak: Highest
    peak_pixel: tuple[float, float]
    fitted: Highest
    left: float
    right: float
    level: float
    slope_angle: float
    slope_stddev: float


def describe(line: TracedLine, view: BoxView) -> Profile:
    """Computes profile, highest points and straight line from a detected contact line.

    Args:
        view: the container as the camera sees it.
    """
    half = 0.5 * view.box.width
    x = _places(view.box.width)
    residual = line.z - line.shape.at(line.x)
    height = _resampled(line, residual, x)
    whole = np.where(np.isfinite(height), height, line.shape.at(x))
    level, slope = straight_line(x, whole)
    left, right = (_at_wall(line, residual, wall) for wall in (-half, half))
    common = common_error(line)
    covariance = TUNING.correlated_columns * line.shape.scatter**2 * line.shape.covariance
    peak = _peak(line, residual, (left, right), common)
    fitted_x, fitted_height, functions = line.shape.highest()
    doubt = TUNING.doubt_part * line.pixel_height * np.interp(x, line.x, line.doubt)
    fitted_variance = common**2 + functions @ covariance @ functions
    # What the shape does not follow may be wrong with it, and a doubt about a part moves it all.
    fitted_variance += line.shape.scatter**2 + float(np.max(doubt)) ** 2
    of_doubt = float(slope_weights(x) @ doubt)
    of_shape = _slope_stddev(line.shape.waves, slope, common, covariance)
    return Profile(
        x=x,
        height=height,
        peak=peak,
        peak_pixel=_pixel(line, view, peak),
        fitted=Highest(fitted_x, fitted_height, float(np.sqrt(fitted_variance))),
        left=left,
        right=right,
        level=level,
        slope_angle=float(np.arctan(slope)),
        slope_stddev=float(np.hypot(of_shape, of_doubt)),
    )


def _places(width: float) -> FloatArray:
    return np.linspace(-0.5 * width, 0.5 * width, PLACES)


def _resampled(line: TracedLine, residual: FloatArray, x: FloatArray) -> FloatArray:
    """Returns the line's heights [m] at positions x [m]: fit plus mean residual nearby."""
    reach = max(0.5 * float(x[1] - x[0]), TUNING.reach * line.pixel_height)
    start = np.searchsorted(line.x, x - reach)
    count = np.searchsorted(line.x, x + reach) - start
    sums = np.concatenate(([0.0], np.cumsum(residual)))
    added = (sums[start + count] - sums[start]) / np.maximum(count, 1)
    height: FloatArray = np.where(count > 0, line.shape.at(x) + added, np.nan)
    return height


def _at_wall(line: TracedLine, residual: FloatArray, wall: float) -> float:
    """Returns the line's height [m] at a side wall, extrapolated and corrected near the wall.

    The last pixels before the wall mix what is on either side, so the line is led on over them. On
    a round wall the shape alone tells it: there the line turns away from the camera.
    """
    width = line.shape.width
    if line.shape.waves.is_round:
        near = np.min(np.abs(line.x - wall)) <= TUNING.round_gap * width
        return float(line.shape.at(np.array([wall]))[0]) if near else NAN
    away = np.abs(line.x - wall)
    near = away < max(TUNING.wall_part * width, 2.0 * TUNING.wall_points * line.pixel_height)
    if np.count_nonzero(near) < TUNING.wall_points or np.min(away) > TUNING.wall_gap * width:
        return NAN
    added = residual[near]
    order = np.argsort(away[near])
    level, _ = straight_line(away[near][order], added[order])
    # Too few points to tell a slope would lead anywhere.
    level = float(np.clip(level, np.min(added), np.max(added)))
    return float(line.shape.at(np.array([wall]))[0]) + level


def _peak(
    line: TracedLine, residual: FloatArray, walls: tuple[float, float], common: float
) -> Highest:
    """Returns the highest visible point of the liquid: on the line or at a wall."""
    heights = line.shape.at(line.x) + _running_median(residual)
    half = 0.5 * line.shape.width
    x = np.concatenate((line.x, [-half, half], line.full_x))
    z = np.concatenate((heights, walls, line.full_z))
    highest = int(np.nanargmax(z))
    doubt = (
        TUNING.doubt_part * line.pixel_height * float(np.interp(x[highest], line.x, line.doubt))
    )
    stddev = np.sqrt(common**2 + (TUNING.smoothed_noise * line.shape.scatter) ** 2 + doubt**2)
    return Highest(float(x[highest]), float(z[highest]), float(stddev))


def _pixel(line: TracedLine, view: BoxView, peak: Highest) -> tuple[float, float]:
    zero = line.knowledge.zero(np.array([peak.x]))
    u, v = view.project_face(peak.x, peak.height + zero)[0]
    return float(u), float(v)


def _running_median(values: FloatArray) -> FloatArray:
    padded = np.pad(values, TUNING.smoothed_columns // 2, mode="reflect")
    windows = np.lib.stride_tricks.sliding_window_view(padded, TUNING.smoothed_columns)
    median: FloatArray = np.median(windows, axis=1)
    return median


def common_error(line: TracedLine) -> float:
    """Returns the standard deviation of the error that all line points have in common [m]."""
    of_softness = TUNING.common_clipped if line.clipped else TUNING.common_softness
    softness = float(np.median(line.softness))
    return line.pixel_height * float(np.hypot(TUNING.common_floor, of_softness * softness))


def _slope_stddev(waves: Waves, slope: float, common: float, covariance: FloatArray) -> float:
    """Returns the standard deviation of the straight line's angle [rad].

    The straight line's slope is a weighted sum of the heights, and these follow the shape's
    coefficients. What light does to the edge may differ from wall to wall.
    """
    x = _places(waves.width)
    functions = slope_weights(x) @ waves.basis(x)
    of_light = 2.0 * common / float(np.ptp(x))
    spread = float(np.sqrt(functions @ covariance @ functions + of_light**2))
    return spread / (1.0 + slope**2)
