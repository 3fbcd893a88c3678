"""A replay's report: its series, table and events on one page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slosh_bag.replay_result import ModelAccuracy, ReplayResult
from slosh_discovery.report import Frame, KeyFigure, ModelRow, RunReport, Span, Topic
from slosh_estimator.limits import Event, Kind, Source

NAN = float("nan")
SHOWN = ("3D-L", "3D-NL")
BESIDE = 1.0  # [s]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a page shows beside the replay itself.

    Attributes:
        title, subtitle: headings; an empty title: the replay's name.
        limit: of the height [m]; None: none.
        key_figures: shown after σ and ε.
        frames, topics, model_text, notes: as in RunReport.
    """

    title: str = ""
    subtitle: str = ""
    limit: float | None = None
    key_figures: tuple[KeyFigure, ...] = ()
    frames: tuple[Frame, ...] = ()
    topics: tuple[Topic, ...] = ()
    model_text: str = ""
    notes: tuple[str, ...] = ()


def replay_report(result: ReplayResult, around: Surroundings | None = None) -> RunReport:
    """What the page of a replay shows.

    The charts show the 3D models, from a second before their first estimate to a second after
    their last. Further effects that a model has are part of its name.

    Args:
        result: the replay.
        around: what else the page shows.
    """
    around = around or Surroundings()
    linear, nonlinear = (_row(result, name) for name in SHOWN)
    shown = _shown(result)
    t = result.t[shown]
    start = float(t[0]) if len(t) else 0.0
    spans = event_spans(result.events, start)
    return RunReport(
        title=around.title or result.name,
        subtitle=around.subtitle,
        t=t - start,
        measured=result.measured[shown],
        linear=result.heights[linear.name][shown],
        nonlinear=result.heights[nonlinear.name][shown],
        linear_name=linear.name,
        nonlinear_name=nonlinear.name,
        limit=around.limit,
        key_figures=(*_key_figures(linear, nonlinear, len(spans)), *around.key_figures),
        events=spans,
        models=tuple(_model_row(row) for row in result.accuracy),
        frames=around.frames,
        topics=around.topics,
        model_text=around.model_text,
        notes=(*around.notes, *result.warnings),
    )


def event_spans(events: Sequence[Event], start: float) -> tuple[Span, ...]:
    """The excesses, each from its START and, where it came, its END.

    Args:
        events: of the monitor.
        start: the report's zero of time [s].
    """
    spans: dict[int, Span] = {}
    for event in events:
        begin = (event.stamp_ns - event.duration_ns) * 1e-9 - start
        end = event.stamp_ns * 1e-9 - start if event.kind == Kind.END else NAN
        source = Source(event.source).name.lower()
        spans[event.id] = Span(source, begin, end, event.limit, event.peak, event.description)
    return tuple(spans.values())


def _shown(result: ReplayResult) -> slice:
    """The images near estimates: a record may be far longer than its motion."""
    known = [np.flatnonzero(np.isfinite(heights)) for heights in result.heights.values()]
    indices = np.concatenate(known) if known else np.empty(0, dtype=np.int64)
    if len(indices) == 0:
        return slice(None)
    first, last = result.t[indices.min()] - BESIDE, result.t[indices.max()] + BESIDE
    return slice(*np.searchsorted(result.t, (first, last)).tolist())


def _row(result: ReplayResult, name: str) -> ModelAccuracy:
    return next(row for row in result.accuracy if row.name.split("+")[0] == name)


def _model_row(row: ModelAccuracy) -> ModelRow:
    offset = NAN if row.clock is None else row.clock.offset
    return ModelRow(row.name, row.sigma, row.epsilon, row.rms, offset, row.count)


def _key_figures(
    linear: ModelAccuracy, nonlinear: ModelAccuracy, excesses: int
) -> tuple[KeyFigure, ...]:
    def percent(row: ModelAccuracy) -> str:
        return f"{100.0 * row.epsilon:+.1f}".replace("-", "−")

    return (
        KeyFigure(
            f"σ {nonlinear.name}",
            f"{1e3 * nonlinear.sigma:.2f}",
            "mm",
            f"{linear.name}: {1e3 * linear.sigma:.2f} mm",
        ),
        KeyFigure(
            f"ε {nonlinear.name}",
            percent(nonlinear),
            "%",
            f"{linear.name}: {percent(linear)} %",
        ),
        KeyFigure("limit events", str(excesses)),
    )
