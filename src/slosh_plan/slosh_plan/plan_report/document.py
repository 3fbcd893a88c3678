"""A plan as a document: page and `plan.json`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_plan.plan_report.comparison import PlanReport, ShownMotion
from slosh_plan.plan_report.words import plan_facts
from slosh_plan.planning.tolerance import ERRORS, USUAL
from slosh_report.document import (
    Chart,
    Column,
    Document,
    Figure,
    Group,
    KeyFigure,
    KeyFigures,
    Line,
    Lines,
    Notice,
    Paragraph,
    Section,
    explain,
    numbers,
    table,
)
from slosh_report.json_values import plain
from slosh_report.page.svg import INK, LIMIT, LOW, LOW_NARROW, NARROW, NONLINEAR, SPAN, WIDE
from slosh_report.texts import Mark, Place, Text, words

SCHEMA = 1
SQUARE = (4.6, 3.4)
AFTER_SHARE = 0.4
"""Of the longest motion shown, that is seen after its end."""
LONGER = 2.5
"""A proposal that takes so many times as long as the scaled law is not drawn over time."""
HEADROOM, ALONE = 1.3, 1.6
"""What exceeds a limit by more leaves the chart; and without a limit."""
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


def plan_document(report: PlanReport) -> Document:
    """Returns a plan as a document; equal plans give equal documents.

    Its data are the content of `plan.json`; further keys may come within one `schema`.
    """
    data = Place(plain(_data(report)))
    own, limits = data["motions"][len(report.motions) - 1], data["limits"]
    title = (
        own.number("duration", "s"), " s along ", data["path"].number("length", "m"),
        " m, the liquid up to ", own.number("peak", "mm"), " of ",
        limits.number("height", "mm"), " mm",
    )  # fmt: skip
    return Document(
        words(title),
        (
            Paragraph(report.subtitle, "subtitle"),
            _notice(data, own),
            _figures(data, own, limits),
            Lines(report.remarks, kind="notes"),
        ),
        (
            Section("Before and after", _compared(report, data), "compared"),
            Section("Over time", _over_time(report), "heights"),
            Section("Path", _path(report, data), "path"),
        ),
        data.data,
    )


def _data(report: PlanReport) -> dict[str, Any]:
    """Returns what `plan.json` holds, in SI units."""
    plan, upper = report.plan, report.upper
    return plan_facts(plan, report.borne) | {
        "schema": SCHEMA,
        "model": report.model,
        "law": plan.law,
        "limits": plan.limits,
        "upper": None if upper is None else upper[0],
        "residual_upper": None if upper is None else upper[1],
        "motions": [_motion(report, motion) for motion in report.motions],
        "path": {
            "length": plan.path.length,
            "stops": len(plan.path.legs) - 1,
            "departure": plan.path.departure,
            "waypoints": len(report.waypoints),
        },
        "notes": report.remarks,
    }


def _motion(report: PlanReport, motion: ShownMotion) -> dict[str, Any]:
    found = motion.found
    excess = found.excess(report.plan.limits)
    return {
        "title": motion.title,
        "duration": found.motion.duration,
        "speed": float(found.motion.speed.max()),
        "peak": found.peak,
        "residual": found.residual,
        "acceleration": found.acceleration,
        "jerk": found.jerk,
        "exceeds": [name for name, share in excess.items() if share > 1e-9],
    }


def _notice(data: Place, own: Place) -> Notice:
    limits = data.data["limits"]
    ends = ((data.data["upper"], "height"), (data.data["residual_upper"], "residual"))
    if any(end is not None and end > limits[name] for end, name in ends):
        text: Text = (
            "The motion keeps every limit according to the nominal model; with the errors of the "
            "model’s parameters the liquid may rise ", data.number("upper", "mm"),
            " mm, after the end ", data.number("residual_upper", "mm"), " mm (95 %).",
        )  # fmt: skip
        return Notice("warning", "! The interval exceeds a limit", (text,))
    if own.data["exceeds"]:
        return Notice("failed", "✗ A limit is exceeded")
    text = (f"Simulated with the whole model ({data.data['model']}) at 1 kHz.",)
    return Notice("passed", "✓ Keeps every limit", (text,))


def _figures(data: Place, own: Place, limits: Place) -> KeyFigures:
    height = (
        "of ", limits.number("height", "mm"), " mm, margin ", data.number("margin", "mm"), " mm",
    )  # fmt: skip
    figures = [
        KeyFigure("duration", own.number("duration", "s", 3), "s", data.data["law"]),
        KeyFigure("height", own.number("peak", "mm"), "mm", height),
    ]
    for label, key, unit in (
        ("after the end", "residual", "mm"),
        ("acceleration", "acceleration", "m/s²"),
        ("jerk", "jerk", "m/s³"),
    ):
        most = ("of ", limits.number(key, unit), f" {unit}")
        figures.append(KeyFigure(label, own.number(key, unit), unit, most))
    if data.data["frequency_tolerance"] == 0.0:
        bears = f"already {100.0 * ERRORS[0]:g} % exceeds a limit; "
    else:
        bears = "up to which the limits hold; "
    bears += f"{100.0 * USUAL:g} % off: "
    note = (
        bears, data.number("peak_at_one_percent", "mm"), " mm, after the end ",
        data.number("residual_at_one_percent", "mm"), " mm",
    )  # fmt: skip
    tolerance = data.number("frequency_tolerance", "% of", 1)
    return KeyFigures((*figures, KeyFigure("frequency tolerance", tolerance, "%", note)))


def _compared(report: PlanReport, data: Place) -> tuple[Any, ...]:
    def limited(head: str, key: str, unit: str, name: str = "") -> Column:
        def cell(row: Place) -> Text:
            number = row.number(key, unit)
            return Mark(number, "failed") if (name or key) in row.data["exceeds"] else number

        return Column(head, cell, "n")

    columns = (
        Column("motion", lambda row: row.data["title"], "name"),
        numbers("duration [s]", "duration", "s", 3),
        limited("height [mm]", "peak", "mm", "height"),
        limited("after the end [mm]", "residual", "mm"),
        numbers("speed [m/s]", "speed", "m/s"),
        limited("acceleration [m/s²]", "acceleration", "m/s²"),
        limited("jerk [m/s³]", "jerk", "m/s³"),
    )
    marks = (*[""] * (len(report.motions) - 1), "won")
    left_out = len(drawn(report)) < len(report.motions)
    return (
        table("Results of each motion", columns, data["motions"], marks=marks, seen=False),
        explain(
            "Red: a limit is exceeded. All motions are simulated from a liquid at rest. "
            + "The waypoints’ own times take too long to be drawn with the others. " * left_out
            + "Lines that leave a chart continue above it."
        ),
    )


def drawn(report: PlanReport) -> list[ShownMotion]:
    """Returns the motions to draw over time, without those much longer than the planned one."""
    longest = LONGER * report.plan.scaled.found.motion.duration
    return [one for one in report.motions if one.found.motion.duration <= longest]


def _over_time(report: PlanReport) -> tuple[Any, ...]:
    """Returns charts of height, speed, acceleration and jerk over the same time axis."""
    shown, limits = drawn(report), report.plan.limits
    longest = max(one.found.motion.duration for one in shown)
    end = report.planned.found.motion.duration
    after = min(AFTER_SHARE * longest, report.planned.times[-1] - end)

    def chart(
        name: str, title: str, label: str, of: Callable[[ShownMotion], tuple[Array, Array]],
        limit: float | None = None, **more: Any,
    ) -> Figure:  # fmt: skip
        lines = tuple(Line(one.title, one.kind, *of(one)) for one in shown)
        scale = more.get("scale", 1.0)
        top = scale * float(np.max(lines[-1].values))
        level = None if limit is None else scale * limit
        given = {
            "draw": None if level is None else partial(_draw_level, level=level),
            "top": ALONE * top if level is None else HEADROOM * max(level, top),
            "keys": () if level is None else (Mark("limit", "key limit"),),
            "scale": scale,
            "sizes": (LOW, LOW_NARROW),
        }
        seen = f"Line chart of {title} over time"
        ends = (-0.01 * longest, longest + after)
        given |= more
        return Figure((Chart(name, Mark(title, "b"), seen, lines, label, ends=ends, **given),))

    band = report.band
    keys = (
        Mark("limit", "key limit"),
        *[Mark("its 95 % interval", "key span")] * (band is not None),
    )
    return (
        chart(
            "height", "height at the wall", "height [mm]", lambda one: (one.times, one.found.msh),
            limits.height, scale=1e3, sizes=(WIDE, NARROW), keys=keys,
            draw=partial(_draw_heights, report=report),
        ),
        chart("speed", "speed", "speed [m/s]",
              lambda one: (one.found.motion.t, one.found.motion.speed)),
        chart("acceleration", "acceleration", "‖a‖ [m/s²]",
              lambda one: (one.found.motion.t, one.acceleration), limits.acceleration),
        chart("jerk", "jerk", "‖jerk‖ [m/s³]",
              lambda one: (one.found.motion.t[1:], one.jerk), limits.jerk),
        explain(
            "At the end of the planned motion the height limit changes to the limit of the "
            "residual wave."
            + " The model has no covariance of its parameters: no interval." * (band is None)
        ),
    )  # fmt: skip


def _draw_level(axes: Any, *, level: float) -> None:
    axes.axhline(level, color=LIMIT, linewidth=1.4, linestyle=":")


def _draw_heights(axes: Any, *, report: PlanReport) -> None:
    """Draws the limits of the height, and the band of the planned motion's heights."""
    limits, planned = report.plan.limits, report.planned
    end, last = planned.found.motion.duration, axes.get_xlim()[1]
    heights = 1e3 * np.array([limits.height, limits.height, limits.residual, limits.residual])
    axes.plot([0.0, end, end, last], heights, color=LIMIT, linewidth=1.4, linestyle=":")
    if report.band is not None:
        axes.fill_between(planned.times, *(1e3 * report.band), color=SPAN, linewidth=0.0)


