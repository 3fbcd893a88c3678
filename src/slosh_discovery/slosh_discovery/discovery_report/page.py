"""Fills the page's template."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from jinja2 import Template
from markupsafe import Markup

from slosh_discovery.discover.finding import Finding, Role, Verdict
from slosh_discovery.discovery_report import words
from slosh_discovery.discovery_report.charts import (
    acceleration_chart,
    heights_chart,
    residual_chart,
    turning_chart,
    turning_of,
)
from slosh_discovery.discovery_report.data import DiscoveryReport
from slosh_discovery.discovery_report.document import Document, discovery_document
from slosh_discovery.discovery_report.figures import NAN, shown_confidence, shown_parameter
from slosh_report.page.lines import NARROW, WIDE
from slosh_report.page.template import data_element, make_environment
from slosh_report.page.units import shown

ROWS = 100
"""Most rows of a table on the page; the JSON document holds them all."""
UNFOLDED = 10
"""Explanations that are shown at once."""
DRAWN = 6
"""Most motions that are drawn."""
LOW = (9.6, 2.2)
LOW_NARROW = (4.1, 2.4)
"""Sizes of the residual's charts [in]."""
SIZES = (("wide", WIDE), ("narrow", NARROW))
LOW_SIZES = (("wide", LOW), ("narrow", LOW_NARROW))
CONFIDENT = 0.9
"""A name with less is shown as something to doubt."""


def render_discovery(report: DiscoveryReport) -> str:
    """The page as HTML text, the same for the same report; every text in it is escaped."""
    finding, document = report.finding, discovery_document(report)
    drawn = drawn_motions(finding)
    return _template().render(
        report=report,
        finding=finding,
        doc=document,
        rows=ROWS,
        unfolded=UNFOLDED,
        status=_status(finding),
        headline=words.headline(finding),
        sentences=(words.verdict_sentence(finding), words.gap_sentence(finding)),
        winner=_winner(document),
        tried=[entry for entry in enumerate(document["candidates"]) if entry[1]["applicable"]],
        refused=[
            entry for entry in enumerate(document["candidates"]) if not entry[1]["applicable"]
        ],
        widest=_widest(document["candidates"]),
        groups=_groups(document["where"]),
        letters=dict(enumerate(words.LETTERS)),
        drawn=drawn,
        charts=_charts(report, drawn),
        turning=[turning_of(motion.inputs) is not None for motion in finding.separating],
        seen=_seen(document),
        models=[
            (name, _changes(document["base"]["text"], model["text"]))
            for name, model in (document["group_models"] or {"": document["model"]}).items()
        ],
        changed=finding.changed,
    )


def drawn_motions(finding: Finding) -> list[int]:
    """Indices of the motions that are drawn: those held out first, the worst before first."""
    motions = finding.motions

    def rank(index: int) -> tuple[bool, float]:
        rms = motions[index].before.rms
        return motions[index].role is not Role.HOLDOUT, -rms if math.isfinite(rms) else 0.0

    # A fitted motion is always among them: the reader sees what the parameters come from.
    order = sorted(range(len(motions)), key=rank)
    fitted = [index for index in order if motions[index].role is Role.FIT][:1]
    chosen = dict.fromkeys([*order[: DRAWN - len(fitted)], *fitted, *order])
    return sorted(list(chosen)[:DRAWN])


def _charts(report: DiscoveryReport, drawn: Sequence[int]) -> dict[str, Markup]:
    """SVG text by name."""
    finding = report.finding
    charts: dict[str, str | None] = {}
    for index in drawn:
        motion = finding.motions[index]
        moments = {
            letter: moment.t
            for letter, moment in zip(words.LETTERS, finding.worst, strict=False)
            if moment.motion == motion.motion.name
        }
        for width, size in SIZES:
            name = f"motion-{index}-{width}"
            charts[name] = heights_chart(motion, moments, size, name)
        for width, size in LOW_SIZES:
            name = f"residual-{index}-{width}"
            charts[name] = residual_chart(motion, size, name)
    for index, separating in enumerate(finding.separating):
        for width, size in LOW_SIZES:
            for kind, draw in (("acceleration", acceleration_chart), ("turning", turning_chart)):
                name = f"{kind}-{index}-{width}"
                charts[name] = draw(separating, size, name)
    return {name: Markup(svg) for name, svg in charts.items() if svg is not None}


def _status(finding: Finding) -> str:
    """How the verdict is coloured."""
    if finding.verdict is Verdict.UNEXPLAINED:
        return "failed"
    doubtful = finding.verdict is Verdict.NAMED and not finding.confidence >= CONFIDENT
    return "open" if doubtful or finding.verdict is Verdict.AMBIGUOUS else "passed"


