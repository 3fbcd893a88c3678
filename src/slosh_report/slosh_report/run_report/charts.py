"""Charts over time: liquid heights, residuals and single motions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_report.document import Chart, Figure, Line
from slosh_report.page.series import POINTS, gaps, highest, time_ends, united
from slosh_report.page.svg import CARD, GAP, INK, LIMIT, MEASURED, SMALL, SPAN, badge
from slosh_report.page.units import shown
from slosh_report.run_report.data import RunReport
from slosh_report.run_report.rows import RunMotion
from slosh_report.texts import Mark, Place, Text, words

Spans = Iterable[tuple[float, float]]

NUMBERS = 25
"""Motions that are numbered in a chart; more numbers would lie over each other."""
MARKS = 60
"""Lower bounds that are marked; more of them would be a bar."""


CLOSE_UPS = 6
"""Most motions that are drawn on their own."""


def run_figures(report: RunReport, data: Place) -> tuple[Figure, ...]:
    """Returns measured, linear and nonlinear model's heights over time, and their differences.

    Empty: no height is known.
    """
    lines = _lines(report)
    if not any(bool(np.isfinite(line.values).any()) for line in lines):
        return ()
    ends, names = time_ends(report.t), (report.linear_name, report.nonlinear_name)
    heights = heights_chart(report, "heights", keys=_keys(report, data), seen=_seen(report),
                            live=True, limit=report.limit)  # fmt: skip
    differences = tuple(
        Line(f"measured − {name}", kind, report.t, residual(report, values))
        for name, kind, values in zip(
            names, ("linear", "nonlinear"), (report.linear, report.nonlinear), strict=True
        )
    )
    seen = (
        "Line chart of measured minus estimated height over time; see the table under Agreement "
        "for a summary."
    )
    missed = Chart(
        "residual", Mark("What the models miss", "b"), seen, differences, "measured − model [mm]",
        draw=partial(_backdrop, report=report), ends=ends, live=True,
    )  # fmt: skip
    return Figure((heights,)), Figure((missed,))


def heights_chart(
    report: RunReport,
    name: str,
    caption: Text = "",
    *,
    names: Sequence[Text] = (),
    seen: str = "",
    **more: Any,
) -> Chart:
    """Returns the chart of a run's heights.

    Args:
        report: the run.
        name: of the chart.
        caption: before the legend.
        names: of the lines; empty: "measured" and the models'.
        seen: what it shows, for screen readers; empty: the caption.
        more: attributes of the chart.
    """
    lines = _lines(report)
    if names:
        lines = tuple(replace(line, name=one) for line, one in zip(lines, names, strict=True))
    return Chart(
        name, caption, seen or words(caption), lines, "height above rest [mm]",
        draw=partial(_draw_run, report=report), ends=time_ends(report.t), **more,
    )  # fmt: skip


def motion_figures(report: RunReport) -> tuple[Figure, ...]:
    """Returns charts of the motions with the largest model errors, in order of time."""
    motions = report.motions
    if len(motions) < 2 or not any(np.isfinite(line.values).any() for line in _lines(report)):
        return ()
    worst = sorted(range(len(motions)), key=lambda index: -_worst_sigma(report, index))
    chosen = sorted(worst[:CLOSE_UPS])
    return tuple(Figure((_motion_chart(report, index),)) for index in chosen)


def _worst_sigma(report: RunReport, index: int) -> float:
    rows = {row.name: row.sigma for row in report.motions[index].models}
    sigma = rows.get(report.nonlinear_name, math.nan)
    return sigma if math.isfinite(sigma) else -1.0


def _motion_chart(report: RunReport, index: int) -> Chart:
    motion, number = report.motions[index], str(index + 1)
    beside = 0.05 * (motion.end - motion.start)
    ends = (motion.start - beside, motion.end + beside)
    part = slice(*np.searchsorted(report.t, ends).tolist())
    lines = tuple(Line("", line.kind, line.t[part], line.values[part]) for line in _lines(report))
    return Chart(
        f"motion-{number}",
        Mark((Mark(number, "badge"), motion.name if motion.name != number else ""), "b"),
        f"Line chart of the heights over motion {number}",
        lines,
        draw=partial(_draw_heights, report=report, part=part),
        ends=ends,
        sizes=(SMALL,),
    )


def _lines(report: RunReport) -> tuple[Line, ...]:
    return (
        Line("measured", "measured", report.t, report.measured),
        Line(report.linear_name, "linear", report.t, report.linear),
        Line(report.nonlinear_name, "nonlinear", report.t, report.nonlinear),
    )


def _keys(report: RunReport, data: Place) -> tuple[Text, ...]:
    """Returns the legend of what is drawn beside the lines."""
    keys: list[Text] = []
    if report.limit is not None:
        limit = (f"{report.limit_name} ", data.number("limit", "mm", 1), " mm")
        keys.append(Mark(limit, "key limit"))
    if report.events:
        keys.append(Mark("limit exceeded", "key span"))
    if data.data["gaps"]:
        keys.append(Mark(f"no measurement ({len(data.data['gaps'])}×)", "key gap"))
    if report.saturated is not None and report.saturated.any():
        outside = "lower bound: the liquid is partly outside the image"
        keys.append(Mark(outside, "key bound"))
    return tuple(keys)


def _seen(report: RunReport) -> str:
    """Describes the chart of the heights in words, for screen readers."""
    highest_of = []
    for line in _lines(report):
        if np.isfinite(line.values).any():
            at = int(np.nanargmax(line.values))
            height, time = float(line.values[at]), float(report.t[at])
            highest_of.append(
                f"{words(line.name)} {shown(height, 'mm')} mm at {shown(time, 's')} s"
            )
    limit = ""
    if report.limit is not None:
        limit = f" {report.limit_name.capitalize()}: {shown(report.limit, 'mm')} mm."
    summary = "; ".join(highest_of) or "nothing known"
    return f"Line chart of the heights over time. Highest: {summary}.{limit}"


def residual(report: RunReport, model: Array) -> Array:
    """Returns measured minus modelled height (N,) [m]; NaN if only a lower bound is known."""
    difference = report.measured - model
    if report.saturated is None:
        return difference
    return np.where(report.saturated & (difference < 0.0), np.nan, difference)


def frame_letters(report: RunReport) -> tuple[str, ...]:
    """Returns a letter for each image with a known time, and '' for images without a time."""
    known = iter("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
    return tuple(next(known, "") if np.isfinite(f.time) else "" for f in report.frames)


def _draw_run(axes: Any, *, report: RunReport) -> None:
    """Draws what a run's heights have beside their lines: limits, motions, moments of images."""
    _draw_heights(axes, report=report, part=slice(None))
    _motions(axes, report.motions)
    _frames(axes, report)


