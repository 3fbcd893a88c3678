"""Draws the charts and fills the HTML template of a plan's page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jinja2 import Template
from markupsafe import Markup

from slosh_base.types import Array
from slosh_plan.plan_report.data import Document, PlanReport, ShownMotion, plan_document
from slosh_report.page.svg import (
    DASHES,
    INK,
    LIMIT,
    LINEAR,
    MEASURED,
    NARROW,
    NONLINEAR,
    SPAN,
    WIDE,
    canvas,
    chart_points,
    draw_line,
    style,
    svg_text,
    time_chart,
)
from slosh_report.page.template import make_environment
from slosh_report.page.units import shown

LOW = (9.6, 2.2)
LOW_NARROW = (4.1, 2.4)
SQUARE = (4.6, 3.4)

Size = tuple[float, float]

AFTER_SHARE = 0.4
"""Of the longest motion shown, that is seen after its end."""
LONGER = 2.5
"""A proposal that takes so many times as long as the scaled law is not drawn over time."""
HEADROOM = 1.3
"""What exceeds a limit by more leaves the chart."""
TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
MOST_TICKS = 40
"""Dots along the path at most."""
MOST_RINGS = 60
"""More waypoints than that are the path itself."""
FLAT = 1e-3
"""A path that rises by less has no view from the side [m]."""
DOT = 3.0
WIDE_LABELS = 0.8
"""Left margin for numbers like −100 [in]."""


@dataclass(frozen=True, slots=True, eq=False)
class ChartSeries:
    """Data of one chart over time: a curve for each motion, and a limit.

    Attributes:
        label: of the axis, with the unit.
        scale: SI → unit.
        lines: (t, values) of each of a report's motions; empty: not drawn.
        limit: dotted line over all of it; None: there is none.
    """

    label: str
    scale: float
    lines: Sequence[tuple[Array, Array]]
    limit: float | None


def drawn(report: PlanReport) -> list[ShownMotion]:
    """Returns the motions to draw over time, without those much longer than the planned one."""
    longest = LONGER * report.scaled.found.motion.duration
    return [one for one in report.motions if one.found.motion.duration <= longest]


def ends(report: PlanReport) -> tuple[float, float]:
    """Returns the start and end [s] of the time axis that all charts share."""
    longest = max(one.found.motion.duration for one in drawn(report))
    after = min(
        AFTER_SHARE * longest, report.planned.times[-1] - report.planned.found.motion.t[-1]
    )
    return -0.01 * longest, longest + after


def speed_series(report: PlanReport) -> ChartSeries:
    """Returns the chart data of the speed along the path."""
    lines = [(one.found.motion.t, one.found.motion.speed) for one in drawn(report)]
    return ChartSeries("speed [m/s]", 1.0, lines, None)


def acceleration_series(report: PlanReport) -> ChartSeries:
    """Returns the chart data of the acceleration ‖a‖ and its limit."""
    lines = [(one.found.motion.t, one.acceleration) for one in drawn(report)]
    return ChartSeries("‖a‖ [m/s²]", 1.0, lines, report.plan.limits.acceleration)


def jerk_series(report: PlanReport) -> ChartSeries:
    """Returns the chart data of the jerk ‖da/dt‖ and its limit."""
    lines = [(one.found.motion.t[1:], one.jerk) for one in drawn(report)]
    return ChartSeries("‖jerk‖ [m/s³]", 1.0, lines, report.plan.limits.jerk)


SERIES = {"speed": speed_series, "acceleration": acceleration_series, "jerk": jerk_series}


def heights_series(report: PlanReport) -> ChartSeries:
    """Returns the chart data of the liquid's height at the wall and of its limit."""
    lines = [(one.times, one.found.msh) for one in drawn(report)]
    return ChartSeries("height [mm]", 1e3, lines, report.plan.limits.height)


def series_chart(report: PlanReport, series: ChartSeries, size: Size, name: str) -> str:
    """Draws a chart over time as SVG; the planned motion is the last line."""

    def draw(axes: Any) -> None:
        if series.limit is not None:
            level = series.scale * series.limit
            axes.axhline(level, color=LIMIT, linewidth=1.4, linestyle=":")
        axes.set_ylim(0.0, series.scale * _top(series))
        for motion, (t, values) in zip(drawn(report), series.lines, strict=True):
            colour, width, dashes = line_style(report, motion)
            draw_line(
                axes, t, values, colour, width, dashes, chart_points(size), scale=series.scale
            )
        axes.set_ylabel(series.label)

    return time_chart(draw, ends(report), size, name)


def heights_chart(report: PlanReport, size: Size, name: str) -> str:
    """Draws heights over time as SVG, with the planned motion's 95 % band and height limits."""
    series, planned = heights_series(report), report.planned

    def draw(axes: Any) -> None:
        end = planned.found.motion.duration
        limits = report.plan.limits
        last = ends(report)[1]
        axes.set_ylim(0.0, 1e3 * _top(series))
        axes.plot([0.0, end], 2 * [1e3 * limits.height], color=LIMIT, linewidth=1.4,
                  linestyle=":")  # fmt: skip
        axes.plot([end, end, last], 1e3 * np.array([limits.height, *2 * [limits.residual]]),
                  color=LIMIT, linewidth=1.4, linestyle=":")  # fmt: skip
        if report.band is not None:
            lower, upper = 1e3 * report.band
            axes.fill_between(planned.times, lower, upper, color=SPAN, linewidth=0.0)
        for motion, (t, values) in zip(drawn(report), series.lines, strict=True):
            colour, width, dashes = line_style(report, motion)
            draw_line(axes, t, values, colour, width, dashes, chart_points(size))
        axes.set_ylabel(series.label)

    return time_chart(draw, ends(report), size, name)