def _path(report: PlanReport, data: Place) -> tuple[Any, ...]:
    spans = np.ptp(report.planned.found.motion.position, axis=0)
    along = 0 if spans[0] >= spans[1] else 1
    views = [("above", "from above", (0, 1)), ("side", "from the side", (along, 2))]
    if spans[2] < FLAT:
        views = views[:1]
    elif spans[:2].max() < FLAT:
        views = views[1:]
    tick = tick_spacing(report.planned.found.motion.duration)
    keys: Sequence[Text] = [Mark(f"every {tick} s", "key dot own")]
    if len(report.waypoints) <= MOST_RINGS:
        keys = [Mark("waypoint", "key ring"), *keys]
    charts = tuple(
        Figure((
            Chart(name, Mark(title, "b"), f"The path {title}", keys=tuple(keys), sizes=(SQUARE,),
                  draw=partial(_draw_path, report=report, shown=axes)),
        ))
        for name, title, axes in views
    )  # fmt: skip
    path = data["path"]
    stops = path.data["stops"]
    return (
        Group(charts, "small-charts"),
        explain(
            path.number("length", "m"), " m through ", path.number("waypoints"), " waypoints, ",
            path.number("stops"), f" {'stop' if stops == 1 else 'stops'}, up to ",
            path.number("departure", "mm"), " mm from straight lines between them. Planned in ",
            data.number("seconds", "s", 1), " s.",
        ),
    )  # fmt: skip


