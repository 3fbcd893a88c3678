"""HTML page of a motion map: table and charts."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

from slosh_machines.design import NamedLaw, heights
from slosh_machines.motion_map import MotionMap
from slosh_model.model import Model
from slosh_report.page.svg import INK, LIMIT, LINEAR, NONLINEAR, canvas, style, svg_text
from slosh_report.page.template import make_environment

SIZE = (6.4, 3.0)
SHOWN = 5
"""Laws that are drawn."""
COMPARED = "quintic"
APART = 0.08
"""Least difference of two laws' peaks that are both labelled."""


def render_map(model: Model, found: MotionMap, name: str) -> str:
    """Renders the HTML page of a motion map; all texts in it are escaped.

    Args:
        model: of the liquid.
        found: the map.
        name: of the model's file.
    """
    template = make_environment("slosh_machines").get_template("motion_map.html.j2")
    charts = [_waves(model, found), _laws(found)]
    return template.render(found=found, name=name, charts=charts, compared=COMPARED)


def _waves(model: Model, found: MotionMap) -> Markup:
    """Draws peak and dwell liquid height over machine speed, and the peak of a standard law."""
    speeds = [row.speed for row in found.rows]
    known = [heights(model, found.stroke, NamedLaw(COMPARED), speed).peak for speed in speeds]
    top = 1.6 * 1e3 * found.limits.height
    with style("waves"):
        figure = canvas(SIZE)
        axes: Any = figure.add_subplot()
        axes.plot(speeds, np.minimum(1e3 * np.array(known), 2.0 * top), color=LINEAR,
                  linestyle=(0, (4, 2)))  # fmt: skip
        axes.plot(speeds, [1e3 * row.found.residual for row in found.rows], color=INK)
        axes.plot(speeds, [1e3 * row.found.peak for row in found.rows], color=NONLINEAR)
        axes.plot(*zip(*((s, 1e3 * one.peak) for s, one in found.checked), strict=True), ".",
                  color=NONLINEAR, markersize=2.5)  # fmt: skip
        axes.axhline(1e3 * found.limits.height, color=LIMIT, linestyle=(0, (1, 2)))
        axes.set_ylim(0.0, top)
        axes.set_xlabel("speed [1/min]")
        axes.set_ylabel("height [mm]")
        return Markup(svg_text(figure, "waves"))


def _laws(found: MotionMap) -> Markup:
    """Draws the acceleration of several time laws over the normalised time."""
    u = np.linspace(0.0, 1.0, 201)
    places = np.unique(np.linspace(0, len(found.rows) - 1, SHOWN).round().astype(int))
    with style("laws"):
        figure = canvas(SIZE)
        axes: Any = figure.add_subplot()
        named = -np.inf
        for n, place in enumerate(places):
            row = found.rows[place]
            axes.plot(u, row.profile.acceleration(u), color=NONLINEAR,
                      alpha=0.3 + 0.7 * (n + 1) / len(places))  # fmt: skip
            at = int(np.argmax(row.profile.acceleration(u)))
            top = float(row.profile.acceleration(u)[at])
            if abs(top - named) > APART * abs(top):  # else the numbers cover each other
                axes.annotate(f"{row.speed:.4g}", (u[at], top), color=INK)
                named = top
        axes.set_xlabel("time by the stroke's duration")
        axes.set_ylabel("a · T² / stroke")
        return Markup(svg_text(figure, "laws"))
