"""Fills the page's template."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from functools import cache

from jinja2 import Template
from markupsafe import Markup

from slosh_discovery.identification_report import text as words
from slosh_discovery.identification_report.charts import (
    geometry_chart,
    heights_chart,
    residual_chart,
    speed_chart,
)
from slosh_discovery.identification_report.data import (
    Document,
    IdentificationReport,
    identification_document,
)
from slosh_discovery.identification_report.text import minus, rounded, shown_value
from slosh_discovery.identify.result import FittedMotion, Identification, IdentifiedModel, Role
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_report.page.lines import NARROW, SMALL, WIDE
from slosh_report.page.template import data_element, make_environment
from slosh_report.page.units import shown

ROWS = 100
"""Most rows of a table on the page; the JSON document holds them all."""
DRAWN = 6
"""Most motions that are drawn."""
LOW = (9.6, 2.2)
LOW_NARROW = (4.1, 2.4)
NAN = float("nan")


def render_identification(report: IdentificationReport) -> str:
    """The page as HTML text, the same for the same report; every text in it is escaped."""
    found, document = report.found, identification_document(report)
    drawn = drawn_motions(found.motions)
    speeds = [point for point in found.points if point.point.speed == point.point.speed]
    return _template().render(
        report=report,
        doc=document,
        rows=ROWS,
        headline=words.headline(report),
        held=[words.held_sentence(one) for one in found.overall.held],
        single_names=_single_names(document),
        drawn=drawn,
        noise=[_noise_of(found, found.motions[index]).noise.stddev for index in drawn],
        charts=_charts(report, drawn, len(speeds) > 1),
        seen=[_seen(document, index) for index in drawn],
        by_speed=len(speeds) > 1,
        size=found.base.container.size_name,
        model_lines=_changes(document["base"]["text"], document["overall"]["model"]["text"]),
    )


def drawn_motions(motions: Sequence[FittedMotion]) -> list[int]:
    """Indices of the motions that are drawn: those held out, and the first of each point."""
    held = [index for index, motion in enumerate(motions) if motion.role is Role.HOLDOUT]
    firsts = {motion.point: index for index, motion in reversed(list(enumerate(motions)))}
    spread = sorted(set(firsts.values()) - set(held))
    # A fitted motion is always among them: the reader sees what the parameters come from.
    held = held[: DRAWN // 2]
    room = max(DRAWN - len(held), 1)
    step = max(len(spread) / room, 1.0)
    chosen = [spread[int(number * step)] for number in range(min(room, len(spread)))]
    return sorted({*chosen, *held})


def _noise_of(found: Identification, motion: FittedMotion) -> IdentifiedModel:
    """The model by which a motion is shown."""
    own = [one for one in found.single if one.label == motion.point]
    return own[0] if own else found.overall


def _charts(report: IdentificationReport, drawn: Sequence[int], speeds: bool) -> dict[str, Markup]:
    """SVG text by name."""
    found = report.found
    charts: dict[str, str] = {}
    for index in drawn:
        motion = found.motions[index]
        noise = _noise_of(found, motion).noise.stddev
        for width, size, low in (("wide", WIDE, LOW), ("narrow", NARROW, LOW_NARROW)):
            name = f"motion-{index}-{width}"
            charts[name] = heights_chart(motion, size, name)
            name = f"residual-{index}-{width}"
            charts[name] = residual_chart(motion, noise, low, name)
    if speeds:
        for width, size in (("wide", WIDE), ("narrow", NARROW)):
            charts[f"speed-{width}"] = speed_chart(found.points, size, f"speed-{width}")
    for quantity in (FREQUENCY, DAMPING):
        charts[quantity] = geometry_chart(found, report.beside, quantity, SMALL, quantity)
    return {name: Markup(svg) for name, svg in charts.items()}


def _single_names(document: Document) -> list[str]:
    """Parameters of the operating points' models, in order, each once."""
    rows = [entry["name"] for one in document["single"] for entry in one["parameters"]]
    return list(dict.fromkeys(rows))


def _seen(document: Document, index: int) -> str:
    """What a motion's chart shows, in words, for those who do not see it."""
    row = document["motions"][index]
    return (
        f"Line chart of {row['name']}: measured up to {shown(row['peak'], 'mm')} mm; rms residual "
        f"{shown(row['seoe_before'], 'mm')} mm before, {shown(row['seoe'], 'mm')} mm after."
    )


def _changes(base: str, model: str) -> list[tuple[bool, str]]:
    """The model's lines, and which of them are not in the base."""
    lines = difflib.ndiff(base.splitlines(), model.splitlines())
    return [(line[0] == "+", line[2:]) for line in lines if line[0] in "+ "]


def value(path: str, entry: Document, key: str = "value") -> Markup:
    """A number of a parameter, in the shown unit, rounded as its error says."""
    known = NAN if entry[key] is None else entry[key]
    error = NAN if entry["error"] is None else entry["error"]
    if key == "error":
        text = shown_value("", entry["unit"], 0.0, error).error
    else:
        text = rounded(entry["unit"], known, error)
    return data_element(f"{path}/{key}", entry[key], text)


def unit(entry: Document) -> str:
    """The unit in which a parameter is shown."""
    return shown_value("", entry["unit"], 0.0, NAN).unit


def correlation(path: str, number: float | None) -> Markup:
    """A correlation with two digits."""
    return data_element(path, number, "–" if number is None else minus(f"{number:.2f}"))


@cache
def _template() -> Template:
    environment = make_environment("slosh_discovery.identification_report")
    environment.globals.update(value=value, unit=unit, correlation=correlation)
    return environment.get_template("identification.html.j2")
