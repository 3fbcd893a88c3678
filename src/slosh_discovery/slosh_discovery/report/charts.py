"""Charts as SVG text that takes its colours from the page, so that light and dark are one file."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from numpy.typing import NDArray

from slosh_discovery.report.data import RunReport, Span

Array = NDArray[np.float64]

# Stand-ins that matplotlib draws with; each becomes a CSS variable of the page.
COLOURS = {
    "#010101": "var(--measured)",
    "#020202": "var(--linear)",
    "#030303": "var(--nonlinear)",
    "#040404": "var(--limit)",
    "#050505": "var(--ink-soft)",
    "#060606": "var(--grid)",
    "#070707": "var(--span)",
}
MEASURED, LINEAR, NONLINEAR, LIMIT, INK, GRID, SPAN = COLOURS

WIDE = (9.6, 3.3)
NARROW = (4.1, 3.0)
"""Sizes [in]: two drawings; one scaled to a phone's width has letters that nobody reads."""
POINTS = 1200
"""A chart's pixels: longer series are drawn by the extremes of each bin."""

STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "font.size": 10.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "lines.solid_capstyle": "round",
}


def heights_chart(report: RunReport, size: tuple[float, float], name: str) -> str:
    """Measured, L and NL over time [mm], with the limit and the spans of excess, as SVG text."""

    def draw(axes: Any) -> None:
        _spans(axes, report.events, report.t)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        _line(axes, report.t, report.measured, MEASURED, 1.7, "-")
        _line(axes, report.t, report.linear, LINEAR, 1.3, (0, (5, 2)))
        _line(axes, report.t, report.nonlinear, NONLINEAR, 1.3, "-")
        if report.limit is not None:
            limit = 1e3 * report.limit
            axes.axhline(limit, color=LIMIT, linewidth=1.1, linestyle=(0, (1, 2)))
            axes.annotate(
                f"limit {limit:.0f} mm",
                (1.0, limit),
                xycoords=("axes fraction", "data"),
                xytext=(0, 3),
                textcoords="offset points",
                ha="right",
                color=LIMIT,
            )
        axes.set_ylabel("height above rest [mm]")

    return _chart(draw, report.t, size, name)


def residual_chart(report: RunReport, size: tuple[float, float], name: str) -> str:
    """Measured minus L and minus NL over time [mm], as SVG text."""

    def draw(axes: Any) -> None:
        _spans(axes, report.events, report.t)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        _line(axes, report.t, report.measured - report.linear, LINEAR, 1.2, (0, (5, 2)))
        _line(axes, report.t, report.measured - report.nonlinear, NONLINEAR, 1.3, "-")
        axes.set_ylabel("measured − model [mm]")

    return _chart(draw, report.t, size, name)


def envelope(t: Array, values: Array, points: int = POINTS) -> tuple[Array, Array]:
    """At most about `points` points that keep every bin's minimum and maximum.

    Args:
        t: (N,) time.
        values: (N,) values; NaN where there are none.
        points: wanted number.

    Returns:
        the series itself where it is short enough, or the extremes in time order.
    """
    if len(t) <= points:
        return t, values
    chosen: list[int] = []
    for part in np.array_split(np.arange(len(t)), points // 2):
        finite = part[np.isfinite(values[part])]
        if len(finite) == 0:
            chosen.append(int(part[0]))
            continue
        extremes = {int(finite[np.argmin(values[finite])]), int(finite[np.argmax(values[finite])])}
        chosen += sorted(extremes)
    return t[chosen], values[chosen]


def _line(axes: Any, t: Array, metres: Array, colour: str, width: float, style: Any) -> None:
    axes.plot(*envelope(t, 1e3 * metres), color=colour, linewidth=width, linestyle=style)


def _spans(axes: Any, events: tuple[Span, ...], t: Array) -> None:
    for event in events:
        end = event.end if np.isfinite(event.end) else (float(t[-1]) if len(t) else event.start)
        axes.axvspan(event.start, end, color=SPAN, linewidth=0.0)


def _chart(draw: Callable[[Any], None], t: Array, size: tuple[float, float], name: str) -> str:
    # The salt makes the file the same each time; the name keeps the ids of two charts apart.
    style: Any = {**STYLE, "svg.hashsalt": name}
    with matplotlib.rc_context(style):
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasSVG(figure)
        axes = figure.add_subplot()
        draw(axes)
        if len(t) > 1:  # one time axis for all charts, whatever series they show
            margin = 0.01 * float(t[-1] - t[0])
            axes.set_xlim(t[0] - margin, t[-1] + margin)
        axes.set_xlabel("time [s]")
        text = io.StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    return _inline(text.getvalue(), name)


def _inline(svg: str, name: str) -> str:
    """The <svg> element alone, in the page's colours, with ids that no other chart has."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    for stand_in, variable in COLOURS.items():
        svg = svg.replace(stand_in, variable)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r"url\(#", f"url(#{name}-", svg)
    svg = re.sub(r'xlink:href="#', f'xlink:href="#{name}-', svg)
    # The page says how wide it is; the view box keeps the proportions.
    head, body = svg.split(">", 1)
    return re.sub(r'\s(?:width|height)="[^"]*"', "", head) + ">" + body
