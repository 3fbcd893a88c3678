"""Checks for each motion whether the model agrees with the camera.

A motion in which measured and estimated heights differ by more than the camera's noise explains
is one that the model does not describe: it is worth a discovery. One in which the waves' azimuths
differ tells of a sensor or a camera that is mounted otherwise than it is said to be. Times are
whole nanoseconds.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_estimator.azimuth import WaveOffset, wave_offset
from slosh_estimator.tuning import TUNING
from slosh_estimator.wave_presence import Pair, PresenceWatch
from slosh_motion.checks.constancy import BIN_NS
from slosh_motion.inputs.frames import Vector
from slosh_motion.signals.alignment import despike
from slosh_motion.signals.clock_drift import ClockDriftWatch
from slosh_motion.signals.metrics import rms_error
from slosh_motion.signals.motion_spans import AFTER_NS, MotionFinder, MotionSpan

NAN = float("nan")
FEW = 16
"""So many accelerations are faster taken one by one."""


class MotionAgreement(NamedTuple):
    """Agreement of measured and estimated heights during one motion of the container.

    Attributes:
        start_ns, end_ns: first and last moment of moving [ns].
        images: compared.
        rms: root mean square of measured minus estimated (NL), single spikes left out [m].
        noise: root mean square of the sensor's standard deviation [m]; NaN: unknown.
        peak: highest measured height, single spikes left out [m].
        explained: up to where noise and the watched limit leave nothing to explain [m].
        estimated_peak: highest estimated height (NL) beside the measured ones [m].
        offset: how the measured wave is turned against the estimated one; None: not known.
    """

    start_ns: int
    end_ns: int
    images: int
    rms: float
    noise: float
    peak: float
    explained: float
    estimated_peak: float
    offset: WaveOffset | None = None

    @property
    def is_turned(self) -> bool:
        """Whether the azimuths of the measured and the estimated wave disagree."""
        return self.offset is not None and self.offset.disagrees

    @property
    def disagrees(self) -> bool:
        """Whether the heights differ by more than noise, or the azimuths disagree."""
        return self.rms > self.explained or self.is_turned

    @property
    def sentence(self) -> str:
        """Describes in one line how to resolve a disagreement; a wrong azimuth comes first."""
        if self.offset is not None and self.is_turned:
            return self.offset.sentence
        return (
            f"measured and estimated height differ by {1e3 * self.rms:.1f} mm rms in the "
            f"last motion, noise explains {1e3 * self.explained:.1f} mm: run slosh discover "
            "--from-bag BAG --model MODEL to find what the model lacks"
        )


class MotionWatch:
    """Collects accelerations and pairs of heights, and judges each motion after its end.

    Args:
        limit: disagreement that is watched [m]; NaN or infinite: none.

    Attributes:
        finished: motions that were judged.
        disagreeing: those of them that disagree.
        last: the newest of them; None: none.
        clocks: how the heights' clock differs from the estimates'.

    >>> watch = MotionWatch(limit=0.01)  # m
    >>> watch.finished
    0
    """

    def __init__(self, limit: float = NAN) -> None:
        self.finished = self.disagreeing = 0
        self.last: MotionAgreement | None = None
        self._standing: MotionAgreement | None = None
        self._presence = PresenceWatch()
        self.watch(limit)
        self._moving = MotionFinder()
        self.clocks = ClockDriftWatch()
        self._origin: int | None = None
        self._pairs: deque[Pair] = deque()
        self._looked_ns = -(2**62)
        self._news: list[MotionAgreement] = []

    def watch(self, limit: float) -> None:
        """Sets the height limit [m]; a share of it is the least height difference that counts."""
        self._least = TUNING.agreement_share * limit if math.isfinite(limit) else 0.0
        self._presence.watch(limit)

    @property
    def warning(self) -> str:
        """Describes the current disagreement in one line; empty if there is none.

        It stands from the judgement that found it until a motion agrees.
        """
        standing = ""
        if self._standing is not None:
            clocks = self.clocks.is_sure and not self._standing.is_turned
            standing = self.clocks.text() if clocks else self._standing.sentence
        return self._presence.warning or standing

    def reset(self) -> None:
        """Forgets all motions, judged or in progress, to start anew."""
        self.finished = self.disagreeing = 0
        self.last = self._standing = None
        self._presence.reset()
        self.forget()

    def forget(self) -> None:
        """Drops the motion in progress, since its stamps are no longer valid."""
        self._moving = MotionFinder()
        self.clocks, self._origin = ClockDriftWatch(), None
        self._pairs.clear()
        self._looked_ns = -(2**62)
        self._presence.forget()

    def take_finished(self) -> list[MotionAgreement]:
        """Returns the motions that were judged since the last call."""
        news, self._news = self._news, []
        return news

    def add_acceleration(self, stamp_ns: int, acceleration: Vector) -> None:
        """Adds an acceleration without gravity [m/s²]; stamps [ns] must increase."""
        self._moving.add_one(stamp_ns, acceleration)
        self._look(stamp_ns)

    def add_accelerations(self, stamps: NDArray[np.int64], accelerations: Array) -> None:
        """Adds accelerations (N, 3) [m/s²] with stamps (N,) [ns], as if one by one."""
        if len(stamps) <= FEW:
            for stamp, row in zip(stamps.tolist(), accelerations.tolist(), strict=True):
                self.add_acceleration(stamp, tuple(row))
            return
        known = np.isfinite(accelerations).all(axis=1)
        stamps, accelerations = stamps[known], accelerations[known]
        # Where a motion begins or ends is known bin by bin.
        edges = [0, *(np.flatnonzero(np.diff(stamps // BIN_NS)) + 1).tolist(), len(stamps)]
        for start, end in pairwise(edges):
            if end > start:
                self._moving.add(stamps[start:end], accelerations[start:end])
                self._look(int(stamps[end - 1]))

    def add_pair(
        self,
        stamp_ns: int,
        measured: float,
        stddev: float,
        estimated: float,
        waves: tuple[complex, complex, float] = (complex(NAN, NAN), complex(NAN, NAN), NAN),
    ) -> None:
        """Adds measured and estimated heights [m] of the same time.

        Args:
            stamp_ns: [ns].
            measured, stddev, estimated: [m].
            waves: the measured and the estimated wave as vectors [m] and the image plane's right
                [rad], of `azimuth.measured_waves`.
        """
        if not (math.isfinite(measured) and math.isfinite(estimated)):
            return
        pair = Pair(stamp_ns, measured, stddev, estimated, *waves)
        self._pairs.append(pair)
        self._presence.add(pair)
        if not self._moving.spans:
            # Of a motion that has just begun, the first moments are not known as such yet.
            self._forget_pairs(stamp_ns - TUNING.told_ns)
            return
        motion = self._moving.spans[0]
        self._looked_ns = max(self._looked_ns, motion.start_ns)
        if stamp_ns - self._looked_ns >= TUNING.judged_ns and motion.end_ns + AFTER_NS > stamp_ns:
            self._looked_ns = stamp_ns
            newest = max(motion.start_ns, stamp_ns - 2 * TUNING.judged_ns)
            found = self._agreement(MotionSpan(newest, stamp_ns))
            if found is not None and found.disagrees:
                self._standing = found

    def _look(self, stamp_ns: int) -> None:
        """Judges the earliest motion not judged yet, if it has ended or lasts too long."""
        if not self._moving.spans:
            return
        motion = self._moving.spans[0]
        if (
            stamp_ns - motion.end_ns >= TUNING.told_ns
            or stamp_ns - motion.start_ns >= TUNING.longest_ns
        ):
            self._moving.forget_first()
            self._judge(motion)

    def _forget_pairs(self, until_ns: int) -> None:
        while self._pairs and self._pairs[0].stamp_ns <= until_ns:
            self._pairs.popleft()

    def _judge(self, motion: MotionSpan) -> None:
        found = self._agreement(motion)
        self._compare_clocks(motion)
        self._forget_pairs(motion.end_ns + AFTER_NS)
        if found is None:
            return
        self.finished += 1
        self.disagreeing += found.disagrees
        self.last = found
        self._standing = found if found.disagrees else None
        self._news.append(found)

    def _compare_clocks(self, motion: MotionSpan) -> None:
        if len(self._pairs) < TUNING.least_compared:
            return
        if self._origin is None:
            self._origin = motion.start_ns
        stamps, measured, _, estimated, *_ = zip(*self._pairs, strict=True)
        t = (np.array(stamps) - self._origin) / SECOND
        span = (motion.start_ns - self._origin, motion.end_ns + AFTER_NS - self._origin)
        self.clocks.add(
            t, np.array(measured), np.array(estimated), (span[0] / SECOND, span[1] / SECOND)
        )

    def _agreement(self, motion: MotionSpan) -> MotionAgreement | None:
        """Returns the agreement of heights during a motion, or None with too few pairs."""
        until = motion.end_ns + AFTER_NS
        seen = [pair for pair in self._pairs if motion.start_ns <= pair.stamp_ns <= until]
        if not seen:
            return None
        stamps, measured, stddev, estimated, wave, expected, axis = map(
            np.array, zip(*seen, strict=True)
        )
        clean = despike(measured)
        kept = np.isfinite(clean)
        images = int(np.count_nonzero(kept))
        if images < TUNING.least_compared:
            return None
        rms = rms_error(clean, estimated)
        known = stddev[kept & np.isfinite(stddev)]
        noise = float(np.sqrt(np.mean(known**2))) if len(known) else NAN
        peak = float(clean[kept].max())
        # Python's max: a NaN that comes later is passed over.
        explained = max(self._least, TUNING.share_of_peak * peak, TUNING.agreement_noise * noise)
        wave[~kept] = complex(NAN, NAN)
        offset = wave_offset((stamps - motion.start_ns) * 1e-9, wave, expected, axis, noise)
        highest = float(estimated[kept].max())
        return MotionAgreement(*motion, images, rms, noise, peak, explained, highest, offset)
