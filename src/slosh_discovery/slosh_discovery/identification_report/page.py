"""Draws the charts and fills the HTML template of an identification's page."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from jinja2 import Template
from markupsafe import Markup
from scipy.interpolate import BarycentricInterpolator

from slosh_base.types import Array
from slosh_discovery.discover.finding import Role
from slosh_discovery.identification_report import text as words
from slosh_discovery.identification_report.data import (
    Beside,
    Document,
    IdentificationReport,
    first_mode,
    identification_document,
)
from slosh_discovery.identification_report.text import minus, rounded, shown_value
from slosh_discovery.identify.result import (
    FittedMotion,
    Identification,
    IdentifiedModel,
    PointAgreement,
)
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_report.page.series import time_ends
from slosh_report.page.svg import (
    DASHES,
    GAP,
    INK,
    LINEAR,
    MEASURED,
    NARROW,
    NONLINEAR,
    SMALL,
    SPAN,
    WIDE,
    canvas,
    chart_points,
    draw_line,
    style,
    svg_text,
    time_chart,
)
from slosh_report.page.template import data_element, make_environment
from slosh_report.page.units import shown

ROWS = 100
"""Most rows of a table on the page; the JSON document holds them all."""
DRAWN = 6
"""Most motions that are drawn."""
LOW = (9.6, 2.2)
LOW_NARROW = (4.1, 2.4)
NAN = float("nan")

Size = tuple[float, float]

REACH = 1.25
"""Curves by geometry go so far beyond the containers that were measured."""
CURVE, SOLVED = 80, 5
"""Points of a curve, and how many of them are computed where modes have no closed form."""
CAP = 3.0
"""Length of an error bar's ends [pt]."""


def render_identification(report: IdentificationReport) -> str:
    """Renders the HTML page of an identification; every text in it is escaped."""
    found, document = report.found, identification_document(report)
    drawn = drawn_motions(found.motions)
    speeds = [point for point in found.points if point.point.speed == point.point.speed]
    return _template().render(
        report=report,
        doc=document,
        rows=ROWS,
        headline=words.headline(report),
        held=[words.held_sentence(one) for one in found.overall.held],
        single_names=_single_names(document),
        drawn=drawn,
        noise=[_noise_of(found, found.motions[index]).noise.stddev for index in drawn],
        charts=_charts(report, drawn, len(speeds) > 1),
        seen=[_seen(document, index) for index in drawn],
        by_speed=len(speeds) > 1,
        size=found.base.container.size_name,
        model_lines=_changes(document["base"]["text"], document["overall"]["model"]["text"]),
    )


