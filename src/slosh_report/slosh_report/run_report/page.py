"""Renders the report of a run as an HTML page."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jinja2 import Template
from markupsafe import Markup
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_report.page.series import extremes, time_ends
from slosh_report.page.svg import MARGINS, NARROW, WIDE
from slosh_report.page.template import Script, data_element, make_environment, number, script
from slosh_report.page.units import digits_that_differ, shown, unit_style
from slosh_report.run_report.charts import (
    frame_letters,
    heights_chart,
    motion_chart,
    residual,
    residual_chart,
)
from slosh_report.run_report.data import RunReport
from slosh_report.run_report.document import report_document
from slosh_report.run_report.polar import polar_chart

MOST_SAMPLES = 4_000
"""Longer series are thinned to their extremes: a page of three hours stays below a megabyte."""
_TIME_DIGITS, _HEIGHT_DIGITS = 4, 3  # of seconds and millimetres

ROWS = 100
"""Most rows of a table on the page; the JSON document holds them all."""
UNFOLDED = 4
"""Fields that differ and are shown at once."""
SIZES = (("wide", WIDE), ("narrow", NARROW))
CLOSE_UPS = 6
"""Most motions that are drawn on their own."""


def render_report(report: RunReport) -> str:
    """Renders the report as HTML; equal reports give equal pages.

    Args:
        report: what to show; every text in it is escaped.
    """
    document = report_document(report)
    return _template().render(
        report=report,
        doc=document,
        rows=ROWS,
        letters=frame_letters(report),
        clocks_differ=_clocks_differ(document),
        seen=_seen(report),
        close_ups=_close_ups(report),
        charts=_charts(report),
        **_closer(report),
    )


def _charts(report: RunReport) -> dict[str, Markup]:
    """Returns the charts as SVG by name; empty if there are no data."""
    charts = {}
    if _anything(report):
        for kind, draw in (("heights", heights_chart), ("residual", residual_chart)):
            for width, size in SIZES:
                name = f"{kind}-{width}"
                charts[name] = Markup(draw(report, size, name))
    for index, one in enumerate(report.further):
        for width, size in SIZES:
            name = f"further-{index}-{width}"
            charts[name] = Markup(heights_chart(one, size, name))
    if report.measured_azimuth is not None or report.estimated_azimuth is not None:
        charts["azimuth"] = Markup(polar_chart(report, "azimuth"))
    return charts


def _closer(report: RunReport) -> dict[str, Any]:
    """Returns the data of interactive charts; empty if there are no data."""
    if not _anything(report):
        return {"axes": {}}
    linear, nonlinear = report.linear_name, report.nonlinear_name
    differences = [residual(report, values) for values in (report.linear, report.nonlinear)]
    charts = {
        "heights": (
            Row("measured", "measured", report.measured),
            Row(linear, "linear", report.linear, dash=True),
            Row(nonlinear, "nonlinear", report.nonlinear),
        ),
        "residual": (
            Row(f"measured − {linear}", "linear", differences[0], dash=True, height=False),
            Row(f"measured − {nonlinear}", "nonlinear", differences[1], height=False),
        ),
    }
    ends = time_ends(report.t)
    return {
        "axes": {"wide": axis(ends, WIDE), "narrow": axis(ends, NARROW)},
        "series": series_element(report.t, charts, report.limit),
        "scripts": closer_scripts(),
    }


def _close_ups(report: RunReport) -> list[tuple[int, Markup]]:
    """Returns charts of the motions with the largest model errors, in order of time."""
    if len(report.motions) < 2 or not _anything(report):
        return []
    worst = sorted(range(len(report.motions)), key=lambda i: -_worst_sigma(report, i))
    return [
        (i, Markup(motion_chart(report, report.motions[i], f"motion-{i + 1}")))
        for i in sorted(worst[:CLOSE_UPS])
    ]


def _worst_sigma(report: RunReport, index: int) -> float:
    rows = {row.name: row.sigma for row in report.motions[index].models}
    sigma = rows.get(report.nonlinear_name, math.nan)
    return sigma if math.isfinite(sigma) else -1.0


def _anything(report: RunReport) -> bool:
    series = (report.measured, report.linear, report.nonlinear)
    return any(bool(np.isfinite(values).any()) for values in series)


def _seen(report: RunReport) -> dict[str, str]:
    """Describes the charts in words, for screen readers."""
    names = (("measured", report.measured), (report.linear_name, report.linear),
             (report.nonlinear_name, report.nonlinear))  # fmt: skip
    highest = []
    for name, values in names:
        if np.isfinite(values).any():
            at = int(np.nanargmax(values))
            highest.append(
                f"{name} {shown(float(values[at]), 'mm')} mm"
                f" at {shown(float(report.t[at]), 's')} s"
            )
    limit = ""
    if report.limit is not None:
        limit = f" {report.limit_name.capitalize()}: {shown(report.limit, 'mm')} mm."
    summary = "; ".join(highest) or "nothing known"
    return {
        "heights": f"Line chart of the heights over time. Highest: {summary}.{limit}",
        "residual": "Line chart of measured minus estimated height over time;"
        " see the table under Agreement for a summary.",
        "azimuth": "Polar chart of the place of the highest liquid on the wall, seen from above.",
    }


def _clocks_differ(document: dict[str, Any]) -> bool:
    rows = [*document["models"], *(row for m in document["motions"] for row in m["models"])]
    return any(row["offset"] is not None for row in rows)


@cache
def _template() -> Template:
    environment = make_environment("slosh_report.run_report")
    environment.globals.update(
        expectation=expectation, close_digits=close_digits, model_names=model_names,
        model_index=model_index, best_index=best_index, differences_apart=differences_apart,
    )  # fmt: skip
    return environment.get_template("report.html.j2")


def model_names(motions: list[dict[str, Any]]) -> list[str]:
    """Returns the names of all models in the motions, in order of appearance."""
    return list(dict.fromkeys(row["name"] for motion in motions for row in motion["models"]))


def model_index(motion: dict[str, Any], name: str) -> int | None:
    """Returns the index of a model in a motion's results; None if it is missing."""
    names = [row["name"] for row in motion["models"]]
    return names.index(name) if name in names else None


