"""Extracts the results for a validation report from a recording and its replay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slosh_base.types import Array, Integers
from slosh_camera.measurement import Flag
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import HEIGHT_LIMITS, MonitorSettings
from slosh_estimator.sight import SATURATED
from slosh_fleet.validation.content import LimitInForce, Peak, Recording
from slosh_fleet.validation.criteria import COVERAGE, NAN, Evidence
from slosh_motion.recorded.inputs import STAMP, stamps_of
from slosh_motion.recorded.settings import latest
from slosh_motion.recorded.sources import SURFACE, CellTopics, event_lines, lost_messages
from slosh_msgs_py import topics
from slosh_replay.in_force import parameter_changes
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay.checking import dropped, is_reproduced
from slosh_replay.replay.report import highest, recorded_at, report_start, shown_models
from slosh_replay.replay.result import MotionAccuracy, ReplayResult
from slosh_replay.replay.verification import Verification
from slosh_report.page.series import gaps, united
from slosh_report.run_report import RunReport

_QUANTITIES = {
    Source.MEASURED: "measured height",
    Source.ESTIMATED: "estimated height",
    Source.DISAGREEMENT: "difference of measured and estimated height",
}


class Noise(NamedTuple):
    """Standard deviations of the measured heights, as published by the camera node.

    Attributes:
        stamps: (N,) of the images, rising [ns].
        stddev: (N,) [m]; NaN: unknown.
        heights: (N,) as the camera gave them [m]; NaN: none.
        further: standard uncertainty of the measurement beside them [m].
    """

    stamps: Integers
    stddev: Array
    heights: Array
    further: float

    @property
    def mean(self) -> float:
        """Mean standard uncertainty of a measured height [m], or NaN if it is unknown."""
        known = self.stddev[np.isfinite(self.stddev)]
        own = float(known.mean()) if len(known) else NAN
        return self._with_further(own)

    def expanded(self, stamp_ns: int) -> float:
        """Returns the expanded uncertainty of one image's height [m], or NaN if it is unknown."""
        place = int(np.searchsorted(self.stamps, stamp_ns))
        there = place < len(self.stamps) and self.stamps[place] == stamp_ns
        own = float(self.stddev[place]) if there else NAN
        return COVERAGE * self._with_further(own)

    def _with_further(self, own: float) -> float:
        if math.isnan(own):
            return self.further if self.further > 0.0 else NAN
        return math.hypot(own, self.further)


def read_noise(run: RecordedRun, cell: str | None, further: float) -> Noise:
    """Reads the standard deviations of the measured heights from a recording.

    Args:
        run: the recording.
        cell: namespace of its topics; None: the only or first cell.
        further: standard uncertainty of the measurement beside them [m].

    Raises:
        SloshBagError: the bag cannot be read.
    """
    topic = CellTopics(run.reader, cell).topic(topics.FREE_SURFACE, SURFACE)
    blocks = [] if topic is None else list(run.reader.look_up([topic]))
    parts = [run.reader.columns(block, (*STAMP, "msh", "msh_stddev")) for block in blocks]
    if not parts:
        return Noise(np.empty(0, np.int64), np.empty(0), np.empty(0), further)
    stamps, first = np.unique(
        np.concatenate([stamps_of(part) for part in parts]), return_index=True
    )
    stddev, heights = (
        np.concatenate([part[name] for part in parts])[first] for name in ("msh_stddev", "msh")
    )
    return Noise(stamps, stddev, heights, further)


def evidence_of(
    run: RecordedRun, result: ReplayResult, report: RunReport, noise: Noise, *, same_model: bool
) -> Evidence:
    """Returns a recording's results, and the reasons why they may not be conclusive.

    Args:
        run: the recording.
        result: its replay.
        report: what the page of the replay shows.
        noise: of the measurement.
        same_model: whether it was replayed with the model of the recorded estimates.
    """
    found = result.verification if same_model else None
    spans = gaps(report.t, report.measured)
    recording = Recording(
        name=result.name,
        recorded=recorded_at(result) if len(result.stamps) else "unknown: no image",
        duration=result.seconds,
        images=result.counters.get("images", 0),
        samples=result.counters["samples_used"],
        lost=sum(lost_messages(run.facts).values()),
        dropped=dropped(result),
        gaps=spans,
        flags=_flags(result),
        peak=_peak(result, noise, -math.inf, math.inf),
        estimated_peak=highest(result.heights[shown_models(result)[1]]),
        models=report.models,
        motions=report.motions,
        events=report.events,
        motion_peaks=tuple(_motion_peak(result, noise, motion) for motion in result.motions),
        reproduced=_reproduced(found),
        estimates=found.recorded + found.missing if found else 0,
        warnings=result.warnings,
    )  # fmt: skip
    limits = [one.limits[Source.MEASURED] for one in watched(result)]
    known = [limit for limit in limits if math.isfinite(limit)]
    # A long recording's series hold its extremes alone, which may hide a gap.
    seconds = (noise.stamps - report_start(result)) * 1e-9
    every = (*spans, *gaps(np.asarray(seconds, dtype=np.float64), noise.heights))
    doubt = _doubt(run, result, recording, every)
    return Evidence(recording, min(known, default=NAN), noise.mean, doubt)