def _draw_heights(axes: Any, *, report: RunReport, part: slice) -> None:
    _backdrop(axes, report=report)
    if report.saturated is not None:
        _lower_bounds(axes, report.t[part], report.measured[part], report.saturated[part])
    if report.limit is not None:
        _limit(axes, report.limit_name, 1e3 * report.limit)


def _limit(axes: Any, name: str, limit: float) -> None:
    axes.axhline(limit, color=LIMIT, linewidth=1.2, linestyle=(0, (1, 2)), zorder=2.5)
    axes.annotate(
        f"{name} {f'{limit:.1f}'.removesuffix('.0')} mm",
        (1.0, limit),
        xycoords=("axes fraction", "data"),
        xytext=(0, 3),
        textcoords="offset points",
        ha="right",
        color=LIMIT,
        bbox={"facecolor": CARD, "edgecolor": "none", "pad": 0.8, "alpha": 0.85},
    )


def _lower_bounds(axes: Any, t: Array, measured: Array, saturated: NDArray[np.bool_]) -> None:
    t, heights = t[saturated], 1e3 * measured[saturated]
    known = np.isfinite(heights)
    t, heights = t[known], heights[known]
    if len(t):
        chosen = highest(heights, MARKS)
        axes.plot(
            t[chosen], heights[chosen],
            color=MEASURED, linestyle="none", marker="^", markersize=5.0, markeredgecolor=CARD,
            zorder=3.0,
        )  # fmt: skip


def _motions(axes: Any, motions: Sequence[RunMotion]) -> None:
    """Draws a numbered bracket above the chart for each motion."""
    if len(motions) < 2:
        return
    place: Any = axes.get_xaxis_transform()
    brackets = np.array([(m.start, m.end, np.nan) for m in motions]).ravel()
    axes.plot(
        brackets, np.full(len(brackets), 1.02), transform=place, color=INK, linewidth=2.5,
        clip_on=False, solid_capstyle="butt",
    )  # fmt: skip
    if len(motions) > NUMBERS:
        return
    for number, motion in enumerate(motions, start=1):
        axes.annotate(
            str(number), (0.5 * (motion.start + motion.end), 1.02), xycoords=place,
            xytext=(0, 2.5), textcoords="offset points", ha="center", fontsize=8.0,
            annotation_clip=False,
        )  # fmt: skip


def _frames(axes: Any, report: RunReport) -> None:
    """Draws the letter of each camera image at its time."""
    for letter, frame in zip(frame_letters(report), report.frames, strict=True):
        if letter:
            badge(axes, frame.time, letter)


def _backdrop(axes: Any, *, report: RunReport) -> None:
    """Shades time spans without measurement, and time spans with heights above the limit."""
    last = float(report.t[-1]) if len(report.t) else 0.0
    ends = ((e.start, e.end if np.isfinite(e.end) else last) for e in report.events)
    _shade(axes, ends, SPAN)
    _shade(axes, gaps(report.t, report.measured), GAP)


def _shade(axes: Any, spans: Spans, colour: str) -> None:
    """Shades the given time spans as one shape; skips those outside the chart's time axis."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    first, last = axes.get_xlim()
    pixel = (last - first) / POINTS
    inside = ((start, end) for start, end in spans if end > first and start < last)
    edges = np.array(united(inside, pixel)).reshape(-1, 2)
    if len(edges):
        corners = np.stack(
            [edges[:, [0, 0, 1, 1]], np.tile([0.0, 1.0, 1.0, 0.0], (len(edges), 1))]
        )
        area = Path.make_compound_path_from_polys(np.moveaxis(corners, 0, -1))
        axes.add_patch(
            PathPatch(area, transform=axes.get_xaxis_transform(), facecolor=colour, linewidth=0.0)
        )
