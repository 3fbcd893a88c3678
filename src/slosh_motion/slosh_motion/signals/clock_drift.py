"""Estimates offset and drift of the measurement's clock relative to the model's.

One least squares lays a stretch of measured heights over the model's, with offset, drift and the
heights' scale free. Within a single motion a drift looks like a frequency of the liquid that is
not the model's. Over several motions it does not: the clocks' offset grows from one to the next,
an error of the model is each time the same. `ClockDriftWatch` follows the offsets motion by
motion.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array
from slosh_motion.errors import SloshMotionError
from slosh_motion.signals.alignment import SEARCH, StillLevel, estimate_clock_offset, finite_series
from slosh_motion.tuning import TUNING


@dataclass(frozen=True, slots=True)
class ClockDrift:
    """Drift of one clock against another within one motion.

    Attributes:
        rate: what the measured clock gains per second of the model's [1].
        stddev: its standard deviation [1].
        gain: share of the residual's mean square that it explains beside an offset, in [0, 1].
    """

    rate: float
    stddev: float
    gain: float

    @property
    def seen(self) -> bool:
        """Whether the drift is significant and too large to be caused by model errors."""
        size = abs(self.rate)
        return (
            size > TUNING.drift_surely * self.stddev
            and size > TUNING.least_drift
            and self.gain > TUNING.drift_gain
        )

    def text(self) -> str:
        """Describes the clock drift in one line."""
        told = drift_text(self.rate, self.stddev)
        return f"{told}; or the liquid's frequency is not the model's: compare further motions"


class ClockLine(NamedTuple):
    """A straight line through the clock offsets of several motions.

    Attributes:
        offset: measured clock minus model clock, at the newest motion [s].
        offset_stddev: its standard deviation [s].
        rate: by how much it grows per second [1]; NaN: not known.
        rate_stddev: its standard deviation [1].
        freedom: degrees of freedom of the fit.
        span: from the first to the newest motion [s].
    """

    offset: float
    offset_stddev: float
    rate: float
    rate_stddev: float
    freedom: int
    span: float

    @property
    def drifts(self) -> bool:
        """Whether the clock offset grows significantly."""
        if self.freedom < TUNING.least_motions - 2:
            return False
        surely = TUNING.drift_surely * (1.0 + TUNING.few / self.freedom)
        size = abs(self.rate)
        return size > surely * self.rate_stddev and size * self.span > TUNING.least_gain

    @property
    def is_apart(self) -> bool:
        """Whether the clock offset is significant; never true after a single motion."""
        size = abs(self.offset)
        return (
            self.freedom >= 0
            and size > TUNING.drift_surely * self.offset_stddev
            and size > TUNING.least_offset
        )


def drift_text(rate: float, stddev: float) -> str:
    """Describes a clock drift and its remedy in one line."""
    which = "fast" if rate > 0.0 else "slow"
    return (
        f"the heights' clock runs {1e6 * abs(rate):.0f} ± {1e6 * stddev:.0f} ppm {which}: "
        f"synchronise the clocks, or give the model the effect clock_drift (rate: {rate:.4g})"
    )


class ClockDriftWatch:
    """Tracks the offset between the clocks of measured and estimated heights over motions.

    Attributes:
        line: of the motions so far; None: no motion tells an offset.
    """

    def __init__(self) -> None:
        self.line: ClockLine | None = None
        self._best: ClockDrift | None = None
        self._points: deque[tuple[float, float, float]] = deque(maxlen=TUNING.kept_motions)

    def add(
        self, t: Array, measured: Array, estimated: Array, motion: tuple[float, float]
    ) -> None:
        """Adds the measured and estimated heights of a motion.

        Args:
            t: (N,) moments, also before and behind the motion, from one origin for all [s].
            measured: (N,) heights above the still level that are stamped so [m]; NaN: no sample.
            estimated: (N,) heights that the model has at these moments [m].
            motion: first and last moment of the motion, on the model's clock [s].
        """
        # Of images with one stamp the first; those whose stamps go back show another time.
        kept = t > np.concatenate([[-math.inf], np.maximum.accumulate(t)[:-1]])
        t, measured, estimated = t[kept], measured[kept], estimated[kept]
        part = (t >= motion[0]) & (t <= motion[1])
        if np.count_nonzero(part) < TUNING.least_covered:
            return
        model_t, model = t[part], estimated[part]
        middle = 0.5 * float(model_t[0] + model_t[-1])
        try:
            found = estimate_clock_offset(
                t, measured, model_t, model,
                centre=self._foretold(middle), search=TUNING.near if self._points else SEARCH,
                still=StillLevel(0.0, 0.0, float(t[0]), float(t[-1])),
            )  # fmt: skip
        except SloshMotionError:
            return
        if not found.unambiguous or not found.stddev < TUNING.rough_offset:
            return
        within = estimate_clock_drift(t, measured, model_t, model, found.offset)
        if self._best is None or within.stddev < self._best.stddev:
            self._best = within
        self._points.append((middle, found.offset, found.stddev))
        self.line = _line(np.array(self._points))

    @property
    def within(self) -> ClockDrift | None:
        """Returns the clock drift from the motion that shows it best; None if no motion shows it.

        None: none is seen, or the offsets of the motions contradict it.
        """
        line, best = self.line, self._best
        if (
            line is None
            or best is None
            or line.freedom >= TUNING.least_motions - 2
            or not best.seen
        ):
            return None
        (begin, first, one), *_, (end, last, other) = (self._points[0], *self._points)
        error = math.hypot(one, other, TUNING.model_error, best.stddev * (end - begin))
        agrees = abs(last - first - best.rate * (end - begin)) < TUNING.drift_surely * error
        return best if agrees else None

    @property
    def is_sure(self) -> bool:
        """Whether clock errors, not the model, explain the difference of the heights."""
        return self.line is not None and (self.line.drifts or self.line.is_apart)

    def text(self) -> str:
        """Describes the clocks' offset or drift in one line; empty if none was found."""
        line = self.line
        if line is None:
            return ""
        if line.drifts:
            return drift_text(line.rate, line.rate_stddev)
        if self.within is not None:
            return self.within.text()
        if not line.is_apart:
            return ""
        which = "late" if line.offset > 0.0 else "early"
        return (
            f"the heights are stamped {1e3 * abs(line.offset):.0f} ± "
            f"{1e3 * line.offset_stddev:.0f} ms {which}: synchronise the clocks, or give "
            f"the model the effect time_offset (tau: {line.offset:.3f})"
        )

    def facts(self) -> dict[str, str]:
        """Returns significant offset [ms] and drift [ppm] with standard deviations, by name."""
        found: dict[str, str] = {}
        line = self.line
        if line is None:
            return found
        if line.is_apart:
            found["clock offset [ms]"] = (
                f"{1e3 * line.offset:.1f} ± {1e3 * line.offset_stddev:.1f}"
            )
        if line.drifts:
            found["clock drift [ppm]"] = f"{1e6 * line.rate:.0f} ± {1e6 * line.rate_stddev:.0f}"
        elif self.within is not None:
            rate, stddev = self.within.rate, self.within.stddev
            found["clock drift within a motion [ppm]"] = f"{1e6 * rate:.0f} ± {1e6 * stddev:.0f}"
        return found

    def _foretold(self, t: float) -> float:
        """Predicts the clock offset [s] at a time from earlier motions."""
        if self.line is None:
            return 0.0
        rate = self.line.rate if self.line.drifts else 0.0
        return self.line.offset + rate * (t - self._points[-1][0])


