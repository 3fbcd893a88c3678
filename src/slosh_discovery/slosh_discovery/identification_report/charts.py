"""Draws residual over speed, and frequency and damping over the size of the container."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import BarycentricInterpolator

from slosh_base.types import Array
from slosh_discovery.identification_report.data import Beside, IdentificationReport, first_mode
from slosh_discovery.identify.result import Identification, PointAgreement
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_report.document import Block, Chart, Figure, Group, explain
from slosh_report.page.svg import DASHES, LINEAR, MEASURED, NONLINEAR, SMALL
from slosh_report.texts import Mark, Text, joined

REACH = 1.25
"""Curves by geometry go so far beyond the containers that were measured."""
CURVE, SOLVED = 80, 5
"""Points of a curve, and how many of them are computed where modes have no closed form."""
CAP = 3.0
"""Length of an error bar's ends [pt]."""


def speed_figure(points: Sequence[PointAgreement], has_own: bool) -> tuple[Block, ...]:
    """Returns a chart of the rms residual [mm] over operating speed (TM20, Fig. 9).

    Args:
        points: the operating points; those of an unknown speed are left out.
        has_own: whether each has a model of its own.
    """
    known = sorted(
        (one for one in points if np.isfinite(one.point.speed)), key=lambda one: one.point.speed
    )
    if len(known) < 2:
        return ()
    keys = [Mark("before", "key linear"), Mark("one model for all", "key nonlinear")]
    keys += [Mark("a model for each", "key")] * has_own
    seen = "Chart of the root mean square residual over the operating speed"
    caption = Mark("rms residual by speed", "b")
    draw = partial(_draw_speeds, known=known)
    return (Figure((Chart("speed", caption, seen, keys=tuple(keys), draw=draw),)),)


def _draw_speeds(axes: Any, *, known: Sequence[PointAgreement]) -> None:
    speeds = [point.point.speed for point in known]
    for key, colour, marker, dashes in (
        ("before", LINEAR, "s", DASHES),
        ("mosm", NONLINEAR, "o", "-"),
        ("sosm", MEASURED, "x", ":"),
    ):
        values = [1e3 * getattr(point, key) for point in known]
        if np.isfinite(values).any():
            axes.plot(speeds, values, color=colour, marker=marker, markersize=4.5,
                      linewidth=1.2, linestyle=dashes)  # fmt: skip
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("operating speed [1/min]")
    axes.set_ylabel("rms residual [mm]")


def geometry_blocks(report: IdentificationReport) -> tuple[Block, ...]:
    """Returns charts of frequency and damping over container size (TM20, Fig. 11)."""
    found = report.found
    charts = tuple(
        Figure((
            Chart(
                quantity, Mark(name, "b"),
                f"Chart of the {name.lower()} over the {found.base.container.size_name}",
                draw=partial(_draw_geometry, found=found, beside=report.beside, quantity=quantity),
                sizes=(SMALL,),
            ),
        ))
        for quantity, name in ((FREQUENCY, "Natural frequency"), (DAMPING, "Damping ratio"))
    )  # fmt: skip
    others: Text = joined((Mark(one.name, "code") for one in report.beside), ", ")
    if report.beside:
        others = (" \xa0 ", Mark("for comparison", "key dot"), " ", others)
    key = explain(
        Mark("by geometry and formula, same fill ratio", "key linear"), " \xa0 ",
        Mark("this container, with its 95 % interval", "key dot own"), others,
    )  # fmt: skip
    return Group(charts, "small-charts"), key


def _draw_geometry(
    axes: Any, *, found: Identification, beside: Sequence[Beside], quantity: str
) -> None:
    own, container = first_mode(found.overall, quantity), found.base.container
    rows = [(container.size, own.value, own.error)]
    rows += [
        (one.model.container.size, *(one.frequency if quantity == FREQUENCY else one.damping))
        for one in beside
        if one.model.container.size_name == container.size_name
    ]
    x, y = curve(found.base, quantity, [row[0] for row in rows])
    axes.plot(1e3 * x, y, color=LINEAR, linewidth=1.3, linestyle=DASHES)
    for number, (place, value, error) in enumerate(rows):
        axes.errorbar(
            1e3 * place, value, 1.96 * error, color=MEASURED if number else NONLINEAR,
            marker="o", markersize=5.0, capsize=CAP, linewidth=1.3,
        )  # fmt: skip
    axes.set_ylim(bottom=0.0 if quantity == DAMPING else None)
    axes.set_xlabel(f"{container.size_name} [mm]")
    axes.set_ylabel("natural frequency [rad/s]" if quantity == FREQUENCY else "damping ratio")


def curve(model: Model, quantity: str, sizes: Sequence[float]) -> tuple[Array, Array]:
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
