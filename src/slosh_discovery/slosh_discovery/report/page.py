"""Fills the page's template."""

from __future__ import annotations

import base64
import math
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from slosh_discovery.report.charts import NARROW, WIDE, heights_chart, residual_chart
from slosh_discovery.report.data import Frame, RunReport

DASH = "–"  # what stands for a number that is not known


def render_report(report: RunReport) -> str:
    """The page as HTML text, the same for the same report.

    Args:
        report: what to show; every text in it is escaped.
    """
    charts = {
        f"{kind}_{width}": Markup(draw(report, size, f"{kind}-{width}"))
        for kind, draw in (("heights", heights_chart), ("residual", residual_chart))
        for width, size in (("wide", WIDE), ("narrow", NARROW))
    }
    clocks_differ = any(math.isfinite(row.offset) for row in report.models)
    return _template().render(report=report, clocks_differ=clocks_differ, **charts)


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("slosh_discovery.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters.update(
        mm=millimetres, percent=percent, seconds=seconds, rate=rate, data_uri=data_uri
    )
    return environment.get_template("report.html.j2")


def millimetres(metres: float) -> str:
    """0.01234 → '12.34'."""
    return f"{1e3 * metres:.2f}" if math.isfinite(metres) else DASH


def percent(fraction: float) -> str:
    """-0.119 → '−11.9', with its sign."""
    return f"{100.0 * fraction:+.1f}".replace("-", "−") if math.isfinite(fraction) else DASH


def seconds(value: float, digits: int = 2) -> str:
    """1.2345 → '1.23'."""
    return f"{value:.{digits}f}" if math.isfinite(value) else DASH


def rate(hertz: float) -> str:
    """999.6 → '1000'; 59.94 → '59.9'."""
    if not math.isfinite(hertz):
        return DASH
    return f"{hertz:.0f}" if hertz >= 100.0 else f"{hertz:.1f}"


def data_uri(frame: Frame) -> str:
    """The image as a data URI."""
    return f"data:{frame.media_type};base64,{base64.b64encode(frame.image).decode('ascii')}"
