"""Creates the report of a replay: series, tables, checks and events on one page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from slosh_base.types import Array
from slosh_estimator.limits import Event, Kind, Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.sight import SATURATED
from slosh_model.effects.registry import EFFECTS
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_replay.replay import verification
from slosh_replay.replay.checking import CheckedReplay, dropped
from slosh_replay.replay.result import ModelAccuracy, ReplayResult
from slosh_report.run_report import (
    AzimuthSeries,
    DifferenceRow,
    ExcessSpan,
    Fact,
    Frame,
    KeyFigure,
    ModelRow,
    RunMotion,
    RunReport,
    RunVerdict,
    Status,
    TopicRow,
    VerificationRow,
)

NAN = float("nan")
BESIDE = 1.0  # [s]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Content of a replay's page besides the replay: title, images, topics, notes.

    Attributes:
        title, subtitle: headings; an empty title: the replay's name.
        key_figures: shown after MAE and ε.
        facts, frames, topics, notes: as in RunReport.
        checked: the replay against its manifest; None: nothing was expected.
    """

    title: str = ""
    subtitle: str = ""
    key_figures: tuple[KeyFigure, ...] = ()
    facts: tuple[Fact, ...] = ()
    frames: tuple[Frame, ...] = ()
    topics: tuple[TopicRow, ...] = ()
    notes: tuple[str, ...] = ()
    checked: CheckedReplay | None = None


def replay_report(result: ReplayResult, around: Surroundings | None = None) -> RunReport:
    """Creates the content of the HTML page about a replay.

    The charts show the loaded model's L and NL twin, from a second before their first estimate to
    a second after their last. Further effects that a model has are part of its name.

    Args:
        result: the replay.
        around: what else the page shows.
    """
    around = around or Surroundings()
    linear, nonlinear = shown_models(result)
    shown = _shown(result)
    start = report_start(result)
    t = np.asarray((result.stamps[shown] - start) * 1e-9, dtype=np.float64)
    spans = event_spans(result.events, start)
    limit, limit_name = _lasting_limit(result, start)
    return RunReport(
        title=around.title or result.name,
        subtitle=around.subtitle or f"replay, driven by {result.source}",
        t=t,
        measured=result.measured[shown],
        linear=result.heights[linear][shown],
        nonlinear=result.heights[nonlinear][shown],
        linear_name=linear,
        nonlinear_name=nonlinear,
        limit=limit if np.isfinite(limit) else None,
        limit_name=limit_name,
        key_figures=(*_key_figures(result, linear, nonlinear, spans), *around.key_figures),
        facts=around.facts,
        events=spans,
        models=tuple(_model_row(row) for row in result.accuracy),
        motions=_motions(result, start),
        frames=around.frames,
        topics=around.topics,
        model_text=format_model(result.model) if result.model else "",
        effects=_meanings(result.model) if result.model else {},
        notes=around.notes,
        warnings=result.warnings,
        status=_status(result, around.checked),
        checks=around.checked.checks if around.checked else (),
        verifications=tuple(_verifications(result, start)),
        measured_azimuth=_azimuth("measured", t, result.azimuth, result.measured, shown),
        estimated_azimuth=_azimuth(
            nonlinear, t, result.model_azimuth, result.heights[nonlinear], shown
        ),
        saturated=(result.flags[shown] & SATURATED) != 0 if len(result.flags) else None,
    )


def _lasting_limit(result: ReplayResult, start: int) -> tuple[float, str]:
    """Returns the height limit [m] to draw in the chart and its name; NaN if the limit changed.

    Without a camera it is that of the estimate.

    What changed before the page's zero of time never held on it: so a monitor learns of the rim.
    """
    watched = [result.limits] if result.limits else []
    for since, settings in result.limit_changes:
        watched = [*(watched if since > start else ()), settings]
    limits = {_charted_limit(settings) for settings in watched}
    return limits.pop() if len(limits) == 1 else (NAN, "limit")


def _charted_limit(settings: MonitorSettings) -> tuple[float, str]:
    source = Source.MEASURED if settings.camera else Source.ESTIMATED
    return settings.limits[source], settings.limit_name(source)


def _meanings(model: Model) -> dict[str, str]:
    """Returns the meanings of a model's effects by name."""
    return {use.name: EFFECTS[use.name].meaning for use in model.effects}


def report_start(result: ReplayResult) -> int:
    """Returns the stamp of time zero on the report's page, on the measurement's clock [ns]."""
    stamps = result.stamps[_shown(result)]
    if len(stamps):
        return int(stamps[0])
    return result.events[0].stamp_ns if result.events else 0


def recorded_at(result: ReplayResult) -> str:
    """Returns the date and time (UTC) of time zero of the report's page, as text."""
    start = datetime.fromtimestamp(1e-9 * report_start(result), UTC)
    return f"{start:%Y-%m-%d %H:%M:%S} UTC"


def highest(heights: Array) -> float:
    """Returns the greatest of the known heights [m], or NaN if none is known."""
    known = heights[np.isfinite(heights)]
    return float(known.max()) if len(known) else NAN


