"""Figures as SVG text in the page's own colours, so that light and dark are one file.

Whatever draws on a page loads matplotlib, the slowest of all imports, only then: a command that
ends at a mistake in its input has not waited for it.
"""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

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


def style(name: str) -> Any:
    """What to draw under, `with` it.

    Args:
        name: of the chart; the file is the same each time.
    """
    from matplotlib.style import context

    # From matplotlib's own defaults, whatever the user's matplotlibrc says.
    return context({**STYLE, "svg.hashsalt": name}, after_reset=True)


def canvas(size: tuple[float, float]) -> Figure:
    """An empty figure of that size [in]."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    width, height = size
    left, right, bottom, top = MARGINS
    figure = Figure(figsize=size)
    FigureCanvasSVG(figure)
    figure.subplots_adjust(left / width, bottom / height, 1.0 - right / width, 1.0 - top / height)
    return figure


def svg_text(figure: Figure, name: str) -> str:
    """The figure as an <svg> element in the page's colours.

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
    """A path with hundredths of a point and without line breaks: a third of the size."""
    text = re.sub(r"(\.\d\d)\d+", r"\1", path.group())
    return re.sub(r"\s+", " ", text)
