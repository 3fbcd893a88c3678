"""Renders a validation report as an HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from jinja2 import Template
from markupsafe import Markup

from slosh_fleet.validation.content import ValidationReport
from slosh_fleet.validation.seal import content_digest, content_of, envelope, seal_line, sealed
from slosh_fleet.validation.sections import VERDICTS, sections, summary
from slosh_report.blocks import Chart
from slosh_report.page.svg import NARROW, WIDE
from slosh_report.page.template import make_environment
from slosh_report.run_report.charts import heights_chart
from slosh_report.run_report.data import RunReport


def validation_page(report: ValidationReport, runs: Sequence[RunReport]) -> bytes:
    """Renders a validation report as a sealed HTML page; equal reports give equal bytes.

    Args:
        report: what is signed; every text in it is escaped.
        runs: reports of the recordings' replays, in the order of `report.recordings`.
    """
    content = content_of(report)
    digest = content_digest(content)
    found = sections(report, digest)
    charts = {
        f"{block.recording}-{name}": Markup(
            heights_chart(runs[block.recording], size, f"run-{block.recording}-{name}")
        )
        for section in found
        for block in section.blocks
        if isinstance(block, Chart)
        for name, size in (("wide", WIDE), ("narrow", NARROW))
    }
    text = _template().render(
        report=report, sections=found, digest=digest, charts=charts, runs=runs,
        verdict=VERDICTS[report.verdict], summary=summary(report),
        carried=Markup(envelope(content)), seal=seal_line(),
    )  # fmt: skip
    return sealed(text.encode("utf-8", "replace"))


@cache
def _template() -> Template:
    environment = make_environment("slosh_fleet.validation")
    environment.tests["number"] = lambda cell: not isinstance(cell, str)
    environment.filters["kind"] = lambda block: type(block).__name__
    return environment.get_template("validation.html.j2")