def shown_models(result: ReplayResult) -> tuple[str, str]:
    """Returns the names of the linear and the nonlinear model that a replay's page shows.

    The same name twice where its container has a linear model alone.
    """
    names = list(result.heights)
    spatial = int(result.model is None or result.model.has("vertical_acceleration"))
    half = len(names) // 2 if len(names) > 2 else 0
    return names[spatial], names[spatial + half]


def event_spans(events: Sequence[Event], start: int) -> tuple[ExcessSpan, ...]:
    """Returns the time spans of limit violations.

    Args:
        events: of the monitor.
        start: the report's zero of time [ns].
    """
    spans: dict[int, ExcessSpan] = {}
    for event in events:
        begin = (event.stamp_ns - event.duration_ns - start) * 1e-9
        end = (event.stamp_ns - start) * 1e-9 if event.kind == Kind.END else NAN
        spans[event.id] = ExcessSpan(
            Source(event.source).name.lower(), begin, end, event.limit, event.peak,
            event.description, (event.peak_stamp_ns - start) * 1e-9,
        )  # fmt: skip
    return tuple(spans.values())


def _shown(result: ReplayResult) -> slice:
    """Returns the index range of images close in time to estimates, to be shown in the charts."""
    known = [np.flatnonzero(np.isfinite(heights)) for heights in result.heights.values()]
    indices = np.concatenate(known) if known else np.empty(0, dtype=np.int64)
    if len(indices) == 0:
        return slice(None)
    first, last = result.t[indices.min()] - BESIDE, result.t[indices.max()] + BESIDE
    return slice(*np.searchsorted(result.t, (first, last)).tolist())


def _status(result: ReplayResult, checked: CheckedReplay | None) -> Status:
    if checked is not None:
        verdict = RunVerdict.PASSED if checked.passed else RunVerdict.FAILED
        return Status(verdict, checked.failures)
    found = result.verification
    if found is None or not found.recorded + found.missing:
        return Status()
    return Status(RunVerdict.NO_EXPECTATION, () if found.exact else found.lines())


def _verifications(result: ReplayResult, start: int) -> list[VerificationRow]:
    return [
        VerificationRow(
            f"recorded {name}s, bit for bit",
            found.identical,
            found.recorded + found.missing,
            _differences(found, start),
        )
        for name, found in result.verified.items()
        if found.recorded + found.missing
    ]


def _differences(found: verification.Verification, start: int) -> tuple[DifferenceRow, ...]:
    first = found.first
    rows = []
    for field, largest in sorted(found.largest.items(), key=lambda item: -item[1]):
        leads = first is not None and first.field == field
        rows.append(
            DifferenceRow(
                found.topic,
                field,
                found.counts[field],
                (first.stamp_ns - start) * 1e-9 if leads and first else NAN,
                largest,
                first.recorded if leads and first else NAN,
                first.replayed if leads and first else NAN,
            )
        )
    return tuple(rows)


def _motions(result: ReplayResult, start: int) -> tuple[RunMotion, ...]:
    return tuple(
        RunMotion(
            str(number),
            motion.start - 1e-9 * start,
            motion.end - 1e-9 * start,
            motion.peak,
            tuple(_model_row(row) for row in motion.models),
        )
        for number, motion in enumerate(result.motions, start=1)
    )


def _azimuth(
    name: str, t: Array, azimuth: Array, height: Array, shown: slice
) -> AzimuthSeries | None:
    if not len(azimuth) or not np.isfinite(azimuth[shown]).any():
        return None
    return AzimuthSeries(name, t, azimuth[shown], height[shown])


def _model_row(row: ModelAccuracy) -> ModelRow:
    offset = NAN if row.clock is None else row.clock.offset
    return ModelRow(row.name, row.sigma, row.epsilon, row.rms, offset, row.count)


def _key_figures(
    result: ReplayResult, linear: str, nonlinear: str, spans: Sequence[ExcessSpan]
) -> tuple[KeyFigure, ...]:
    rows = {row.name: row for row in result.accuracy}
    figures: list[KeyFigure] = []
    measured, estimated = highest(result.measured), highest(result.heights[nonlinear])
    if np.isfinite(measured):
        figures.append(KeyFigure("highest measured", measured, "mm"))
    elif np.isfinite(estimated):
        figures.append(KeyFigure("highest estimated", estimated, "mm", nonlinear))
    if nonlinear in rows and linear in rows:
        l_row, nl_row = rows[linear], rows[nonlinear]
        figures += [
            KeyFigure(
                f"MAE {nonlinear}", nl_row.sigma, "mm", f"{linear}: {1e3 * l_row.sigma:.2f} mm"
            ),
            KeyFigure(
                f"ε {nonlinear}", nl_row.epsilon, "%", f"{linear}: {1e2 * l_row.epsilon:+.1f} %"
            ),
        ]
    return (
        *figures,
        KeyFigure("limit events", float(len(spans)), ""),
        KeyFigure("dropped samples", float(dropped(result)), ""),
    )
