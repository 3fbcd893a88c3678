"""Data and scripts for interactive charts over time.

It shows the values at a moment, and a closer look at a span that is marked, drawn by uPlot.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_report.page.series import extremes
from slosh_report.page.svg import MARGINS
from slosh_report.page.template import Script, script

MOST_SAMPLES = 4_000
"""Longer series are thinned to their extremes: a page of three hours stays below a megabyte."""
_TIME_DIGITS, _HEIGHT_DIGITS = 4, 3  # of seconds and millimetres


@dataclass(frozen=True, slots=True)
class Row:
    """A line in an interactive chart: name, colour, values and style.

    Attributes:
        name: in the chart's key.
        colour: variable of the page's style.
        values: (N,) heights [m]; NaN: none.
        dash: whether the line is dashed.
        height: whether it is a height, which a limit can bound, and no difference.
    """

    name: str
    colour: str
    values: Array
    dash: bool = False
    height: bool = True


def closer_scripts() -> list[Script]:
    """Returns the JavaScript of a report's interactive charts: uPlot and our own script."""
    return [
        script("slosh_report", "uplot/uPlot.iife.min.js"),
        script("slosh_report.page", "closer.js"),
    ]


def axis(ends: tuple[float, float], size: tuple[float, float]) -> str:
    """Formats the time axis of an interactive chart as text for the report page's script."""
    left, right = MARGINS[0] / size[0], 1.0 - MARGINS[1] / size[0]
    return f"{left:.6f} {right:.6f} {ends[0]!r} {ends[1]!r}"


def series_element(t: Array, charts: Mapping[str, Sequence[Row]], limit: float | None) -> Markup:
    """Embeds the data of interactive charts in a report page, in s and mm.

    Args:
        t: (N,) [s], not decreasing.
        charts: their rows by name.
        limit: of heights [m]; None: none.
    """
    rows = [row for chart in charts.values() for row in chart]
    kept = _kept(t, [row.values for row in rows])
    document = {
        "t": _rounded(t[kept], _TIME_DIGITS),
        "limit": None if limit is None else round(1e3 * limit, _HEIGHT_DIGITS),
        "charts": {name: [_entry(row, kept) for row in chart] for name, chart in charts.items()},
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


def _entry(row: Row, kept: NDArray[np.intp]) -> dict[str, Any]:
    return {
        "name": row.name,
        "colour": row.colour,
        "dash": row.dash,
        "height": row.height,
        "values": _rounded(1e3 * row.values[kept], _HEIGHT_DIGITS),
    }


def _rounded(values: Array, digits: int) -> list[float | None]:
    return [round(value, digits) if np.isfinite(value) else None for value in values.tolist()]
