"""How well the model agrees with the camera, motion by motion.

A motion in which measured and estimated heights differ by more than the camera's noise explains
is one that the model does not describe: it is worth a discovery. Times are whole nanoseconds.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from slosh_estimator.rotation import Vector
from slosh_files.nanoseconds import SECOND
from slosh_report.alignment import despike
from slosh_report.metrics import rms_error
from slosh_report.motion_spans import AFTER_NS, MotionFinder, MotionSpan

NAN = float("nan")
TOLD_NS = 2 * SECOND
"""So long after its end a motion is judged: by then the camera has told what it saw of it [ns]."""
LONGEST_NS = 60 * SECOND
"""A motion that does not end is judged by the minute [ns]."""
LEAST = 20
"""Compared images that a judgement needs."""
NOISES = 3.0
"""What noise explains: so many of the sensor's standard deviations,"""
SHARE_OF_PEAK = 0.02
"""or this share of the highest height, to which a camera's calibration is trusted,"""
SHARE_OF_LIMIT = 0.05
"""or this share of the disagreement that is watched: less concerns nobody."""


class MotionAgreement(NamedTuple):
    """How a motion's measured and estimated heights agree.

    Attributes:
        start_ns, end_ns: first and last moment of moving [ns].
        images: compared.
        rms: root mean square of measured minus estimated (NL), single spikes left out [m].
        noise: root mean square of the sensor's standard deviation [m]; NaN: unknown.
        peak: highest measured height, single spikes left out [m].
        explained: up to where noise and the watched limit leave nothing to explain [m].
        estimated_peak: highest estimated height (NL) beside the measured ones [m].
    """

    start_ns: int
    end_ns: int
    images: int
    rms: float
    noise: float
    peak: float
    explained: float
    estimated_peak: float

    @property
    def disagrees(self) -> bool:
        """Whether the difference is more than noise explains."""
        return self.rms > self.explained

    @property
    def sentence(self) -> str:
        """What to do about a disagreement, in one line."""
        return (
            f"measured and estimated height differ by {1e3 * self.rms:.1f} mm rms in the last "
            f"motion, noise explains {1e3 * self.explained:.1f} mm: "
            "slosh discover --from-bag BAG --model MODEL names what the model lacks"
        )


class _Pair(NamedTuple):
    """Heights of one moment [m]."""

    stamp_ns: int
    measured: float
    stddev: float
    estimated: float


class MotionWatch:
    """Takes accelerations and pairs of heights in the order of their stamps.

    Args:
        limit: disagreement that is watched [m]; NaN or infinite: none.

    Attributes:
        finished: motions that were judged.
        disagreeing: those of them that disagree.
        last: the newest of them; None: none.
    """

    def __init__(self, limit: float = NAN) -> None:
        self.finished = self.disagreeing = 0
        self.last: MotionAgreement | None = None
        self.watch(limit)
        self._moving = MotionFinder()
        self._pairs: deque[_Pair] = deque()
        self._news: list[MotionAgreement] = []

    def watch(self, limit: float) -> None:
        """Judges the next motions by another limit of the disagreement [m]."""
        self._least = SHARE_OF_LIMIT * limit if math.isfinite(limit) else 0.0

    def reset(self) -> None:
        """Starts anew, without a motion."""
        self.finished = self.disagreeing = 0
        self.last = None
        self.forget()

    def forget(self) -> None:
        """Drops the motion under way: its stamps mean nothing any more."""
        self._moving = MotionFinder()
        self._pairs.clear()

    def take_finished(self) -> list[MotionAgreement]:
        """The motions that were judged since the last call."""
        news, self._news = self._news, []
        return news

    def add_acceleration(self, stamp_ns: int, acceleration: Vector) -> None:
        """Takes what drives the model: rising stamps [ns], gravity excluded [m/s²]."""
        self._moving.add_one(stamp_ns, acceleration)
        if not self._moving.spans:
            return
        motion = self._moving.spans[0]
        if stamp_ns - motion.end_ns >= TOLD_NS or stamp_ns - motion.start_ns >= LONGEST_NS:
            self._moving.forget_first()
            self._judge(motion)

    def add_pair(self, stamp_ns: int, measured: float, stddev: float, estimated: float) -> None:
        """Takes heights of one moment [m]; the standard deviation may be NaN."""
        if not (math.isfinite(measured) and math.isfinite(estimated)):
            return
        self._pairs.append(_Pair(stamp_ns, measured, stddev, estimated))
        if not self._moving.spans:
            # Of a motion that has just begun, the first moments are not known as such yet.
            self._forget_pairs(stamp_ns - TOLD_NS)

    def _forget_pairs(self, until_ns: int) -> None:
        while self._pairs and self._pairs[0].stamp_ns <= until_ns:
            self._pairs.popleft()

    def _judge(self, motion: MotionSpan) -> None:
        until = motion.end_ns + AFTER_NS
        seen = [pair for pair in self._pairs if motion.start_ns <= pair.stamp_ns <= until]
        self._forget_pairs(until)
        _, measured, stddev, estimated = np.array(seen, dtype=np.float64).reshape(-1, 4).T
        clean = despike(measured)
        kept = np.isfinite(clean)
        images = int(np.count_nonzero(kept))
        if images < LEAST:
            return
        rms = rms_error(clean, estimated)
        known = stddev[kept & np.isfinite(stddev)]
        noise = float(np.sqrt(np.mean(known**2))) if len(known) else NAN
        peak = float(clean[kept].max())
        # Python's max: a NaN that comes later is passed over.
        explained = max(self._least, SHARE_OF_PEAK * peak, NOISES * noise)
        found = MotionAgreement(
            *motion, images, rms, noise, peak, explained, float(estimated[kept].max())
        )
        self.finished += 1
        self.disagreeing += found.disagrees
        self.last = found
        self._news.append(found)