def tick_spacing(duration: float) -> float:
    """Returns the time between two dots on the path [s]."""
    fine = [tick for tick in TICKS if duration / tick <= MOST_TICKS]
    return fine[0] if fine else TICKS[-1]


def _draw_path(axes: Any, *, report: PlanReport, shown: tuple[int, int]) -> None:
    """Draws the path along two axes, with waypoints and dots at equal time steps."""
    motion = report.planned.found.motion
    x, y = (1e3 * motion.position[:, axis] for axis in shown)
    dots = slice(None, None, round(tick_spacing(motion.duration) * 1000))
    axes.figure.subplots_adjust(left=WIDE_LABELS / SQUARE[0])
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    if len(report.waypoints) <= MOST_RINGS:
        rings = 1e3 * report.waypoints[:, shown].T
        axes.plot(*rings, "o", color=INK, markersize=7.0, markerfacecolor="none")
    axes.plot(x, y, color=NONLINEAR, linewidth=1.3)
    axes.plot(x[dots], y[dots], "o", color=NONLINEAR, markersize=DOT)
    axes.annotate("start", (x[0], y[0]), xytext=(6, 6), textcoords="offset points", color=INK)
    axes.set_xlabel(f"{'xyz'[shown[0]]} [mm]")
    axes.set_ylabel(f"{'xyz'[shown[1]]} [mm]")
