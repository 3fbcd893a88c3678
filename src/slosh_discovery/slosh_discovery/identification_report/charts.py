"""Charts of an identification: motions with their bands, residual by speed, values by geometry."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_discovery.identification_report.data import Beside, first_mode
from slosh_discovery.identify.result import FittedMotion, Identification, PointAgreement
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_report.page.lines import DASHES, chart_points, draw_line, time_chart, time_ends
from slosh_report.page.svg import (
    GAP,
    INK,
    LINEAR,
    MEASURED,
    NONLINEAR,
    SPAN,
    canvas,
    style,
    svg_text,
)

Size = tuple[float, float]

REACH = 1.25
"""Curves by geometry go so far beyond the containers that were measured."""
CURVE = 80
"""Points of a curve."""
CAP = 3.0
"""Length of an error bar's ends [pt]."""


def heights_chart(motion: FittedMotion, size: Size, name: str) -> str:
    """Measured height, the model before and after with its 95 % band [mm], as SVG text.

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
    """Measured minus model before and after, over twice the noise [mm], as SVG text."""
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
    """Root mean square residual by operating speed [mm] (TM20, Fig. 9), as SVG text."""
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
    """Natural frequency or damping ratio by the container's size (TM20, Fig. 11), as SVG text.

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
    """What geometry and formula say of containers of other sizes, as deeply filled."""
    grid = np.linspace(min(sizes) / REACH, max(sizes) * REACH, CURVE)
    bare = replace(model, effects=(), damping_ratio=None, natural_frequency=None, covariance=None)
    of: Callable[[Model], float] = (
        (lambda one: one.mode_frequency(1))
        if quantity == FREQUENCY
        else (lambda one: one.mode_constants()[0].damping_ratio)
    )
    values = []
    for factor in (grid / model.container.size).tolist():
        try:
            values.append(of(replace(bare, container=bare.container.widened(factor))))
        except SloshModelError:
            values.append(float("nan"))
    return grid, np.array(values)


def _widest(motion: FittedMotion) -> int:
    spans = np.nanmax(motion.measured, axis=0) - np.nanmin(motion.measured, axis=0)
    return int(np.nanargmax(spans))
