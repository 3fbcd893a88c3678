"""A motion map as a document: table and charts."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from slosh_machines.design import NamedLaw, heights
from slosh_machines.motion_map import MotionMap
from slosh_model.model import Model
from slosh_report.document import (
    Chart,
    Column,
    Document,
    Figure,
    Lines,
    Paragraph,
    Section,
    explain,
    table,
)
from slosh_report.page.svg import INK, LIMIT, LINEAR, NARROW, NONLINEAR
from slosh_report.texts import Mark, Number

SIZE = (6.4, 3.0)
SHOWN = 5
"""Laws that are drawn."""
COMPARED = "quintic"
APART = 0.08
"""Least difference of two laws' peaks that are both labelled."""


def map_document(
    model: Model, found: MotionMap, name: str, data: Mapping[str, Any], lines: tuple[str, ...]
) -> Document:
    """Returns a motion map as a document.

    Args:
        model: of the liquid.
        found: the map.
        name: of the model's file.
        data: the results for programs.
        lines: the short text.
    """
    first, last, stroke = found.rows[0].speed, found.rows[-1].speed, found.stroke
    height, residual = 1e3 * found.limits.height, 1e3 * found.limits.residual
    subtitle = (
        f"stroke {stroke.length:g} m during {stroke.ratio:g} of the cycle, {name}; height up to "
        f"{height:.4g} mm, in the dwell up to {residual:.4g} mm"
    )
    reason = f"No safe stroke above {last:.4g}/min: {found.reason}." if found.reason else ""
    keys = (
        Mark("peak of the map’s law", "key nonlinear"),
        Mark(f"peak of the {COMPARED} law", "key linear"),
        "dark line: height in the dwell",
    )
    waves = Chart(
        "waves", "", "Heights by speed", keys=keys, sizes=(SIZE, NARROW),
        draw=partial(_draw_waves, model=model, found=found),
    )  # fmt: skip
    laws = Chart(
        "laws", "Normalised acceleration at some speeds [1/min]",
        "Normalised acceleration over the stroke", sizes=(SIZE, NARROW),
        draw=partial(_draw_laws, found=found),
    )  # fmt: skip
    meaning = (
        "Greatest heights over many cycles. Dots: interpolated speeds that were simulated. "
        "Dotted: limit."
    )
    columns = (
        Column("speed [1/min]", lambda row: f"{row.speed:.4g}", "n"),
        Column("duration [s]", lambda row: Number(stroke.duration(row.speed), "s", 3), "n"),
        Column("peak [mm]", lambda row: Number(row.found.peak, "mm"), "n"),
        Column("in the dwell [mm]", lambda row: Number(row.found.residual, "mm"), "n"),
        Column("acceleration [m/s²]", lambda row: Number(row.found.acceleration, "m/s²"), "n"),
        Column("jerk [m/s³]", lambda row: Number(row.found.jerk, "m/s³"), "n"),
    )
    rows = table(
        "Heights, acceleration and jerk by speed", columns, found.rows, seen=False,
        most=len(found.rows),
    )  # fmt: skip
    return Document(
        f"Strokes for {first:.4g} to {last:.4g} cycles per minute",
        (Paragraph(subtitle, "subtitle"), Paragraph(reason, "explain")),
        (
            Section("Waves by speed", (Figure((waves,)), explain(meaning)), "waves"),
            Section("Laws", (Figure((laws,)),), "laws"),
            Section("Rows", (rows,), "rows"),
        ),
        data,
        (Lines(lines),),
    )


def _draw_waves(axes: Any, *, model: Model, found: MotionMap) -> None:
    """Draws peak and dwell liquid height over machine speed, and the peak of a standard law."""
    speeds = [row.speed for row in found.rows]
    known = [heights(model, found.stroke, NamedLaw(COMPARED), speed).peak for speed in speeds]
    top = 1.6 * 1e3 * found.limits.height
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


def _draw_laws(axes: Any, *, found: MotionMap) -> None:
    """Draws the acceleration of several time laws over the normalised time."""
    u = np.linspace(0.0, 1.0, 201)
    places = np.unique(np.linspace(0, len(found.rows) - 1, SHOWN).round().astype(int))
    named = -np.inf
    for n, place in enumerate(places):
        row = found.rows[place]
        values = row.profile.acceleration(u)
        axes.plot(u, values, color=NONLINEAR, alpha=0.3 + 0.7 * (n + 1) / len(places))
        at = int(np.argmax(values))
        top = float(values[at])
        if abs(top - named) > APART * abs(top):  # else the numbers cover each other
            axes.annotate(f"{row.speed:.4g}", (u[at], top), color=INK)
            named = top
    axes.set_xlabel("time by the stroke's duration")
    axes.set_ylabel("a · T² / stroke")
