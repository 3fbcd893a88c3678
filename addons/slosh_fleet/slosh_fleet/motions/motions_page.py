"""Months of stored motions as a document: trends, events by shift, the worst motions."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from slosh_fleet.motions.query import TABLE, MotionTable
from slosh_fleet.motions.store import FleetStore
from slosh_report.document import (
    Block,
    Chart,
    Column,
    Document,
    Figure,
    Paragraph,
    Section,
    Table,
    explain,
    table,
)
from slosh_report.page.charts import KINDS
from slosh_report.page.svg import NARROW
from slosh_report.page.units import DASH
from slosh_report.texts import Mark, Text

SIZE = (6.4, 2.6)
MOST_LINES: Final = 3
"""Containers whose trend is drawn in a chart, those that have changed most first."""
MOST_CONTAINERS: Final = 50
"""Rows of the table of all containers."""
WORST: Final = 20
_KINDS = ("nonlinear", "linear", "measured")
"""Of a chart's lines."""
_OVERVIEW = f"SELECT count(*), count(DISTINCT cell), min(begin), max(begin) FROM {TABLE}"
_MONTHS = f"""SELECT month, cell, container, left(model_digest, 8), count(*),
max(coalesce(measured_peak, nonlinear_peak)), avg(sigma_nonlinear),
median(natural_frequency), median(damping_ratio), sum(events)
FROM {TABLE} GROUP BY month, cell, container, model_digest ORDER BY month, cell, container"""
_DRIFTS = f"""SELECT cell, container, model_digest, count(*), median(natural_frequency),
regr_slope(natural_frequency, epoch(begin)) * (epoch(max(begin)) - epoch(min(begin))),
median(damping_ratio),
regr_slope(damping_ratio, epoch(begin)) * (epoch(max(begin)) - epoch(min(begin))),
median(level), regr_slope(level, epoch(begin)) * (epoch(max(begin)) - epoch(min(begin)))
FROM {TABLE} GROUP BY cell, container, model_digest ORDER BY count(*) DESC, cell, model_digest"""
"""A change is the slope of a straight line through all motions, times the whole duration."""
_TREND = f"""SELECT date_trunc('day', begin) AS day, median({{column}}) AS value FROM {TABLE}
WHERE cell = ? AND model_digest = ? GROUP BY day HAVING value IS NOT NULL ORDER BY day"""
_SHIFTS = f"""SELECT CAST(extract(hour FROM begin AT TIME ZONE 'UTC') AS INTEGER) // 8 AS shift,
count(*), sum(events), count(*) FILTER (events > 0) FROM {TABLE} GROUP BY shift ORDER BY shift"""
_SHARE = """greatest(coalesce(measured_peak / measured_limit, 0.0),
coalesce(nonlinear_peak / estimated_limit, 0.0))"""
_WORST = f"""SELECT begin, cell, container, measured_peak, nonlinear_peak,
least(measured_limit, estimated_limit), events, bag FROM {TABLE}
ORDER BY {_SHARE} DESC, nonlinear_peak DESC NULLS LAST, digest LIMIT {WORST}"""
_COLUMNS: Final = (
    "begin", "month", "cell", "container", "model_digest", "digest", "bag", "events",
    "measured_peak", "nonlinear_peak", "measured_limit", "estimated_limit", "sigma_nonlinear",
    "natural_frequency", "damping_ratio", "level",
)  # fmt: skip
"""All columns in the queries."""
CHARTS: Final = (
    ("frequency", "natural_frequency", "natural frequency [rad/s]", 1.0),
    ("damping", "damping_ratio", "damping ratio", 1.0),
    ("level", "level", "level [mm]", 1e3),
)
"""Name, column, label and factor of each trend, in the order of the changes in Drift."""


class Drift(NamedTuple):
    """Median and change of natural frequency, damping and still level of a container in a cell.

    None in a number: unknown.
    """

    cell: str
    container: str
    model: str
    motions: int
    frequency: float | None
    frequency_change: float | None
    damping: float | None
    damping_change: float | None
    level: float | None
    level_change: float | None

    @property
    def title(self) -> str:
        """Cell, container and the first digits of the model's digest, as text."""
        return f"{self.cell}, {self.container or 'unknown container'}, model {self.model[:8]}"


def fleet_document(store: FleetStore) -> Document:
    """Returns months of stored motions as a document.

    Raises:
        SloshBagError: DuckDB is not installed, or the store is empty.
    """
    with MotionTable(store, loaded=_COLUMNS) as motions:
        ((count, cells, first, last),) = motions.query(_OVERVIEW).rows
        drifts = [Drift(*row) for row in motions.query(_DRIFTS).rows]
        trends = tuple(
            _trend(motions, _most_changed(drifts, number), *chart)
            for number, chart in enumerate(CHARTS)
        )
        months, shifts, worst = (motions.query(sql).rows for sql in (_MONTHS, _SHIFTS, _WORST))
    span = f"{first:%Y-%m-%d} to {last:%Y-%m-%d} (UTC), {store.url}"
    most = ""
    if len(drifts) > MOST_CONTAINERS:
        most = f" The {MOST_CONTAINERS} of {len(drifts)} containers with most motions."
    daily = (
        "Daily medians as the observer found them, of the containers that have changed most; all "
        "are in the table."
    )
    line = (
        "Medians, and changes from the first to the last motion by a straight line through all of "
        "them."
    )
    return Document(
        f"{count} motions of {cells} cells",
        (Paragraph(span, "subtitle"),),
        (
            Section("Trends", (explain(daily), *trends), "trends"),
            Section(
                "Containers",
                (
                    explain(line + most),
                    _table("Containers", _CONTAINERS, drifts[:MOST_CONTAINERS]),
                ),
                "containers",
            ),
            Section("Months", (_table("Months", _OF_MONTH, months),), "months"),
            Section(
                "Shifts", (explain("Hours in UTC."), _table("Shifts", _OF_SHIFT, shifts)), "shifts"
            ),
            Section(
                "Worst motions",
                (
                    explain("By the greatest height as a share of its limit. Times in UTC."),
                    _table("Worst motions", _OF_WORST, worst),
                ),
                "worst",
            ),
        ),
    )


