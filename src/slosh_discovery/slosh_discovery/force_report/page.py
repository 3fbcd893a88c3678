"""Draws the charts and fills the HTML template of the page of a force identification."""

from __future__ import annotations

import json
import math
from typing import Any, NamedTuple

from markupsafe import Markup

from slosh_base.types import Array
from slosh_discovery.force.result import ForceIdentification
from slosh_discovery.force.text import direction, force_json
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_report.page.series import time_ends
from slosh_report.page.svg import (
    INK,
    LINEAR,
    MEASURED,
    NARROW,
    NONLINEAR,
    WIDE,
    chart_points,
    draw_line,
    time_chart,
)
from slosh_report.page.template import make_environment

Size = tuple[float, float]


class Row(NamedTuple):
    """A row of the table of identified quantities.

    Attributes:
        name: of the quantity.
        key: of it in identification.json, with value, standard error and the model's value.
        unit: as it is written.
        digits: decimals.
    """

    name: str
    key: str
    unit: str
    digits: int


ROWS = (
    Row("natural frequency", "natural_frequency_hz", "Hz", 4),
    Row("damping ratio", "damping_ratio", "", 5),
    Row("sloshing mass", "sloshing_mass", "kg", 4),
    Row("container and liquid", "payload_mass", "kg", 3),
    Row("delay of the sensor", "delay", "s", 4),
    Row("stiffness of high waves α", "alpha", "", 2),
)


def render_force(found: ForceIdentification, before: Model, after: Model) -> str:
    """Renders the page as HTML; every text in it is escaped.

    Args:
        found: the result.
        before, after: the model that came in, and that with the identified values.
    """
    template = make_environment("slosh_discovery.force_report").get_template("force.html.j2")
    hertz = found.natural_frequency.value / (2.0 * math.pi)
    document = json.loads(force_json(found))
    return template.render(
        headline=f"First mode at {hertz:.3f} Hz, damping ratio {found.damping_ratio.value:.4f}, "
        f"sloshing mass {found.sloshing_mass.value:.3f} kg",
        found=found,
        doc=document,
        rows=[row for row in ROWS if document[row.key] is not None],
        directions=[(direction(along), direction(to, "f")) for along, to in found.directions],
        charts=_charts(found),
        before=format_model(before),
        after=format_model(after),
    )


def _charts(found: ForceIdentification) -> dict[str, Markup]:
    """Returns the charts of each direction of the motion as SVG, by name."""
    charts = {}
    for place in range(len(found.directions)):
        for width, size in (("wide", WIDE), ("narrow", NARROW)):
            columns = (found.measured[:, place], found.modelled[:, place])
            for kind, liquid in (("force", None), ("liquid", found.liquid[:, place])):
                name = f"{kind}-{place}-{width}"
                charts[name] = Markup(_chart(found.t, *columns, liquid, size, name))
    return charts


def _chart(
    t: Array, measured: Array, modelled: Array, liquid: Array | None, size: Size, name: str
) -> str:
    """Draws measured and modelled force over time [N] as SVG.

    Args:
        t: (n,) [s].
        measured, modelled: (n,) of the sensor [N].
        liquid: (n,) the liquid's part of the model; the rest of the model is taken off then.
        size: of the figure [in].
        name: of the chart.
    """

    def draw(axes: Any) -> None:
        axes.axhline(0.0, color=INK, linewidth=0.8)
        rest = 0.0 if liquid is None else modelled - liquid
        points = chart_points(size)
        for values, colour, width in (
            (measured - rest, MEASURED, 2.0),
            (modelled - rest, LINEAR if liquid is None else NONLINEAR, 1.3),
        ):
            draw_line(axes, t, values, colour, width, "-", points, scale=1.0)
        axes.set_ylabel("force [N]")

    return time_chart(draw, time_ends(t), size, name)
