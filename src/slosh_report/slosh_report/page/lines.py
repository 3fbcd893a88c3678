"""What charts over time share: sizes, lines with gaps, letters, and the axis itself."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_report.page.series import POINTS, envelope, lone
from slosh_report.page.svg import CARD, INK, canvas, style, svg_text

WIDE = (9.6, 3.3)
NARROW = (4.1, 3.0)
SMALL = (4.6, 2.4)
"""Sizes [in]: two drawings of each chart, as one scaled to a phone's width has letters that nobody
reads; and one of a motion alone."""
DASHES: Any = (0, (4, 2))


def time_chart(
    draw: Callable[[Any], None], ends: tuple[float, float], size: tuple[float, float], name: str
) -> str:
    """A chart over time as SVG text.

    Args:
        draw: draws into the axes, after their ends are set.
        ends: of the time axis [s].
        size: of the figure [in].
        name: of the chart; see svg_text.
    """
    with style(name):
        figure = canvas(size)
        axes = figure.add_subplot()
        axes.set_xlim(*ends)
        draw(axes)
        axes.set_xlabel("time [s]")
        return svg_text(figure, name)


def draw_line(
    axes: Any,
    t: Array,
    values: Array,
    colour: str,
    width: float,
    dashes: Any,
    points: int,
    *,
    scale: float = 1e3,
) -> None:
    """A line with its gaps open and single samples as dots.

    Args:
        axes: where to draw.
        t: (N,) [s].
        values: (N,) in SI units; NaN: no sample.
        colour, width, dashes: of the line.
        points: most points; of more, the extremes of each moment are drawn.
        scale: SI → the axis' unit; heights are shown in mm.
    """  # fmt: skip
    if np.isfinite(values).sum() > points:
        dashes = "-"  # between extremes there is no room for dashes
    t, values = envelope(t, scale * values, points)
    axes.plot(t, values, color=colour, linewidth=width, linestyle=dashes)
    alone = lone(values)
    if alone.any():
        axes.plot(t[alone], values[alone], color=colour, linestyle="none", marker="o",
                  markersize=1.5 * width)  # fmt: skip


def badge(axes: Any, x: float, letter: str) -> None:
    """A letter in a circle on top of the chart, with a thin line down from it."""
    axes.axvline(x, color=INK, linewidth=0.8, linestyle=(0, (1, 3)))
    axes.annotate(
        letter, (x, 1.0), xycoords=axes.get_xaxis_transform(), xytext=(0, -8),
        textcoords="offset points", ha="center", va="center",
        fontsize=8.0, fontweight="bold",
        bbox={"boxstyle": "circle,pad=0.15", "facecolor": CARD, "edgecolor": INK},
    )  # fmt: skip


def chart_points(size: tuple[float, float]) -> int:
    """Most points of a line in a figure of that size [in]."""
    return int(POINTS * size[0] / WIDE[0])


def time_ends(t: Array) -> tuple[float, float]:
    """Of the time axis, the same for all charts, whatever series they show."""
    if len(t) < 2:
        return (0.0, 1.0) if not len(t) else (float(t[0]) - 0.5, float(t[0]) + 0.5)
    margin = 0.01 * float(t[-1] - t[0])
    return float(t[0]) - margin, float(t[-1]) + margin
