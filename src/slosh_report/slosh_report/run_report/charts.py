"""Charts over time: liquid heights, residuals and single motions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_report.page.series import POINTS, gaps, highest, time_ends, united
from slosh_report.page.svg import (
    CARD,
    DASHES,
    GAP,
    INK,
    LIMIT,
    LINEAR,
    MEASURED,
    NONLINEAR,
    SMALL,
    SPAN,
    badge,
    chart_points,
    draw_line,
    time_chart,
)
from slosh_report.run_report.data import RunReport
from slosh_report.run_report.rows import RunMotion

Spans = Iterable[tuple[float, float]]

NUMBERS = 25
"""Motions that are numbered in a chart; more numbers would lie over each other."""
MARKS = 60
"""Lower bounds that are marked; more of them would be a bar."""


def heights_chart(report: RunReport, size: tuple[float, float], name: str) -> str:
    """Draws measured, linear and nonlinear model's heights over time [mm] as SVG."""

    def draw(axes: Any) -> None:
        _heights(axes, report, slice(None), chart_points(size))
        _motions(axes, report.motions)
        _frames(axes, report)
        axes.set_ylabel("height above rest [mm]")

    return time_chart(draw, time_ends(report.t), size, name)


def residual_chart(report: RunReport, size: tuple[float, float], name: str) -> str:
    """Draws measured minus estimated height of linear and nonlinear model [mm] as SVG."""
    points = chart_points(size)

    def draw(axes: Any) -> None:
        _backdrop(axes, report)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        draw_line(axes, report.t, residual(report, report.linear), LINEAR, 1.2, DASHES, points)
        draw_line(axes, report.t, residual(report, report.nonlinear), NONLINEAR, 1.3, "-", points)
        axes.set_ylabel("measured − model [mm]")

    return time_chart(draw, time_ends(report.t), size, name)


def motion_chart(report: RunReport, motion: RunMotion, name: str) -> str:
    """Draws measured, linear and nonlinear model's heights in one motion [mm] as SVG."""
    beside = 0.05 * (motion.end - motion.start)
    ends = (motion.start - beside, motion.end + beside)
    part = slice(*np.searchsorted(report.t, ends).tolist())

    def draw(axes: Any) -> None:
        _heights(axes, report, part, chart_points(SMALL))
        axes.set_ylabel("height [mm]")

    return time_chart(draw, ends, SMALL, name)


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


def _heights(axes: Any, report: RunReport, part: slice, points: int) -> None:
    _backdrop(axes, report)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    t, measured = report.t[part], report.measured[part]
    draw_line(axes, t, measured, MEASURED, 2.0, "-", points)
    draw_line(axes, t, report.linear[part], LINEAR, 1.3, DASHES, points)
    draw_line(axes, t, report.nonlinear[part], NONLINEAR, 1.3, "-", points)
    if report.saturated is not None:
        _lower_bounds(axes, t, measured, report.saturated[part])
    if report.limit is not None:
        _limit(axes, report.limit_name, 1e3 * report.limit)


def _limit(axes: Any, name: str, limit: float) -> None:
    axes.axhline(limit, color=LIMIT, linewidth=1.2, linestyle=(0, (1, 2)))
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


def _backdrop(axes: Any, report: RunReport) -> None:
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
