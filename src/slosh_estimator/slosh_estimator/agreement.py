"""How well the model agrees with the camera, motion by motion.

A motion in which measured and estimated heights differ by more than the camera's noise explains
is one that the model does not describe: it is worth a discovery. Times are whole nanoseconds.
"""

from __future__ import annotations

import math
from array import array
from typing import NamedTuple

import numpy as np

from slosh_estimator.rotation import Vector
from slosh_files.nanoseconds import SECOND
from slosh_report.alignment import despike

NAN = float("nan")
MOVING = 0.15
"""Size of the smoothed acceleration from which the container counts as moving [m/s²]."""
SMOOTHING = 0.05
"""Time constant of the mean over a sensor's noise [s]."""
PAUSE_NS = 2 * SECOND
"""A rest of this length ends a motion; by then the camera has told what it saw of it [ns]."""
AFTER_NS = SECOND
"""How long after its end a motion's liquid still counts [ns]."""
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
    """

    start_ns: int
    end_ns: int
    images: int
    rms: float
    noise: float
    peak: float
    explained: float

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
        self._least = SHARE_OF_LIMIT * limit if math.isfinite(limit) else 0.0
        self._smooth: Vector = (0.0, 0.0, 0.0)
        self._stamp_ns: int | None = None
        self._start_ns: int | None = None
        self._end_ns = 0
        self._pairs = array("d")
        self._news: list[MotionAgreement] = []

    def reset(self) -> None:
        """Starts anew, without a motion."""
        self.finished = self.disagreeing = 0
        self.last = None
        self.forget()

    def forget(self) -> None:
        """Drops the motion under way: its stamps mean nothing any more."""
        self._smooth, self._stamp_ns, self._start_ns = (0.0, 0.0, 0.0), None, None
        self._pairs = array("d")

    def take_finished(self) -> list[MotionAgreement]:
        """The motions that were judged since the last call."""
        news, self._news = self._news, []
        return news

    def add_acceleration(self, stamp_ns: int, acceleration: Vector) -> None:
        """Takes what drives the model: rising stamps [ns], gravity excluded [m/s²]."""
        size = self._smoothed(stamp_ns, acceleration)
        start = self._start_ns
        if start is not None and (
            stamp_ns - self._end_ns >= PAUSE_NS or stamp_ns - start >= LONGEST_NS
        ):
            self._judge(start)
        if size > MOVING:
            self._end_ns = stamp_ns
            if self._start_ns is None:
                self._start_ns = stamp_ns

    def add_pair(self, stamp_ns: int, measured: float, stddev: float, estimated: float) -> None:
        """Takes heights of one moment [m]; the standard deviation may be NaN."""
        start = self._start_ns
        if start is None or not start <= stamp_ns <= self._end_ns + AFTER_NS:
            return
        if math.isfinite(measured) and math.isfinite(estimated):
            self._pairs.extend((measured, stddev, estimated))

    def _smoothed(self, stamp_ns: int, acceleration: Vector) -> float:
        dt = 0.0 if self._stamp_ns is None else max(stamp_ns - self._stamp_ns, 0) / SECOND
        self._stamp_ns = stamp_ns
        blend = dt / (SMOOTHING + dt)
        x, y, z = self._smooth
        ax, ay, az = acceleration
        if math.isfinite(ax + ay + az):
            self._smooth = (x + blend * (ax - x), y + blend * (ay - y), z + blend * (az - z))
        return math.hypot(*self._smooth)

    def _judge(self, start_ns: int) -> None:
        measured, stddev, estimated = np.array(self._pairs).reshape(-1, 3).T
        self._start_ns, self._pairs = None, array("d")
        clean = despike(measured)
        kept = np.isfinite(clean)
        images = int(np.count_nonzero(kept))
        if images < LEAST:
            return
        rms = float(np.sqrt(np.mean((clean[kept] - estimated[kept]) ** 2)))
        known = stddev[kept & np.isfinite(stddev)]
        noise = float(np.sqrt(np.mean(known**2))) if len(known) else NAN
        peak = float(clean[kept].max())
        # Python's max: a NaN that comes later is passed over.
        explained = max(self._least, SHARE_OF_PEAK * peak, NOISES * noise)
        found = MotionAgreement(start_ns, self._end_ns, images, rms, noise, peak, explained)
        self.finished += 1
        self.disagreeing += found.disagrees
        self.last = found
        self._news.append(found)
