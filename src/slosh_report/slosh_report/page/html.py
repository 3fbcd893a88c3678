"""Renders a document as one self-contained HTML page."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from functools import cache

from jinja2 import Template
from markupsafe import Markup

from slosh_report.document import ROWS, Block, Chart, Column, Document, Figure, Group, Size, Table
from slosh_report.page.charts import chart_svg, series_element, time_axis
from slosh_report.page.template import breakable, make_environment, readable, script
from slosh_report.texts import Bars, Mark, Number, Text, words

VERDICTS = {"✓": "passed", "✗": "failed", "?": "open"}
"""Classes of a verdict by the sign that it begins with."""
ELEMENTS = ("b", "code", "ins")
LIVE = (("slosh_report", "uplot/uPlot.iife.min.js"), ("slosh_report.page", "closer.js"))
SORT = ("slosh_report.page", "sort.js")


def html_page(document: Document, after: str = "") -> str:
    """Renders a document as HTML; equal documents give equal pages.

    Args:
        document: what to show; every text in it is escaped.
        after: an element of the page's end that is not shown, as HTML.
    """
    blocks = list(_all_blocks(document))
    charts = [chart for one in blocks if isinstance(one, Figure) for chart in one.charts]
    live = [chart for chart in charts if chart.live]
    sorts = any(isinstance(block, Table) and block.sorts for block in blocks)
    names = [*(LIVE if live else ()), *([SORT] if sorts else ())]
    return _template().render(
        doc=document,
        rows=ROWS,
        sheets=["report.css", *["uPlot.min.css"] * bool(live)],
        scripts=[script(*name) for name in names],
        after=Markup(after) + (series_element(live) if live else ""),
    )


def _all_blocks(document: Document) -> Iterator[Block]:
    found = [*document.head, *(block for section in document.shown for block in section.blocks)]
    while found:
        block = found.pop(0)
        yield block
        if isinstance(block, Group):
            found[:0] = block.blocks


@cache
def _template() -> Template:
    environment = make_environment("slosh_report.page")
    environment.filters.update(
        inline=inline, cell=table_cell, words=words, kind=lambda block: type(block).__name__,
        drawn=_drawn, on_page=lambda one: one.shown("page"), time_axis=time_axis,
    )  # fmt: skip
    return environment.get_template("html.j2")


def inline(text: Text) -> Markup:
    """Returns a text as HTML: numbers with their exact values, parts in their elements."""
    if isinstance(text, str):
        return Markup("{}").format(readable(text))
    if isinstance(text, Number):
        return _number(text)
    if isinstance(text, Bars):
        return Markup("").join(_bar(*bar) for bar in text.bars)
    if isinstance(text, Mark):
        return _marked(text)
    return Markup("").join(map(inline, text))


def _number(number: Number) -> Markup:
    known = number.value is not None and math.isfinite(number.value)
    value = json.dumps(number.value if known else None)
    path = Markup(' data-path="{}"').format(number.path) if number.path else ""
    return Markup('<data value="{}"{}>{}</data>').format(value, path, readable(number.text))


def _marked(mark: Mark) -> Markup:
    first, *classes = mark.kind.split() or [""]
    element = "a" if mark.link else first if first in ELEMENTS else "span"
    kind = " ".join(classes if element == first else mark.kind.split())
    attributes = Markup("").join(
        Markup(' {}="{}"').format(name, readable(value))
        for name, value in (("class", kind), ("title", mark.title), ("href", mark.link))
        if value
    )
    broken = element == "code" and isinstance(mark.text, str)
    inner = breakable(str(mark.text)) if broken else inline(mark.text)
    return Markup("<{0}{1}>{2}</{0}>").format(element, attributes, inner)


def _bar(value: float | None, length: float, kind: str) -> Markup:
    if value is None or not length > 0.0:
        return Markup("")
    width = f"{100.0 * min(max(value / length, 0.0), 1.0):.1f}"
    return Markup('<span class="bar {}" style="width: {}%"></span>').format(kind, width)


def table_cell(text: Text, column: Column, first: bool) -> Markup:
    """Returns a cell of a table as HTML; the first one of a row is its heading."""
    kind = column.kind
    if kind == "verdict" and isinstance(text, str):
        kind = f"verdict {VERDICTS.get(text[:1], '')}".rstrip()
    head = first and column.kind != "n"
    inner = breakable(text) if column.kind == "name" and isinstance(text, str) else inline(text)
    attributes = Markup(' scope="row"' if head else "")
    attributes += Markup(' class="{}"').format(kind) if kind else ""
    attributes += Markup(' aria-hidden="true"' if kind == "bars" else "")
    return Markup("<{0}{1}>{2}</{0}>").format("th" if head else "td", attributes, inner)


def _drawn(chart: Chart, size: Size) -> Markup:
    wide = len(chart.sizes) == 1 or size == chart.sizes[0]
    suffix = "" if len(chart.sizes) == 1 else "-wide" if wide else "-narrow"
    return Markup(chart_svg(chart, size, chart.name + suffix))
