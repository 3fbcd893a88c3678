"""Compares the predicted with the measured peak height of each motion.

Times are whole nanoseconds. A prediction belongs to the motion that begins when it said, or, where
it said nothing, to the next one.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.agreement import MotionAgreement
from slosh_estimator.tuning import TUNING

NAN = float("nan")
LONGEST_WAIT_NS = 600 * SECOND
MOST_WAITING = 16


class Announced(NamedTuple):
    """A published prediction: stamps [ns], duration [s] and peak [m]; see MotionPrediction.msg."""

    id: int
    stamp_ns: int
    start_ns: int
    duration: float
    peak: float

    @property
    def expected_ns(self) -> int:
        """Earliest time at which the predicted motion can start [ns]."""
        return (self.start_ns or self.stamp_ns) - TUNING.early_ns

    @property
    def latest_ns(self) -> int:
        """Latest time at which the predicted motion can start [ns]."""
        if not self.start_ns:
            return self.stamp_ns + LONGEST_WAIT_NS
        return self.start_ns + round(
            (TUNING.late + TUNING.duration_share * self.duration) * SECOND
        )


class Outcome(NamedTuple):
    """Predicted and measured peak of a motion; the fields of PredictionOutcome.msg."""

    stamp_ns: int
    id: int
    start_ns: int
    predicted: float
    estimated: float
    measured: float
    error: float
    counted: bool
    count: int  # type: ignore[assignment]  # the message's name, over tuple.count
    sigma: float
    epsilon: float
    worst: float
    description: str


class PredictionRecord:
    """Matches predictions with motions and records how accurate the predictions were.

    Attributes:
        count: predictions whose motion was measured.
        last: the newest outcome; None: none.
    """

    def __init__(self) -> None:
        self._waiting: deque[Announced] = deque(maxlen=MOST_WAITING)
        self.reset()

    def reset(self) -> None:
        """Clears the outcomes; keeps predictions whose motion has not been executed yet."""
        self.count = 0
        self.last: Outcome | None = None
        self._absolute = self._relative = 0.0
        self._worst = NAN

    @property
    def sigma(self) -> float:
        """Mean absolute error of predicted peaks [m]; NaN without outcomes."""
        return self._absolute / self.count if self.count else NAN

    @property
    def epsilon(self) -> float:
        """Mean relative error (predicted - measured) / measured of peaks; NaN without outcomes."""
        return self._relative / self.count if self.count else NAN

    def announce(self, prediction: Announced) -> None:
        """Adds a prediction; ignores it if its peak is not finite.

        Of those that do not say when their motion begins the newest counts.
        """
        if not (math.isfinite(prediction.peak) and math.isfinite(prediction.duration)):
            return
        if not prediction.start_ns:
            kept = [waiting for waiting in self._waiting if waiting.start_ns]
            self._waiting = deque(kept, maxlen=MOST_WAITING)
        self._waiting.append(prediction)

    def judge(self, motion: MotionAgreement) -> Outcome | None:
        """Returns the outcome of the prediction of a motion, or None if none was made."""
        there = [
            one for one in self._waiting if one.expected_ns <= motion.start_ns <= one.latest_ns
        ]
        over = [one for one in self._waiting if one.latest_ns < motion.start_ns]
        if there:
            found = max(there, key=lambda one: one.expected_ns)
            over += [one for one in there if one.expected_ns <= found.expected_ns]
        self._waiting = deque(
            (one for one in self._waiting if one not in over), maxlen=MOST_WAITING
        )
        return self._outcome(found, motion) if there else None

    def _outcome(self, prediction: Announced, motion: MotionAgreement) -> Outcome:
        lasted = (motion.end_ns - motion.start_ns) / SECOND
        allowed = max(TUNING.duration_error, TUNING.duration_share * prediction.duration)
        counted = abs(lasted - prediction.duration) <= allowed
        error = motion.peak - prediction.peak
        if counted:
            self._take(error, motion.peak)
        words = (
            f"predicted {1e3 * prediction.peak:.1f} mm, measured {1e3 * motion.peak:.1f} mm"
            if counted
            else f"the motion lasted {lasted:.1f} s instead of {prediction.duration:.1f} s: "
            "not the planned motion"
        )
        self.last = Outcome(
            motion.end_ns, prediction.id, motion.start_ns, prediction.peak, motion.estimated_peak,
            motion.peak, error, counted, self.count, self.sigma, self.epsilon, self._worst, words,
        )  # fmt: skip
        return self.last

    def _take(self, error: float, measured: float) -> None:
        self.count += 1
        self._absolute += abs(error)
        self._relative -= error / max(measured, 1e-9)
        self._worst = max(error, 0.0) if math.isnan(self._worst) else max(error, self._worst)
