"""Draws figures as SVG in the report page's colours, for light and dark mode.

Whatever draws on a page loads matplotlib, the slowest of all imports, only then: a command that
ends at a mistake in its input has not waited for it.
"""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

from slosh_base.types import Array
from slosh_report.page.series import POINTS, envelope, lone

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Stand-ins that matplotlib draws with; each becomes a CSS variable of the page.
COLOURS = {
    "#010101": "var(--measured)",
    "#020202": "var(--linear)",
    "#030303": "var(--nonlinear)",
    "#040404": "var(--limit)",
    "#050505": "var(--ink-soft)",
    "#060606": "var(--grid)",
    "#070707": "var(--span)",
    "#080808": "var(--gap)",
    "#090909": "var(--card)",
}
MEASURED, LINEAR, NONLINEAR, LIMIT, INK, GRID, SPAN, GAP, CARD = COLOURS

STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "font.size": 10.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.facecolor": "none",
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "text.parse_math": False,
    "axes.grid": True,
    "grid.color": GRID,
    "grid.linewidth": 0.8,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "lines.solid_capstyle": "round",
}
MARGINS = (0.62, 0.12, 0.48, 0.2)
"""Left, right, bottom, top [in]: the same for all charts, so that their time axes align."""

WIDE, NARROW = (9.6, 3.3), (4.1, 3.0)
LOW, LOW_NARROW = (9.6, 2.2), (4.1, 2.4)
SMALL = (4.6, 2.4)
"""Sizes [in]: two drawings of each chart, as one scaled to a phone's width has letters that nobody
reads; and one of a motion alone."""
DASHES: Any = (0, (4, 2))


def style(name: str) -> Any:
    """Returns a context manager that sets Matplotlib's drawing style.

    Args:
        name: of the chart; the file is the same each time.
    """
    from matplotlib.style import context

    # From matplotlib's own defaults, whatever the user's matplotlibrc says.
    return context({**STYLE, "svg.hashsalt": name}, after_reset=True)


def canvas(size: tuple[float, float]) -> Figure:
    """Creates an empty figure of a given size [in]."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    width, height = size
    left, right, bottom, top = MARGINS
    figure = Figure(figsize=size)
    FigureCanvasSVG(figure)
    figure.subplots_adjust(left / width, bottom / height, 1.0 - right / width, 1.0 - top / height)
    return figure


def svg_text(figure: Figure, name: str) -> str:
    """Returns a figure as an <svg> element in the colours of the report page.

    Args:
        figure: drawn with COLOURS' stand-ins.
        name: of the chart; its ids begin with it, so that no two charts of a page share one.
    """
    text = io.StringIO()
    figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r' d="[^"]*"', _shorter, svg)
    svg = re.sub(r" font-family: [^;\"]*;", "", svg)  # the page's own font
    svg = re.sub(r">\s+<", "><", svg)
    for stand_in, variable in COLOURS.items():
        svg = svg.replace(stand_in, variable)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r"url\(#", f"url(#{name}-", svg)
    svg = re.sub(r'xlink:href="#', f'xlink:href="#{name}-', svg)
    # The page says how wide it is; the view box keeps the proportions.
    head, body = svg.split(">", 1)
    return re.sub(r'\s(?:width|height)="[^"]*"', "", head) + ">" + body


def _shorter(path: re.Match[str]) -> str:
    """Shortens an SVG path by rounding its numbers to hundredths of a point."""
    text = re.sub(r"(\.\d\d)\d+", r"\1", path.group())
    return re.sub(r"\s+", " ", text)


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
    """Draws a line with gaps, and isolated samples as dots, into a chart.

    Args:
        axes: where to draw.
        t: (N,) [s].
        values: (N,) in SI units; NaN: no sample.
        colour, width, dashes: of the line.
        points: most points; of more, the extremes of each moment are drawn.
        scale: SI → the axis' unit; heights are shown in mm.
    """  # fmt: skip
    t, values = envelope(t, scale * values, points)
    axes.plot(t, values, color=colour, linewidth=width, linestyle=dashes)
    alone = lone(values)
    if alone.any():
        axes.plot(t[alone], values[alone], color=colour, linestyle="none", marker="o",
                  markersize=1.5 * width)  # fmt: skip


def badge(axes: Any, x: float, letter: str) -> None:
    """Draws a letter in a circle above the chart, with a thin line down from it."""
    axes.axvline(x, color=INK, linewidth=0.8, linestyle=(0, (1, 3)))
    axes.annotate(
        letter, (x, 1.0), xycoords=axes.get_xaxis_transform(), xytext=(0, -8),
        textcoords="offset points", ha="center", va="center",
        fontsize=8.0, fontweight="bold",
        bbox={"boxstyle": "circle,pad=0.15", "facecolor": CARD, "edgecolor": INK},
    )  # fmt: skip


def chart_points(size: tuple[float, float]) -> int:
    """Returns the maximum number of points of a line in a figure of a given size [in]."""
    return int(POINTS * size[0] / WIDE[0])