def _table(caption: str, columns: Sequence[Column], rows: Sequence[Any]) -> Table:
    return table(caption, columns, rows, seen=False, most=sys.maxsize)


def _column(place: int, head: str, form: str = "", factor: float = 1.0) -> Column:
    """Returns the column of an entry of rows, which is shown in a format; None: unknown."""

    def cell(row: Sequence[Any]) -> Text:
        value = row[place]
        if value is None:
            return DASH
        return f"{factor * value:{form}}" if form else str(value)

    return Column(head, cell, "n" if form else "")


def _model(place: int) -> Column:
    return Column("model", lambda row: Mark(row[place][:8], "code"))


def _bag(row: Sequence[Any]) -> Text:
    """Returns a bag's path, with a link if the bag is on this machine's disk."""
    path = Path(row[-1])
    return Mark(row[-1], link=path.as_uri() if path.is_absolute() else "")


MM, FREQUENCY, DAMPING = (".2f", 1e3), (".3f",), (".4f",)
_CONTAINERS = (
    _column(0, "cell"), _column(1, "container"), _model(2), _column(3, "motions", ".0f"),
    _column(4, "natural frequency [rad/s]", *FREQUENCY), _column(5, "change", "+.3f"),
    _column(6, "damping ratio", *DAMPING), _column(7, "change", "+.4f"),
    _column(8, "level [mm]", *MM), _column(9, "change", "+.2f", 1e3),
)  # fmt: skip
_OF_MONTH = (
    _column(0, "month"), _column(1, "cell"), _column(2, "container"), _model(3),
    _column(4, "motions", ".0f"), _column(5, "highest [mm]", *MM), _column(6, "MAE [mm]", *MM),
    _column(7, "natural frequency [rad/s]", *FREQUENCY), _column(8, "damping ratio", *DAMPING),
    _column(9, "events", ".0f"),
)  # fmt: skip
_OF_SHIFT = (
    Column("hours", lambda row: f"{8 * row[0]} to {8 * row[0] + 8}"), _column(1, "motions", ".0f"),
    _column(2, "events", ".0f"), _column(3, "motions with events", ".0f"),
)  # fmt: skip
_OF_WORST = (
    Column("begin", lambda row: f"{row[0]:%Y-%m-%d %H:%M:%S}"), _column(1, "cell"),
    _column(2, "container"), _column(3, "measured [mm]", *MM), _column(4, "estimated [mm]", *MM),
    _column(5, "limit [mm]", *MM), _column(6, "events", ".0f"), Column("bag", _bag, "name"),
)  # fmt: skip


def _most_changed(drifts: Sequence[Drift], number: int) -> list[Drift]:
    """Returns the containers whose value in a chart has changed most, in the order of `drifts`."""
    changes = [(one.frequency_change, one.damping_change, one.level_change) for one in drifts]
    known = [(abs(own[number] or 0.0), -row) for row, own in enumerate(changes)
             if own[number] is not None]  # fmt: skip
    chosen = sorted(-row for _, row in sorted(known, reverse=True)[:MOST_LINES])
    return [drifts[row] for row in chosen]


def _trend(
    motions: MotionTable,
    drifts: Sequence[Drift],
    name: str,
    column: str,
    label: str,
    factor: float,
) -> Block:
    """Returns a chart of the daily medians of a column, one line per container."""
    sql = _TREND.format(column=column)
    found = [motions.query(sql, (one.cell, one.model)).rows for one in drifts]
    if not any(found):
        return Paragraph(f"{label}: not known of any motion.")
    keys = tuple(Mark(one.title, f"key {kind}") for one, kind in zip(drifts, _KINDS, strict=False))
    draw = partial(_draw_days, days=found, factor=factor)
    chart = Chart(name, f"{label}:", f"{label} by day", draw=draw, keys=keys, sizes=(SIZE, NARROW))
    return Figure((chart,))


def _draw_days(axes: Any, *, days: Sequence[Sequence[Any]], factor: float) -> None:
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    for rows, kind in zip(days, _KINDS, strict=False):
        colour, _, dashes = KINDS[kind]
        values = [factor * value for _, value in rows]
        axes.plot([day for day, _ in rows], values, marker=".", markersize=4.0, color=colour,
                  linestyle=dashes)  # fmt: skip
    axes.ticklabel_format(axis="y", useOffset=False)
    locator: Any = AutoDateLocator(minticks=3, maxticks=8)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_locator(locator)
    shown: Any = ConciseDateFormatter(locator)  # type: ignore[no-untyped-call]
    axes.xaxis.set_major_formatter(shown)
