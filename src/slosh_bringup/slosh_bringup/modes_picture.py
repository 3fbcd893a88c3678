"""Draws a container and its sloshing modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from slosh_base.types import Array
from slosh_bringup.simulate.chart import new_picture
from slosh_model.mode_table import ModeRow
from slosh_model.model import Model
from slosh_model.shapes.profiled import cut_above

_MM = 1e3
_LIQUID, _WALL = "#cfe5f5", "#333333"
_HIGH = 0.25
"""Height of a drawn wave at the wall, of the surface's radius."""


def write_modes_picture(path: Path, model: Model, rows: tuple[ModeRow, ...]) -> None:
    """Draws the container, the liquid at rest and the mode shapes to a file.

    Along x, and along y if the container looks another from there.

    Of a prism its outline and the direction of each mode.

    Args:
        path: .png or .svg.
        model: the model.
        rows: its modes.

    Raises:
        OSError: the file cannot be written.
    """
    plan = model.container.corners * model.container.reaches
    views = 1
    if not len(plan):
        along, across = (model.container.side_view(axis) for axis in (0, 1))
        if np.array_equal(along, across):
            rows = tuple(row for row in rows if row.axis == "x")
        views += any(row.axis == "y" for row in rows)
    count = len(rows) // views
    with new_picture(path, (3.0 * count, 4.6 if views == 1 else 5.6)) as figure:
        axes = figure.subplots(views, count, sharex="row", sharey="row", squeeze=False)
        for one, row in zip(axes.flat, rows, strict=True):
            if len(plan):
                draw_direction(one, plan, row)
            else:
                draw_mode(one, model, row)
        figure.supylabel("y [mm]" if len(plan) else "height above the still surface [mm]")
        figure.suptitle(model.container.described)


def draw_direction(axes: Axes, plan: Array, row: ModeRow) -> None:
    """Draws a prism's outline (N, 2) [m] from above and the direction of a mode."""
    axes.fill(*_MM * plan.T, facecolor=_LIQUID, edgecolor=_WALL, linewidth=1.6)
    along = _MM * np.array([np.cos(row.azimuth), np.sin(row.azimuth)])
    reach = 0.5 * float(np.abs(plan @ along).max()) / _MM
    axes.annotate(
        "", tuple(reach * along), tuple(-reach * along),
        arrowprops={"arrowstyle": "<->", "color": "#c0392b", "linewidth": 1.6},
        annotation_clip=False,
    )  # fmt: skip
    _entitled(axes, row)


def _entitled(axes: Axes, row: ModeRow) -> None:
    axes.set_aspect("equal")
    axes.set_title(
        f"mode {row.number}: {row.natural_frequency / (2.0 * np.pi):.3f} Hz\n"
        f"ζ {row.damping_ratio:.4f}, mass {100.0 * row.mass_ratio:.1f} %",
        fontsize=9,
    )
    axes.set_xlabel("x [mm]")


def draw_mode(axes: Axes, model: Model, row: ModeRow) -> None:
    """Draws a container from the side, the liquid at rest and the shape of one mode."""
    container, axis = model.container, "xy".index(row.axis)
    wall = _MM * container.side_view(axis)
    both = np.vstack([wall[::-1] * [-1.0, 1.0], wall])
    fill_below(axes, wall)
    axes.plot(*both.T, color=_WALL, linewidth=1.6)
    places, heights = container.surface_shape(row.number, axis)
    reach = _MM * places[-1]
    top = float(wall[:, 1].max())
    high = min(_HIGH * reach, 0.9 * top) / max(float(np.abs(heights).max()), 1.0)
    x = np.concatenate([-_MM * places[::-1], _MM * places])
    y = high * np.concatenate([-heights[::-1], heights])
    axes.plot(x, y, color="#c0392b", linewidth=1.6)
    axes.axhline(0.0, color="#2c7fb8", linewidth=0.6, linestyle=":")
    axes.plot(
        [0.0], [_MM * row.mass_height], "o", color=_WALL, markersize=3.0 + 9.0 * row.mass_ratio
    )
    _entitled(axes, row)
    axes.set_xlabel(f"{row.axis} [mm]")


def fill_below(axes: Axes, wall: Array) -> None:
    """Fills the area below the still surface inside a wall profile (N, 2) [mm]."""
    wet = cut_above(wall, 0.0)
    first = int(np.flatnonzero(wet[:, 1] <= 0.0)[0])
    inner = wet[first, 0] if first else 0.0
    right = np.vstack([[inner, 0.0], wet[first:]])
    for side in (1.0, -1.0):
        axes.fill(side * right[:, 0], right[:, 1], color=_LIQUID, linewidth=0.0)
