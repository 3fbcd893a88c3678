"""Draws the charts of a document as SVG, and embeds the data of those that answer a pointer."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_report.document import Chart, Line, Size
from slosh_report.page.series import extremes
from slosh_report.page.svg import (
    DASHES,
    INK,
    LINEAR,
    MARGINS,
    MEASURED,
    NONLINEAR,
    canvas,
    chart_points,
    draw_line,
    style,
    svg_text,
)
from slosh_report.texts import words

KINDS: dict[str, tuple[str, float, Any]] = {
    "measured": (MEASURED, 2.0, "-"),
    "thin": (MEASURED, 1.1, "-"),
    "linear": (LINEAR, 1.3, DASHES),
    "nonlinear": (NONLINEAR, 1.4, "-"),
    "plain": (INK, 1.2, "-"),
}
"""Colour, width and dashes of a line by its kind; the style sheet has them for the legend."""
MOST_SAMPLES = 4_000
"""Longer series are thinned to their extremes: a page of three hours stays below a megabyte."""
_TIME_DIGITS, _HEIGHT_DIGITS = 4, 3  # of seconds and millimetres


def chart_svg(chart: Chart, size: Size, name: str) -> str:
    """Draws a chart as an <svg> element of the page's colours.

    Args:
        chart: what to draw.
        size: of the figure [in].
        name: unique on the page.
    """
    with style(name):
        figure = canvas(size)
        axes: Any = figure.add_subplot(projection=chart.projection or None)
        if chart.lines:
            _over_time(axes, chart, chart_points(size))
        elif chart.draw is not None:
            chart.draw(axes)
        return svg_text(figure, name)


def _over_time(axes: Any, chart: Chart, points: int) -> None:
    """Draws lines over time, and below them what the chart draws itself."""
    axes.set_xlim(*chart.time_ends)
    if chart.top is None:
        axes.axhline(0.0, color=INK, linewidth=0.8)
    else:
        axes.set_ylim(0.0, chart.top)
    if chart.draw is not None:
        chart.draw(axes)
    for line in chart.lines:
        colour, width, dashes = KINDS[line.kind]
        draw_line(axes, line.t, line.values, colour, width, dashes, points, scale=chart.scale)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(chart.label)


def time_axis(chart: Chart, size: Size) -> str:
    """Tells the page's script where a chart's time axis lies: shares of its width, and times."""
    (left, right, *_), (start, end) = MARGINS, chart.time_ends
    return f"{left / size[0]:.6f} {1.0 - right / size[0]:.6f} {start!r} {end!r}"


def series_element(charts: Sequence[Chart]) -> Markup:
    """Embeds the lines of live charts in a page, in s and mm.

    Args:
        charts: their lines have the same times (N,) [s], which do not decrease.
    """
    t = charts[0].lines[0].t
    kept = _kept(t, [line.values for chart in charts for line in chart.lines])
    limit = next((chart.limit for chart in charts if chart.limit is not None), None)
    document = {
        "t": _rounded(t[kept], _TIME_DIGITS),
        "limit": None if limit is None else round(1e3 * limit, _HEIGHT_DIGITS),
        "charts": {
            chart.name: [_entry(chart, line, kept) for line in chart.lines] for chart in charts
        },
    }
    # In a name a '<' would end the element.
    text = json.dumps(document, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return Markup(f'<script type="application/json" id="series">{text}</script>')


def _kept(t: Array, series: Sequence[Array]) -> NDArray[np.intp]:
    """Selects the samples to embed: finite ones, and only the extremes of long series."""
    known = np.flatnonzero(np.any([np.isfinite(values) for values in series], axis=0))
    if len(known) <= MOST_SAMPLES:
        return known
    bins = MOST_SAMPLES // (2 * len(series))
    chosen: list[NDArray[np.intp]] = []
    for values in series:
        finite = np.flatnonzero(np.isfinite(values))
        if len(finite):
            chosen.append(finite[extremes(t[finite], values[finite], bins)])
    return np.unique(np.concatenate(chosen))


def _entry(chart: Chart, line: Line, kept: NDArray[np.intp]) -> dict[str, Any]:
    """Returns a line for the page's script; a limit bounds those of a chart that has one."""
    return {
        "name": words(line.name),
        "colour": line.kind,
        "dash": line.kind == "linear",
        "height": chart.limit is not None,
        "values": _rounded(1e3 * line.values[kept], _HEIGHT_DIGITS),
    }


def _rounded(values: Array, digits: int) -> list[float | None]:
    return [round(value, digits) if np.isfinite(value) else None for value in values.tolist()]
