"""Fills the page's template."""

from __future__ import annotations

from functools import cache

from jinja2 import Template
from markupsafe import Markup

from slosh_plan.plan_report.charts import (
    MOST_RINGS,
    acceleration_series,
    drawn,
    heights_chart,
    jerk_series,
    path_chart,
    series_chart,
    speed_series,
    tick_spacing,
    views,
)
from slosh_plan.plan_report.data import Document, PlanReport, plan_document
from slosh_report.page.lines import NARROW, WIDE
from slosh_report.page.template import make_environment
from slosh_report.page.units import shown

LOW = (9.6, 2.2)
LOW_NARROW = (4.1, 2.4)
SQUARE = (4.6, 3.4)
SERIES = {"speed": speed_series, "acceleration": acceleration_series, "jerk": jerk_series}


def render_plan(report: PlanReport) -> str:
    """The page as HTML text, the same for the same report; every text in it is escaped."""
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
    """The plan in one sentence."""
    motion, limits = document["motions"][-1], document["limits"]
    return (
        f"{shown(motion['duration'], 's')} s along {shown(document['path']['length'], 'm')} m, "
        f"the liquid up to {shown(motion['peak'], 'mm')} of {shown(limits['height'], 'mm')} mm"
    )


def interval_excess(document: Document) -> float:
    """By how much the upper end of the heights' interval exceeds a limit [m]; 0: not."""
    if document["upper"] is None:
        return 0.0
    limits = document["limits"]
    over = max(
        document["upper"] - limits["height"], document["residual_upper"] - limits["residual"]
    )
    return float(max(over, 0.0))


def seen(document: Document) -> str:
    """What the chart of the heights shows, in words, for those who do not see it."""
    rows = (
        f"{row['title']}: up to {shown(row['peak'], 'mm')} mm, afterwards "
        f"{shown(row['residual'], 'mm')} mm"
        for row in document["motions"]
    )
    return "Line chart of the height over time. " + "; ".join(rows)


def _charts(report: PlanReport) -> dict[str, str]:
    """SVG text by name."""
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
    """Class of a motion's key below a chart."""
    motion = report.motions[number]
    if motion is report.planned:
        return "nonlinear"
    return "thin" if motion is report.proposal else "linear"


@cache
def _template() -> Template:
    return make_environment("slosh_plan.plan_report").get_template("plan.html.j2")