def drawn_motions(motions: Sequence[FittedMotion]) -> list[int]:
    """Returns the indices of the motions to draw: held-out ones, then one per operating point."""
    held = [index for index, motion in enumerate(motions) if motion.role is Role.HOLDOUT]
    firsts = {motion.point: index for index, motion in reversed(list(enumerate(motions)))}
    spread = sorted(set(firsts.values()) - set(held))
    # A fitted motion is always among them: the reader sees what the parameters come from.
    held = held[: DRAWN // 2]
    room = max(DRAWN - len(held), 1)
    step = max(len(spread) / room, 1.0)
    chosen = [spread[int(number * step)] for number in range(min(room, len(spread)))]
    return sorted({*chosen, *held})


def _noise_of(found: Identification, motion: FittedMotion) -> IdentifiedModel:
    """Returns the identified model of a motion's operating point, else that of all motions."""
    own = [one for one in found.single if one.label == motion.point]
    return own[0] if own else found.overall


def _charts(report: IdentificationReport, drawn: Sequence[int], speeds: bool) -> dict[str, Markup]:
    """Returns the charts of an identification's HTML page as SVG, by name."""
    found = report.found
    charts: dict[str, str] = {}
    for index in drawn:
        motion = found.motions[index]
        noise = _noise_of(found, motion).noise.stddev
        for width, size, low in (("wide", WIDE, LOW), ("narrow", NARROW, LOW_NARROW)):
            name = f"motion-{index}-{width}"
            charts[name] = heights_chart(motion, size, name)
            name = f"residual-{index}-{width}"
            charts[name] = residual_chart(motion, noise, low, name)
    if speeds:
        for width, size in (("wide", WIDE), ("narrow", NARROW)):
            charts[f"speed-{width}"] = speed_chart(found.points, size, f"speed-{width}")
    for quantity in (FREQUENCY, DAMPING):
        charts[quantity] = geometry_chart(found, report.beside, quantity, SMALL, quantity)
    return {name: Markup(svg) for name, svg in charts.items()}


def _single_names(document: Document) -> list[str]:
    """Returns the parameter names of the models of single operating points, in order."""
    rows = [entry["name"] for one in document["single"] for entry in one["parameters"]]
    return list(dict.fromkeys(rows))


def _seen(document: Document, index: int) -> str:
    """Describes the chart of a motion in words, for screen readers."""
    row = document["motions"][index]
    return (
        f"Line chart of {row['name']}: measured up to {shown(row['peak'], 'mm')} mm; rms residual "
        f"{shown(row['seoe_before'], 'mm')} mm before, {shown(row['seoe'], 'mm')} mm after."
    )


def _changes(base: str, model: str) -> list[tuple[bool, str]]:
    """Returns the lines of a model file, each with whether it is new relative to the base."""
    lines = difflib.ndiff(base.splitlines(), model.splitlines())
    return [(line[0] == "+", line[2:]) for line in lines if line[0] in "+ "]


def value(path: str, entry: Document, key: str = "value") -> Markup:
    """Formats a number of a parameter as HTML, in the displayed unit and rounded by its error."""
    known = NAN if entry[key] is None else entry[key]
    error = NAN if entry["error"] is None else entry["error"]
    if key == "error":
        text = shown_value("", entry["unit"], 0.0, error).error
    else:
        text = rounded(entry["unit"], known, error)
    return data_element(f"{path}/{key}", entry[key], text)


def unit(entry: Document) -> str:
    """Returns the unit in which a parameter is displayed."""
    return shown_value("", entry["unit"], 0.0, NAN).unit


def correlation(path: str, number: float | None) -> Markup:
    """Formats a correlation with two digits as HTML."""
    return data_element(path, number, "–" if number is None else minus(f"{number:.2f}"))


@cache
def _template() -> Template:
    environment = make_environment("slosh_discovery.identification_report")
    environment.globals.update(value=value, unit=unit, correlation=correlation)
    return environment.get_template("identification.html.j2")


def heights_chart(motion: FittedMotion, size: Size, name: str) -> str:
    """Draws measured heights, both models (base, identified) and the 95 % band [mm] as SVG.

    Of heights at several azimuths the one that moves most is shown.
    """
    column = _widest(motion)

    def draw(axes: Any) -> None:
        axes.axhline(0.0, color=INK, linewidth=0.8)
        after, band = 1e3 * motion.after[:, column], 1e3 * motion.band[:, column]
        axes.fill_between(motion.t, after - band, after + band, color=SPAN, linewidth=0.0)
        points = chart_points(size)
        for values, colour, width, dashes in (
            (motion.measured, MEASURED, 2.0, "-"),
            (motion.before, LINEAR, 1.3, DASHES),
            (motion.after, NONLINEAR, 1.3, "-"),
        ):
            draw_line(axes, motion.t, values[:, column], colour, width, dashes, points)
        axes.set_ylabel("height [mm]")

    return time_chart(draw, time_ends(motion.t), size, name)


def residual_chart(motion: FittedMotion, noise: float, size: Size, name: str) -> str:
    """Draws the residuals over time [mm], with two standard deviations of noise, as SVG."""
    column = _widest(motion)

    def draw(axes: Any) -> None:
        axes.axhspan(-2e3 * noise, 2e3 * noise, color=GAP, linewidth=0.0)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        points = chart_points(size)
        for values, colour, dashes in (
            (motion.before, LINEAR, DASHES),
            (motion.after, NONLINEAR, "-"),
        ):
            rest = (motion.measured - values)[:, column]
            draw_line(axes, motion.t, rest, colour, 1.3, dashes, points)
        axes.set_ylabel("measured − model [mm]")

    return time_chart(draw, time_ends(motion.t), size, name)


def speed_chart(points: Sequence[PointAgreement], size: Size, name: str) -> str:
    """Draws the rms residual [mm] over operating speed (TM20, Fig. 9) as SVG."""
    known = sorted(
        (point for point in points if np.isfinite(point.point.speed)),
        key=lambda point: point.point.speed,
    )
    speeds = [point.point.speed for point in known]
    with style(name):
        figure = canvas(size)
        axes = figure.add_subplot()
        for key, colour, marker, dashes in (
            ("before", LINEAR, "s", DASHES),
            ("mosm", NONLINEAR, "o", "-"),
            ("sosm", MEASURED, "x", ":"),
        ):
            values = [1e3 * getattr(point, key) for point in known]
            if np.isfinite(values).any():
                axes.plot(
                    speeds, values, color=colour, marker=marker, markersize=4.5,
                    linewidth=1.2, linestyle=dashes,
                )  # fmt: skip
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("operating speed [1/min]")
        axes.set_ylabel("rms residual [mm]")
        return svg_text(figure, name)


def geometry_chart(
    found: Identification, beside: Sequence[Beside], quantity: str, size: Size, name: str
) -> str:
    """Draws frequency or damping ratio over container size (TM20, Fig. 11) as SVG.

    Args:
        found: gives the point of this container.
        beside: further points.
        quantity: `natural_frequency` or `damping_ratio`.
        size: of the figure [in].
        name: of the chart.
    """
    own = first_mode(found.overall, quantity)
    rows = [(found.base.container.size, own.value, own.error)]
    rows += [
        (one.model.container.size, *(one.frequency if quantity == FREQUENCY else one.damping))
        for one in beside
        if one.model.container.size_name == found.base.container.size_name
    ]
    with style(name):
        figure = canvas(size)
        axes = figure.add_subplot()
        x, y = _curve(found.base, quantity, [row[0] for row in rows])
        axes.plot(1e3 * x, y, color=LINEAR, linewidth=1.3, linestyle=DASHES)
        for number, (place, value, error) in enumerate(rows):
            axes.errorbar(
                1e3 * place, value, 1.96 * error, color=MEASURED if number else NONLINEAR,
                marker="o", markersize=5.0, capsize=CAP, linewidth=1.3,
            )  # fmt: skip
        axes.set_ylim(bottom=0.0 if quantity == DAMPING else None)
        axes.set_xlabel(f"{found.base.container.size_name} [mm]")
        axes.set_ylabel("natural frequency [rad/s]" if quantity == FREQUENCY else "damping ratio")
        return svg_text(figure, name)


def _curve(model: Model, quantity: str, sizes: Sequence[float]) -> tuple[Array, Array]:
    """Returns a quantity's theoretical curve over container size, for equal relative filling."""
    grid = np.linspace(min(sizes) / REACH, max(sizes) * REACH, CURVE)
    bare = replace(model, effects=(), damping_ratio=None, natural_frequency=None, covariance=None)
    of: Callable[[Model], float] = (
        (lambda one: one.mode_frequency(1))
        if quantity == FREQUENCY
        else (lambda one: one.mode_constants()[0].damping_ratio)
    )
    # Modes that must be computed at few sizes, with a polynomial through their logarithms.
    computed = bool(bare.container.digest)
    places = np.geomspace(grid[0], grid[-1], SOLVED) if computed else grid
    values = []
    for factor in (places / model.container.size).tolist():
        try:
            values.append(of(replace(bare, container=bare.container.widened(factor))))
        except SloshModelError:
            values.append(float("nan"))
    known = np.isfinite(values)
    if computed and known.any():
        inside = (grid >= places[known][0]) & (grid <= places[known][-1])
        through = BarycentricInterpolator(np.log(places[known]), np.log(np.array(values)[known]))
        return grid[inside], np.exp(through(np.log(grid[inside])))
    return places, np.array(values)


def _widest(motion: FittedMotion) -> int:
    spans = np.nanmax(motion.measured, axis=0) - np.nanmin(motion.measured, axis=0)
    return int(np.nanargmax(spans))