def line_style(report: PlanReport, motion: ShownMotion) -> tuple[str, float, Any]:
    """Returns colour, width and dash style of a motion's lines."""
    if motion is report.planned:
        return NONLINEAR, 1.8, "-"
    if motion is report.proposal:
        return MEASURED, 1.1, "-"
    return LINEAR, 1.3, DASHES


def views(report: PlanReport) -> dict[str, tuple[int, int]]:
    """Returns the views of the path: name, and the two axes that are shown."""
    spans = np.ptp(report.planned.found.motion.position, axis=0)
    along = 0 if spans[0] >= spans[1] else 1
    if spans[2] < FLAT:
        return {"above": (0, 1)}
    if spans[:2].max() < FLAT:
        return {"side": (along, 2)}
    return {"above": (0, 1), "side": (along, 2)}


def tick_spacing(duration: float) -> float:
    """Returns the time between two dots on the path [s]."""
    fine = [tick for tick in TICKS if duration / tick <= MOST_TICKS]
    return fine[0] if fine else TICKS[-1]


def path_chart(report: PlanReport, axes_shown: tuple[int, int], size: Size, name: str) -> str:
    """Draws the path as SVG, with waypoints and dots at equal time steps."""
    motion = report.planned.found.motion
    first, second = axes_shown
    place = 1e3 * motion.position
    spacing = round(tick_spacing(motion.duration) * 1000)
    with style(name):
        figure = canvas(size)
        figure.subplots_adjust(left=WIDE_LABELS / size[0])
        axes = figure.add_subplot()
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        points = 1e3 * report.waypoints
        if len(points) <= MOST_RINGS:
            axes.plot(points[:, first], points[:, second], color=INK, linestyle="none",
                      marker="o", markersize=7.0, markerfacecolor="none")  # fmt: skip
        axes.plot(place[:, first], place[:, second], color=NONLINEAR, linewidth=1.3)
        axes.plot(place[::spacing, first], place[::spacing, second], color=NONLINEAR,
                  linestyle="none", marker="o", markersize=DOT)  # fmt: skip
        axes.annotate("start", (place[0, first], place[0, second]), xytext=(6, 6),
                      textcoords="offset points", color=INK)  # fmt: skip
        axes.set_xlabel(f"{'xyz'[first]} [mm]")
        axes.set_ylabel(f"{'xyz'[second]} [mm]")
        return svg_text(figure, name)


def _top(series: ChartSeries) -> float:
    """Returns the vertical axis' upper end, above both the limit and the planned motion."""
    planned = float(np.max(series.lines[-1][1]))
    if series.limit is not None:
        return HEADROOM * max(series.limit, planned)
    return 1.6 * planned


def render_plan(report: PlanReport) -> str:
    """Renders the HTML page of a plan; every text in it is escaped."""
    document = plan_document(report)
    planned = len(document["motions"]) - 1
    return _template().render(
        report=report,
        doc=document,
        planned=planned,
        drawn=[report.motions.index(one) for one in drawn(report)],
        key_classes=[_key(report, number) for number in range(planned + 1)],
        headline=headline(document),
        over=interval_excess(document),
        views=list(views(report)),
        rings=len(report.waypoints) <= MOST_RINGS,
        tick=tick_spacing(report.planned.found.motion.duration),
        charts={name: Markup(svg) for name, svg in _charts(report).items()},
        seen=seen(document),
    )


def headline(document: Document) -> str:
    """Summarises the plan in one sentence."""
    motion, limits = document["motions"][-1], document["limits"]
    return (
        f"{shown(motion['duration'], 's')} s along {shown(document['path']['length'], 'm')} m, "
        f"the liquid up to {shown(motion['peak'], 'mm')} of {shown(limits['height'], 'mm')} mm"
    )


def interval_excess(document: Document) -> float:
    """Returns by how much the 95 % interval's upper end exceeds a height limit [m], else 0."""
    if document["upper"] is None:
        return 0.0
    limits = document["limits"]
    over = max(
        document["upper"] - limits["height"], document["residual_upper"] - limits["residual"]
    )
    return float(max(over, 0.0))


def seen(document: Document) -> str:
    """Describes the chart of the heights in words, for screen readers."""
    rows = (
        f"{row['title']}: up to {shown(row['peak'], 'mm')} mm, afterwards "
        f"{shown(row['residual'], 'mm')} mm"
        for row in document["motions"]
    )
    return "Line chart of the height over time. " + "; ".join(rows)


def _charts(report: PlanReport) -> dict[str, str]:
    """Returns the charts of a plan's HTML page as SVG, by name."""
    charts = {}
    for width, size, low in (("wide", WIDE, LOW), ("narrow", NARROW, LOW_NARROW)):
        charts[f"height-{width}"] = heights_chart(report, size, f"height-{width}")
        for name, series in SERIES.items():
            key = f"{name}-{width}"
            charts[key] = series_chart(report, series(report), low, key)
    for name, axes in views(report).items():
        charts[name] = path_chart(report, axes, SQUARE, name)
    return charts


def _key(report: PlanReport, number: int) -> str:
    """Returns the CSS class of a motion's legend entry."""
    motion = report.motions[number]
    if motion is report.planned:
        return "nonlinear"
    return "thin" if motion is report.proposal else "linear"


@cache
def _template() -> Template:
    return make_environment("slosh_plan.plan_report").get_template("plan.html.j2")
