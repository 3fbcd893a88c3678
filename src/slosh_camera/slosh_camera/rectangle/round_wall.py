"""Computes the heights around a round wall from the contact line in a side view.

Seen from the side, the liquid's line is the higher one of those on the near and on the far half
of the wall. All first modes are a cosine of the azimuth there; second order adds the cosine of
twice the azimuth. The near half is seen larger than the plane through the axis, the far half
smaller: each of the two readings is fitted, and what they leave of the level, which no wave
changes, tells which one it is.

At rest a camera that is not quite level sees the line bowed. A surface seen so flatly mirrors what
is behind it: the line is the near half's, bowed down from above and up from below, and the far
half's, from which its heights count, is bowed the other way. The far half is seen only where it
is higher in the image than the near one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_camera.optics.round_body import RoundView
from slosh_camera.rectangle.tuning import TUNING

FloatArray = NDArray[np.float64]

_ANGLES = np.linspace(-np.pi, np.pi, 721)
_LEFT, _RIGHT = 180, 540
NEAR, FAR = False, True


class RoundWall(NamedTuple):
    """Heights around a round wall, estimated from a side view.

    Attributes:
        left, right: at both ends of the line [m].
        ends_stddev: standard deviation of the two [m].
        height: the highest [m].
        stddev: its standard deviation [m].
        azimuth: where it is, from x towards y, away from the camera [rad]; NaN: before or behind
            the axis, not known which.
        spread: standard deviation of it by not knowing which half is seen, and was at rest [m].
    """

    left: float
    right: float
    ends_stddev: float
    height: float
    stddev: float
    azimuth: float
    spread: float


class _Reading(NamedTuple):
    """Contact line taken to lie on one half of the wall: Fourier coefficients and misfit.

    They are those of heights as on an upright wall, see `RoundView.upright`.
    """

    view: RoundView
    coefficients: FloatArray
    covariance: FloatArray
    misfit: float

    def at(self, angles: FloatArray) -> FloatArray:
        """Returns heights on the wall [m] at azimuths measured from the camera's direction."""
        return self.view.leaning(_functions(angles) @ self.coefficients)

    def stddev(self, angle: float) -> float:
        """Returns the standard deviation of the height at an azimuth [m]."""
        functions = _functions(np.array([angle]))[0]
        return float(np.sqrt(functions @ self.covariance @ functions))


def round_wall(
    view: RoundView, x: FloatArray, z: FloatArray, common: float, bow: float = 0.0
) -> RoundWall:
    """Estimates the heights around a round wall from points of the contact line.

    Args:
        view: the container as the camera sees it.
        x: (N,) places across, as `RoundView` has them [m].
        z: (N,) heights above the line at rest in the plane through the axis [m].
        common: standard deviation of what all points are off together [m].
        bow: of the line at rest, positive upwards [m].
    """
    towards = np.cos(view.around(x, np.zeros(x.size), far=NEAR)[0])
    apart = bow * (1.0 + _shrinking(view))
    readings = [_fitted(view, x, z, NEAR), _fitted(view, x, z + apart * towards, FAR)]
    hidden = max(float(readings[FAR].coefficients[2]) + 0.5 * apart, 0.0) / TUNING.level_sure
    misfits = np.array([readings[NEAR].misfit, readings[FAR].misfit + hidden**2])
    likely = np.exp(0.5 * (misfits.min() - misfits))
    likely /= likely.sum()
    best = readings[int(np.argmax(likely))]
    sure = bool(likely.max() > TUNING.sure_reading)
    around = np.array([one.at(_ANGLES) for one in readings])
    tops = around.max(axis=1)
    height, spread = _mixed(tops, likely)
    left, right = (_mixed(around[:, at], likely) for at in (_LEFT, _RIGHT))
    ends = np.hypot(best.stddev(_ANGLES[_RIGHT]), max(left[1], right[1]))
    highest = int(np.argmax(around[int(np.argmax(likely))]))
    # Of a liquid that mirrors nothing a line bowed up may be the far half's, seen from above.
    spread = float(np.hypot(spread, 2.0 * max(bow, 0.0) * np.cos(_ANGLES[highest])))
    azimuth = float(_ANGLES[highest]) - 0.5 * np.pi
    sideways = abs(np.sin(azimuth)) < TUNING.sideways
    return RoundWall(
        left[0],
        right[0],
        float(np.hypot(ends, common)),
        height,
        float(np.sqrt(best.stddev(_ANGLES[highest]) ** 2 + common**2 + spread**2)),
        float(np.angle(np.exp(1j * azimuth))) if sure or sideways else float("nan"),
        spread,
    )


def _shrinking(view: RoundView) -> float:
    """Returns the ratio of far to near half's curvature in the image, for liquid at rest."""
    inner = view.body.size
    return (view.distance - inner) / (view.distance + inner)


def _mixed(values: FloatArray, likely: FloatArray) -> tuple[float, float]:
    """Returns the probability-weighted mean and standard deviation of two values."""
    mean = float(likely @ values)
    return mean, float(np.sqrt(likely @ (values - mean) ** 2))


def _functions(angles: FloatArray) -> FloatArray:
    """Returns columns 1, sin φ, cos φ, cos 2φ, sin 2φ for azimuths φ (N,)."""
    return np.column_stack(
        (np.ones(angles.size), np.sin(angles), np.cos(angles), np.cos(2 * angles),
         np.sin(2 * angles))
    )  # fmt: skip


def _fitted(view: RoundView, x: FloatArray, z: FloatArray, far: bool) -> _Reading:
    """Fits a contact line's points as lying on the near or on the far half of the wall."""
    angles, heights = view.around(x, z, far=far)
    heights = view.upright(heights)
    functions = _functions(angles)
    size = float(np.ptp(heights)) + TUNING.level_sure
    prior = np.array([0.0, np.inf, np.inf, TUNING.second_order, TUNING.second_order]) * size
    prior[0] = np.hypot(TUNING.level_sure, TUNING.level_second * size)
    scatter = TUNING.level_sure
    weight: FloatArray = np.ones(x.size)
    coefficients: FloatArray = np.zeros(5)
    normal = np.eye(5)
    for _ in range(6):
        variance = TUNING.correlated_columns * scatter**2
        weighted = functions * (weight / variance)[:, np.newaxis]
        normal = weighted.T @ functions + np.diag(prior**-2.0)
        coefficients = np.asarray(np.linalg.solve(normal, weighted.T @ heights), np.float64)
        residual = heights - functions @ coefficients
        scatter = max(1.4826 * float(np.median(np.abs(residual))), TUNING.least_scatter)
        weight = np.maximum(1.0 - (residual / (TUNING.tukey * scatter)) ** 2, 0.0) ** 2
    # Both readings are judged by the same error of a point.
    variance = TUNING.correlated_columns * TUNING.reading_error**2
    clipped = np.minimum(np.abs(residual), 3.0 * TUNING.reading_error)
    misfit = float((clipped**2).sum() / variance + ((coefficients / prior) ** 2).sum())
    covariance: FloatArray = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    return _Reading(view, coefficients, covariance, misfit)
