"""HTML page about months of stored motions: trends, events by shift, the worst motions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from markupsafe import Markup

from slosh_replay.fleet.query import TABLE, MotionTable
from slosh_replay.fleet.store import FleetStore
from slosh_report.page.svg import LINEAR, MEASURED, NONLINEAR, canvas, style, svg_text
from slosh_report.page.template import make_environment

SIZE = (6.4, 2.6)
MOST_LINES: Final = 3
"""Containers whose trends are drawn, those with most motions first."""
WORST: Final = 20
_COLOURS = (NONLINEAR, LINEAR, MEASURED)
_OVERVIEW = f"SELECT count(*), count(DISTINCT cell), min(begin), max(begin) FROM {TABLE}"
_MONTHS = f"""SELECT month, cell, container, left(model_digest, 8), count(*),
max(coalesce(measured_peak, nonlinear_peak)), avg(sigma_nonlinear),
median(natural_frequency), median(damping_ratio), sum(events)
FROM {TABLE} GROUP BY month, cell, container, model_digest ORDER BY month, cell, container"""
_LINES = f"""SELECT cell, container, model_digest, count(*) AS motions FROM {TABLE}
GROUP BY ALL ORDER BY motions DESC, cell, model_digest LIMIT {MOST_LINES}"""
_TREND = f"""SELECT date_trunc('day', begin) AS day, median({{column}}) AS value FROM {TABLE}
WHERE cell = ? AND model_digest = ? GROUP BY day HAVING value IS NOT NULL ORDER BY day"""
_SHIFTS = f"""SELECT CAST(extract(hour FROM begin AT TIME ZONE 'UTC') AS INTEGER) // 8 AS shift,
count(*), sum(events), count(*) FILTER (events > 0) FROM {TABLE} GROUP BY shift ORDER BY shift"""
_SHARE = """greatest(coalesce(measured_peak / measured_limit, 0.0),
coalesce(nonlinear_peak / estimated_limit, 0.0))"""
_WORST = f"""SELECT begin, cell, container, measured_peak, nonlinear_peak,
least(measured_limit, estimated_limit), events, bag FROM {TABLE}
ORDER BY {_SHARE} DESC, nonlinear_peak DESC NULLS LAST, digest LIMIT {WORST}"""
CHARTS: Final = (
    ("frequency", "natural_frequency", "natural frequency [rad/s]", 1.0),
    ("damping", "damping_ratio", "damping ratio", 1.0),
    ("level", "level", "level [mm]", 1e3),
)
"""Name, column, label and factor of each trend."""


class Trend(NamedTuple):
    """A chart of daily medians; `drawing` is empty if there are no values."""

    name: str
    label: str
    drawing: Markup | str


class BagLink(NamedTuple):
    """A bag's path, with its URL if the bag is on this machine's disk."""

    path: str
    url: str


def render_fleet(store: FleetStore) -> str:
    """Renders the HTML page of a store of motions; all texts in it are escaped.

    Raises:
        SloshBagError: DuckDB is not installed, or the store is empty.
    """
    template = make_environment("slosh_bringup.predict").get_template("fleet.html.j2")
    with MotionTable(store, loaded=True) as table:
        ((motions, cells, first, last),) = table.query(_OVERVIEW).rows
        lines = table.query(_LINES).rows
        return template.render(
            place=store.url, motions=motions, cells=cells, first=first, last=last,
            months=table.query(_MONTHS).rows, shifts=table.query(_SHIFTS).rows,
            worst=[(*row[:-1], _link(row[-1])) for row in table.query(_WORST).rows],
            lines=[f"{cell}, {container or 'unknown container'}" for cell, container, *_ in lines],
            trends=[_trend(table, lines, *chart) for chart in CHARTS],
        )  # fmt: skip


def _trend(
    table: MotionTable, lines: Sequence[tuple[Any, ...]], name: str, column: str, label: str,
    factor: float,
) -> Trend:  # fmt: skip
    """Draws the daily medians of a column of the stored motions, one line per container."""
    sql = _TREND.format(column=column)
    found = [table.query(sql, (cell, digest)).rows for cell, _, digest, _ in lines]
    if not any(found):
        return Trend(name, label, "")
    with style(name):
        figure = canvas(SIZE)
        axes: Any = figure.add_subplot()
        for rows, colour in zip(found, _COLOURS, strict=False):
            days = [day for day, _ in rows]
            axes.plot(days, [factor * value for _, value in rows], ".-", color=colour)
        axes.ticklabel_format(axis="y", useOffset=False)
        return Trend(name, label, Markup(svg_text(figure, name)))


def _link(bag: str) -> BagLink:
    path = Path(bag)
    return BagLink(bag, path.as_uri() if path.is_absolute() else "")