def _winner(document: Document) -> int | None:
    """Index of the candidate that the verdict names; None: it names none."""
    names = {effect["name"] for effect in document["effects"]}
    apart = {effect["name"] for effect in document["effects"] if effect["by_group"]}
    tried = [entry for entry in enumerate(document["candidates"]) if entry[1]["applicable"]]
    return next(
        (
            index
            for index, entry in tried
            if set(entry["effects"]) == names and set(entry["per_group"]) == apart
        ),
        None,
    )


def _widest(candidates: Sequence[Document]) -> float:
    """The largest residual of all candidates: the full length of a bar [m]."""
    known = [value for row in candidates for value in (row["fit_rms"], row["holdout_rms"])]
    return max((value for value in known if value is not None), default=0.0)


def _groups(rows: Sequence[Document]) -> list[dict[str, Any]]:
    """Rows of `where` by what they are parts of, with their indices."""
    found: dict[str, list[tuple[int, Document]]] = {}
    for index, row in enumerate(rows):
        found.setdefault(row["by"], []).append((index, row))
    groups = []
    for by, entries in found.items():
        values = [v for _, row in entries for v in (row["before"], row["after"]) if v is not None]
        length = 1.0 if by == "input" else max(values, default=0.0)
        groups.append({"by": by, "name": words.part_name(by), "rows": entries, "length": length})
    return groups


def _seen(document: Document) -> dict[int, str]:
    """What the charts of each motion show, in words, for those who do not see them."""
    return {
        index: f"Line chart of motion {index + 1}: measured up to {shown(row['peak'], 'mm')} mm, "
        f"before up to {shown(row['before']['peak'], 'mm')} mm, "
        f"after up to {shown(row['after']['peak'], 'mm')} mm."
        for index, row in enumerate(document["motions"])
    }


def _changes(base: str, model: str) -> list[tuple[bool, str]]:
    """The model's lines, and which of them are not in the base."""
    lines = difflib.ndiff(base.splitlines(), model.splitlines())
    return [(line[0] == "+", line[2:]) for line in lines if line[0] in "+ "]


def parameter(
    path: str, effect: str, name: str, value: float | None, error: float | None
) -> Markup:
    """A fitted parameter's value, and below `standard_errors` its error."""
    entry = shown_parameter(effect, name, *(NAN if v is None else v for v in (value, error)))
    text = data_element(f"{path}/parameters/{name}", value, entry.value)
    if error is not None:
        error_path = f"{path}/standard_errors/{name}"
        text += Markup(" ± ") + data_element(error_path, error, entry.error)
    return text + (Markup("&nbsp;") + entry.unit if entry.unit else "")


def fitted(
    path: str,
    parameters: Mapping[str, Mapping[str, float | None]],
    under: str = "/parameters/",
) -> Markup:
    """The parameters of a candidate, one after another."""
    parts = []
    for effect, values in parameters.items():
        for name, value in values.items():
            entry = shown_parameter(effect, name, NAN if value is None else value)
            number = data_element(f"{path}{under}{effect}/{name}", value, entry.value)
            unit = Markup("&nbsp;") + entry.unit if entry.unit else ""
            whose = name if len(parameters) == 1 else f"{effect}.{name}"
            parts.append(Markup("{} = {}{}").format(whose, number, unit))
    return Markup(", ").join(parts)


def fitted_by_group(
    path: str, groups: Mapping[str, Mapping[str, Mapping[str, float | None]]]
) -> Markup:
    """The parameters of a candidate that each group has its own of."""
    return Markup("; ").join(
        Markup("{}: {}").format(group, fitted(f"{path}/by_group/{group}", effects, "/"))
        for group, effects in groups.items()
    )


def named_set(names: Sequence[str], per_group: Sequence[str] = ()) -> Markup:
    """A set of effects, whose names stay whole."""
    ids = (
        Markup('<span class="id" title="{}">{}</span>').format(
            words.effect_meaning(name), shown_as
        )
        for name, shown_as in zip(names, words.marked(names, per_group), strict=True)
    )
    return Markup(" + ").join(ids) or Markup(words.AS_IT_IS)


def probability(path: str, value: float | None) -> Markup:
    """A probability as people read it."""
    return data_element(path, value, shown_confidence(NAN if value is None else value))


def bar(value: float | None, length: float, kind: str) -> Markup:
    """A bar whose full length is `length`; nothing where the value is not known."""
    if value is None or not length > 0.0:
        return Markup("")
    width = f"{100.0 * float(np.clip(value / length, 0.0, 1.0)):.1f}"
    return Markup('<span class="bar {}" style="width: {}%"></span>').format(kind, width)


@cache
def _template() -> Template:
    environment = make_environment("slosh_discovery.discovery_report")
    environment.globals.update(
        parameter=parameter, fitted=fitted, probability=probability, bar=bar,
        named_set=named_set, fitted_by_group=fitted_by_group, effect_title=words.effect_title,
        effect_meaning=words.effect_meaning,
    )  # fmt: skip
    return environment.get_template("discovery.html.j2")