def _line(points: Array) -> ClockLine:
    """Fits a line to clock offsets, given rows of time, offset and standard deviation [s]."""
    t, offset, stddev = points.T
    weight = 1.0 / (stddev**2 + TUNING.model_error**2)
    since = t - t[-1]
    if len(t) < TUNING.least_motions:
        mean = float(np.average(offset, weights=weight))
        scatter = max(float(np.average((offset - mean) ** 2, weights=weight)), 1.0 / weight.sum())
        return ClockLine(
            mean, math.sqrt(scatter), math.nan, math.inf, len(t) - 2, -float(since[0])
        )
    columns = np.column_stack([np.ones(len(t)), since])
    covariance = np.linalg.pinv((columns * weight[:, None]).T @ columns)
    solved = covariance @ (columns.T @ (weight * offset))
    freedom = len(t) - 2
    excess = float(weight @ (offset - columns @ solved) ** 2) / freedom
    errors = np.sqrt(np.diag(covariance) * max(excess, 1.0))
    return ClockLine(
        float(solved[0]), float(errors[0]), float(solved[1]), float(errors[1]), freedom,
        -float(since[0]),
    )  # fmt: skip


def estimate_clock_drift(
    t: Array, height: Array, model_t: Array, model: Array, offset: float
) -> ClockDrift:
    """Estimates the drift of the measurement's clock near a given offset by least squares.

    Offset, drift and the heights' scale are fitted together, so that a wrong scale is none.

    Args:
        t: (N,) measured clock [s].
        height: (N,) measured heights above the still level [m]; NaN: no sample.
        model_t: (M,) model clock [s], spanning the motion to be compared.
        model: (M,) model heights above the still level [m].
        offset: measured clock minus model clock, as `estimate_clock_offset` finds it [s].
    """
    t, height = finite_series(t, height)
    covered = (t >= model_t[0] + offset) & (t <= model_t[-1] + offset)
    t, height = t[covered] - offset, height[covered]
    if len(t) < TUNING.least_covered:
        return ClockDrift(0.0, math.inf, 0.0)
    middle, slope = 0.5 * float(t[0] + t[-1]), np.gradient(model, model_t)
    late = rate = 0.0
    powers = []
    for _ in range(TUNING.drift_rounds):
        moments = t - late - rate * (t - middle)
        wave, rise = np.interp(moments, model_t, model), np.interp(moments, model_t, slope)
        columns = np.column_stack([wave, -rise, -rise * (t - middle)])
        solved, *_ = np.linalg.lstsq(columns, height, rcond=None)
        scaled = solved[1:] / solved[0] if solved[0] > 0.0 else np.zeros(2)
        plain, *_ = np.linalg.lstsq(columns[:, :2], height, rcond=None)
        powers.append(float(np.mean((height - columns[:, :2] @ plain) ** 2)))
        residual = height - columns @ solved
        late, rate = late + float(scaled[0]), rate + float(scaled[1])
    power = float(np.mean(residual**2))
    correlation = float(np.mean(residual[1:] * residual[:-1])) / max(power, 1e-300)
    together = (1.0 + min(max(correlation, 0.0), 0.99)) / (1.0 - min(max(correlation, 0.0), 0.99))
    covariance = np.linalg.pinv(columns.T @ columns) * power * together
    stddev = math.sqrt(max(float(covariance[2, 2]), 0.0)) / max(abs(float(solved[0])), 1e-9)
    return ClockDrift(rate, stddev, 1.0 - power / max(powers[0], 1e-300))