def best_index(motion: dict[str, Any]) -> int | None:
    """Returns the index of the model with the smallest MAE; None if all are unknown."""
    known = [
        (row["sigma"], i) for i, row in enumerate(motion["models"]) if row["sigma"] is not None
    ]
    return min(known)[1] if known else None


Differences = list[tuple[int, dict[str, Any]]]


def differences_apart(rows: list[dict[str, Any]]) -> tuple[Differences, Differences]:
    """Splits the table of fields that a replay did not reproduce into shown and collapsed rows."""
    ordered = sorted(enumerate(rows), key=lambda entry: entry[1]["first"] is None)
    return ordered[:UNFOLDED], ordered[UNFOLDED:]


def expectation(path: str, check: dict[str, Any], digits: int) -> Markup:
    """Formats the expected value of a check: a number with tolerance, a bound, or anything."""
    lower, upper, tolerance, unit = (check[k] for k in ("lower", "upper", "tolerance", "unit"))
    if tolerance is not None:
        middle = number(f"{path}/expected", check["expected"], unit, digits)
        if not tolerance:
            return middle
        size = f"{unit_style(unit).scale * tolerance:.2g}"
        return middle + " ± " + data_element(f"{path}/tolerance", tolerance, size)
    if lower is not None:
        return Markup("≥ ") + number(f"{path}/lower", lower, unit, digits)
    if upper is not None:
        return Markup("≤ ") + number(f"{path}/upper", upper, unit, digits)
    return Markup("any")


def close_digits(check: dict[str, Any]) -> int:
    """Returns the number of decimals that show by how much a value misses its bound."""
    value, unit = check["value"], check["unit"]
    if check["passed"] or value is None:
        return digits_that_differ(None, None, unit)
    missed = check["lower"] if _below(value, check["lower"]) else check["upper"]
    return digits_that_differ(value, missed, unit)


def _below(value: float, lower: float | None) -> bool:
    return lower is not None and value < lower


@dataclass(frozen=True, slots=True)
class Row:
    """A line in an interactive chart: name, colour, values and style.

    It shows the values at a moment, and a closer look at a span that is marked, drawn by uPlot.

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
