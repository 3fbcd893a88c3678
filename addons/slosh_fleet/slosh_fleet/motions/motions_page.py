"""HTML page about months of stored motions: trends, events by shift, the worst motions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from markupsafe import Markup

from slosh_fleet.motions.query import TABLE, MotionTable
from slosh_fleet.motions.store import FleetStore
from slosh_report.page.svg import LINEAR, MEASURED, NONLINEAR, canvas, style, svg_text
from slosh_report.page.template import make_environment

SIZE = (6.4, 2.6)
MOST_LINES: Final = 3
"""Containers whose trend is drawn in a chart, those that have changed most first."""
MOST_CONTAINERS: Final = 50
"""Rows of the table of all containers."""
WORST: Final = 20
_LINES = ((NONLINEAR, "-"), (LINEAR, "--"), (MEASURED, "-"))
"""Colours and dashes of a chart's lines, as the template's keys have them."""
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


class Trend(NamedTuple):
    """A chart of a quantity's daily medians; `drawing` is empty if there are no values."""

    name: str
    label: str
    drawing: Markup | str
    lines: Sequence[str] = ()


class BagLink(NamedTuple):
    """A bag's path, with its URL if the bag is on this machine's disk."""

    path: str
    url: str


def render_fleet(store: FleetStore) -> str:
    """Renders the HTML page of a store of motions; all texts in it are escaped.

    Raises:
        SloshBagError: DuckDB is not installed, or the store is empty.
    """
    template = make_environment("slosh_fleet.motions").get_template("motions.html.j2")
    with MotionTable(store, loaded=_COLUMNS) as table:
        ((motions, cells, first, last),) = table.query(_OVERVIEW).rows
        drifts = [Drift(*row) for row in table.query(_DRIFTS).rows]
        return template.render(
            place=store.url, motions=motions, cells=cells, first=first, last=last,
            months=table.query(_MONTHS).rows, shifts=table.query(_SHIFTS).rows,
            worst=[(*row[:-1], _link(row[-1])) for row in table.query(_WORST).rows],
            drifts=drifts[:MOST_CONTAINERS], containers=len(drifts),
            trends=[
                _trend(table, _most_changed(drifts, number), *chart)
                for number, chart in enumerate(CHARTS)
            ],
        )  # fmt: skip


def _most_changed(drifts: Sequence[Drift], number: int) -> list[Drift]:
    """Returns the containers whose value in a chart has changed most, in the order of `drifts`."""
    changes = [(one.frequency_change, one.damping_change, one.level_change) for one in drifts]
    known = [(abs(own[number] or 0.0), -row) for row, own in enumerate(changes)
             if own[number] is not None]  # fmt: skip
    chosen = sorted(-row for _, row in sorted(known, reverse=True)[:MOST_LINES])
    return [drifts[row] for row in chosen]


def _trend(
    table: MotionTable, drifts: Sequence[Drift], name: str, column: str, label: str, factor: float
) -> Trend:
    """Draws the daily medians of a column of the stored motions, one line per container."""
    from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

    sql = _TREND.format(column=column)
    found = [table.query(sql, (one.cell, one.model)).rows for one in drifts]
    if not any(found):
        return Trend(name, label, "")
    with style(name):
        figure = canvas(SIZE)
        axes: Any = figure.add_subplot()
        for rows, (colour, dashes) in zip(found, _LINES, strict=False):
            days = [day for day, _ in rows]
            values = [factor * value for _, value in rows]
            axes.plot(days, values, dashes, marker=".", markersize=4.0, color=colour)
        axes.ticklabel_format(axis="y", useOffset=False)
        locator: Any = AutoDateLocator(minticks=3, maxticks=8)  # type: ignore[no-untyped-call]
        axes.xaxis.set_major_locator(locator)
        shown: Any = ConciseDateFormatter(locator)  # type: ignore[no-untyped-call]
        axes.xaxis.set_major_formatter(shown)
        drawing = Markup(svg_text(figure, name))
    return Trend(name, label, drawing, [one.title for one in drifts])


def _link(bag: str) -> BagLink:
    path = Path(bag)
    return BagLink(bag, path.as_uri() if path.is_absolute() else "")