def watched(result: ReplayResult) -> Sequence[MonitorSettings]:
    """Returns the monitor's settings at the start of a recording and after each change."""
    first = [result.limits] if result.limits else []
    return [*first, *(settings for _, settings in result.limit_changes)]


def limits_of(run: RecordedRun, result: ReplayResult) -> tuple[LimitInForce, ...]:
    """Returns the limits that the monitor applied to heights in a recording, and their sources."""
    told = latest(run.starts, "monitor") is not None
    names = dict(zip((Source.MEASURED, Source.ESTIMATED), HEIGHT_LIMITS, strict=True))
    rows: dict[LimitInForce, None] = {}
    for settings in watched(result):
        for source, limit in settings.limits.items():
            if not math.isfinite(limit):
                continue
            name = names.get(source, "disagreement_limit")
            origin = f"recorded parameter {name} of the monitor"
            if settings.at_rim(source):
                origin = f"{settings.limit_name(source)} of the container"
            elif not told:
                origin = "the recording holds no settings of a monitor"
            rows[LimitInForce(result.name, _QUANTITIES[source], limit, origin)] = None
    return tuple(rows)


def deviations_of(run: RecordedRun, result: ReplayResult) -> tuple[str, ...]:
    """Returns warnings, events and parameter changes of a recording, one line each."""
    start = report_start(result)
    lines = (*result.warnings, *event_lines(run.facts, start), *parameter_changes(run, start))
    return tuple(dict.fromkeys(_named(line, run, result.name) for line in lines))


def _named(line: str, run: RecordedRun, name: str) -> str:
    """Replaces a recording's path at the beginning of a line by the recording's name."""
    return f"{name}: {line.removeprefix(f'{run.path}: ')}"


def _peak(result: ReplayResult, noise: Noise, start: float, end: float) -> Peak:
    """Returns the greatest measured height between two times of the measurement [s]."""
    t = result.t
    inside = np.flatnonzero((t >= start) & (t <= end) & np.isfinite(result.measured))
    if not len(inside):
        return Peak()
    at = int(inside[np.argmax(result.measured[inside])])
    bound = bool((result.flags[inside] & SATURATED).any()) if len(result.flags) else False
    return Peak(float(result.measured[at]), noise.expanded(int(result.stamps[at])), bound)


def _motion_peak(result: ReplayResult, noise: Noise, motion: MotionAccuracy) -> Peak:
    """Returns a motion's greatest height as in the replay report, which ignores single spikes."""
    at = np.flatnonzero((result.measured == motion.peak) & (result.t >= motion.start))
    uncertainty = noise.expanded(int(result.stamps[at[0]])) if len(at) else NAN
    whole = _peak(result, noise, motion.start, motion.end)
    return Peak(motion.peak, uncertainty, whole.is_bound)


def _reproduced(found: Verification | None) -> int:
    """Returns the number of recorded estimates that the replay reproduced."""
    if found is None:
        return 0
    return found.recorded + found.missing if is_reproduced(found) else found.identical


def _flags(result: ReplayResult) -> tuple[tuple[str, int], ...]:
    counts = {flag.name or "": int(np.count_nonzero(result.flags & int(flag))) for flag in Flag}
    return tuple((name, count) for name, count in counts.items() if count)


def _doubt(
    run: RecordedRun,
    result: ReplayResult,
    recording: Recording,
    spans: Sequence[tuple[float, float]],
) -> str:
    """Returns why a recording cannot prove that a limit was not exceeded; empty if it can."""
    if result.limits is not None and not result.limits.camera:
        return "the cell had no camera: nothing was measured"
    if math.isnan(recording.peak.height):
        return "nothing was measured"
    if run.reader.warnings:
        return "the recording is incomplete: the rest may have been higher"
    if event_lines(run.facts, 0):
        return "the recording holds only the time around an event"
    if not recording.motions:
        return "no motion was found in the recording"
    for motion in recording.motions:
        # What both series show is one gap.
        missed = sum(
            max(0.0, min(end, motion.end) - max(start, motion.start))
            for start, end in united(spans, 0.0)
        )
        if missed > 0.0:
            return f"nothing was measured for {missed:.2f} s of motion {motion.name}"
    return ""
