"""Splits a recording into motions that begin with the liquid at rest.

A motion that begins while the liquid still sloshes goes on from a state that only the motion
before it can tell: the two stay one. Where that would join them for minutes, a later part keeps
the inputs before it as a lead-in without heights, through which its state is simulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_discovery.discover_data.heights import Still, find_still, rms_about
from slosh_discovery.discover_data.recording import BagRecording, Heights
from slosh_motion.checks.constancy import BIN_NS
from slosh_motion.recorded.motion import RecordedMotion
from slosh_motion.signals.motion_spans import MotionSpan, motion_spans

Stamps = NDArray[np.int64]

REST_NS = 2 * SECOND
"""Rest that is kept before a motion [ns]: it tells the noise."""
DWELL_NS = 8 * SECOND
"""How long the liquid is followed after a motion [ns]: it tells the damping."""
LOOK_NS = SECOND
"""Heights of this time before a motion tell whether the liquid is at rest [ns]."""
LONG_REST_NS = 60 * SECOND
"""After such a rest the liquid is still, whatever the camera says [ns]."""
LONGEST_NS = 120 * SECOND
"""Joined motions become no longer than this [ns]."""
LEAD_IN_NS = 60 * SECOND
"""Inputs before a part that begins while the liquid sloshes [ns]: in a cup of water less than 1 %
is left of what was there before."""
AT_REST_NOISES = 3.0
"""The liquid is at rest where its height's RMS is below so many of the noise's,"""
AT_REST_SHARE = 0.02
"""or below this share of the recording's peak."""


class Part(NamedTuple):
    """A part of a recording that becomes one measured motion, from a start to an end stamp [ns].

    Attributes:
        start, end: of the inputs.
        heights_start: from where on heights count: later than start where there is a lead-in.
    """

    start: int
    end: int
    heights_start: int


class RecordingParts(NamedTuple):
    """The parts of a recording, and remarks on omitted parts."""

    parts: list[Part]
    notes: list[str]


def split(recording: BagRecording) -> RecordingParts:
    """Splits a recording into parts that each become one measured motion."""
    stamps, rest = recording.motion.stamps, _Rest(recording.heights)
    spans = recorded_spans(recording.motion)
    gaps = _gaps_in_motion(stamps, spans, recording.max_gap_ns)
    notes: list[str] = []
    if spans and rest.sloshes_at_the_start(int(stamps[0]), spans[0]):
        notes.append("the first motion had begun before the recording: it is left out")
        spans = _until_rest(spans, rest)
    chains = _chains(spans, rest)
    parts: list[Part] = []
    for index, chain in enumerate(chains):
        before = parts[-1].end if parts and not chain.joined else int(stamps[0])
        start = max(chain.start - (LEAD_IN_NS if chain.joined else REST_NS), before)
        end = min(chain.end + DWELL_NS, int(stamps[-1]))
        if index + 1 < len(chains):
            end = min(end, max(chains[index + 1].start - REST_NS, chain.end))
        broken = gaps[(gaps >= start) & (gaps < end)]
        if len(broken):
            moment = (broken[0] - stamps[0]) / SECOND
            notes.append(
                f"a gap in the inputs at {moment:.2f} s while the container moves: the rest of "
                "that motion is left out"
            )
            end = int(broken[0])
        parts.append(Part(start, end, chain.start if chain.joined else start))
    return RecordingParts(parts, notes)


def recorded_spans(motion: RecordedMotion) -> list[MotionSpan]:
    """Returns the time spans in which the recorded container moves.

    What is constant, as with a sensor that is mounted askew or has a bias, is no motion.
    """
    turning = motion.angular_velocity
    return motion_spans(
        motion.stamps,
        motion.acceleration - np.median(motion.acceleration, axis=0),
        None if turning is None else turning - np.median(turning, axis=0),
    )


class _Rest:
    """Decides from measured heights whether the liquid is at rest."""

    def __init__(self, heights: Heights) -> None:
        self._heights = heights
        seconds = (heights.stamps - heights.stamps[:1]) / SECOND
        self._still: Still = find_still(seconds, heights.msh)
        raised = heights.msh - self._still.level
        # A robust peak: a single wrong sample must not declare sloshing to be rest.
        peak = float(np.quantile(raised, 0.995)) if len(raised) else 0.0
        self._limit = max(AT_REST_NOISES * self._still.noise, AT_REST_SHARE * peak)

    def sloshes_before(self, stamp_ns: int, last_end_ns: int) -> bool:
        """Returns whether the liquid still moves at a stamp, given the last motion's end [ns]."""
        if stamp_ns - last_end_ns > LONG_REST_NS:
            return False
        look_from = max(stamp_ns - LOOK_NS, last_end_ns)
        rms = rms_about(self._between(look_from, stamp_ns), self._still.level)
        return not rms <= self._limit  # without heights nobody knows

    def sloshes_at_the_start(self, stamp_ns: int, span: MotionSpan) -> bool:
        """Returns whether a recording begins in the middle of a motion."""
        if span.start_ns - stamp_ns > LOOK_NS // 2:
            return False
        first = self._between(span.start_ns, span.start_ns + LOOK_NS // 10)
        rms = rms_about(first, self._still.level)
        return rms > 5.0 * self._limit

    def _between(self, start: int, end: int) -> Array:
        first, last = np.searchsorted(self._heights.stamps, (start, end))
        return self._heights.msh[first:last]


def _until_rest(spans: Sequence[MotionSpan], rest: _Rest) -> list[MotionSpan]:
    """Returns the motions, starting with the first one that begins with liquid at rest."""
    for index in range(1, len(spans)):
        if not rest.sloshes_before(spans[index].start_ns, spans[index - 1].end_ns):
            return list(spans[index:])
    return []


class _Chain(NamedTuple):
    """Successive motions of one part, and whether the liquid still sloshes from motions before."""

    start: int
    end: int
    joined: bool


def _chains(spans: Sequence[MotionSpan], rest: _Rest) -> list[_Chain]:
    chains: list[_Chain] = []
    for span in spans:
        last = chains[-1] if chains else None
        sloshes = last is not None and rest.sloshes_before(span.start_ns, last.end)
        if last is not None and sloshes and span.end_ns - last.start <= LONGEST_NS:
            chains[-1] = last._replace(end=span.end_ns)
        else:
            chains.append(_Chain(span.start_ns, span.end_ns, sloshes))
    return chains


def _gaps_in_motion(stamps: Stamps, spans: Sequence[MotionSpan], max_gap_ns: int) -> Stamps:
    """Returns the start stamps [ns] of gaps in the input during motions."""
    before = np.flatnonzero(np.diff(stamps) > max_gap_ns)
    starts, ends = stamps[before], stamps[before + 1]
    inside = [
        any(s.start_ns - 2 * BIN_NS < end and start < s.end_ns + 2 * BIN_NS for s in spans)
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True)
    ]
    found: Stamps = starts[np.array(inside, dtype=bool)]
    return found
