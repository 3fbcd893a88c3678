"""The result of a discovery as a document."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from slosh_discovery.discover.finding import Finding, Verdict
from slosh_discovery.discovery_report.data import DiscoveryReport, discovery_data
from slosh_discovery.discovery_report.motions import (
    motions_blocks,
    turning_of,
    vector_figure,
    where_blocks,
    worst_blocks,
)
from slosh_discovery.discovery_report.text import brief
from slosh_discovery.discovery_report.words import (
    AS_IT_IS,
    NAN,
    effect_meaning,
    effect_title,
    gap_sentence,
    headline,
    marked,
    shown_confidence,
    shown_parameter,
    verdict_sentence,
)
from slosh_report.document import (
    ROWS,
    Block,
    Code,
    Column,
    Document,
    Facts,
    Group,
    Heading,
    KeyFigure,
    KeyFigures,
    Lines,
    Notice,
    Paragraph,
    Picture,
    Section,
    Table,
    changed_lines,
    explain,
    numbers,
    table,
)
from slosh_report.page.units import DASH
from slosh_report.texts import Bars, Mark, Number, Place, Text, joined

UNFOLDED = 10
"""Explanations that are shown at once."""
CONFIDENT = 0.9
"""A name with less is shown as something to doubt."""
VERDICTS = {
    Verdict.NAMED: ("✓ Named", "What is missing"),
    Verdict.NONE: ("✓ Adequate", "Effects"),
    Verdict.AMBIGUOUS: ("? Ambiguous", "The most likely explanation"),
    Verdict.UNEXPLAINED: ("✗ Unexplained", "The nearest explanation"),
}
"""Verdict and heading of the effects."""


def discovery_document(report: DiscoveryReport) -> Document:
    """Returns the result of a discovery as a document; its data are `discovery.json`."""
    finding, data = report.finding, Place(discovery_data(report))
    label, effects = VERDICTS[finding.verdict]
    sentences = verdict_sentence(finding), gap_sentence(finding)
    separating = "A motion that distinguishes the explanations"
    if len(finding.separating) > 1:
        separating = "Motions that distinguish the explanations"
    worst = (*worst_blocks(data), *_frames(report))
    sections = (
        Section(effects, _effects(data), "effects", "Effects"),
        Section("Evidence", _evidence(data), "evidence"),
        Section(separating, tuple(_separating(report, data)), "separating", "Separating motion"),
        Section("Proposal", _proposal(data), "proposal"),
        Section("Before and after", motions_blocks(finding, data), "motions"),
        Section("Where they disagree", tuple(where_blocks(data)), "where", "Where"),
        Section("Worst moments", worst, "worst"),
        Section("Model", tuple(_model(finding, data)), "model"),
        Section("Next commands", tuple(_next(report)), "next", "Next"),
    )
    head = (
        Paragraph(report.subtitle, "subtitle"),
        Notice(_status(finding), label, sentences),
        _figures(finding, data),
        Lines(report.remarks, kind="notes"),
    )
    return Document(headline(finding), head, sections, data.data, brief(report), contents=True)


def _status(finding: Finding) -> str:
    if finding.verdict is Verdict.UNEXPLAINED:
        return "failed"
    doubtful = finding.verdict is Verdict.NAMED and not finding.confidence >= CONFIDENT
    return "open" if doubtful or finding.verdict is Verdict.AMBIGUOUS else "passed"


def _figures(finding: Finding, data: Place) -> KeyFigures:
    gap = data["gap"]

    def both(role: str) -> Text:
        before, after = (gap[when].number(role, "mm") for when in ("before", "after"))
        return (before, " → ", after) if finding.changed else (before,)

    confidence = _probability(data, "confidence")
    figures = [KeyFigure("confidence", confidence, "", "in the complete result")]
    if gap.data["before"]["holdout"] is not None:
        figures.append(KeyFigure("gap, held out", both("holdout"), "mm", "rms, held-out motions"))
    figures.append(KeyFigure("gap, fit", both("fit"), "mm", "rms, fitted motions"))
    if gap.data["closed"] is not None:
        closed = gap.number("closed", "% of")
        figures.append(KeyFigure("closed", closed, "%", "of what a better model could remove"))
    noise = KeyFigure("noise", gap.number("noise", "mm"), "mm", "of the measured heights")
    return KeyFigures((*figures, noise))


def _probability(place: Place, key: str) -> Number:
    value = place.data[key]
    return place.said(key, shown_confidence(NAN if value is None else value))


def _effects(data: Place) -> tuple[Block, ...]:
    def name(effect: Place) -> Text:
        own = effect.data["name"]
        return (
            effect_title(own),
            Mark((Mark(own, "code"), ", other parameters" * effect.data["refitted"]), "small"),
            Mark(effect_meaning(own), "small"),
        )

    def parameters(effect: Place) -> Text:
        own, groups = effect.data["name"], effect["by_group"]
        lines: list[Text] = list(_fitted(own, effect))
        lines += [
            (f"{group}: ", joined(_fitted(own, groups[group]), ", ")) for group in groups.data
        ]
        return tuple(Mark(line, "line") for line in lines) or DASH

    def others(effect: Place) -> Text:
        return joined((Mark(one, "code") for one in effect.data["alternatives"]), ", ") or DASH

    columns = (
        Column("effect", name, "name"),
        Column("parameters", parameters),
        Column("confidence", lambda effect: _probability(effect, "confidence"), "n"),
        Column("similarly likely alternatives", others, "name"),
    )
    if not data.data["effects"]:
        return ()
    groups = " A name before a colon is a group of motions with its own parameters."
    return (
        table("Effects", columns, data["effects"], kind="wide-names", seen=False),
        explain(
            "± is one standard error of the fit.", groups if data.data["group_models"] else ""
        ),
    )


def _fitted(effect: str, place: Place) -> Iterator[Text]:
    """Yields the parameters of an effect with their standard errors."""
    values, errors = place["parameters"], place["standard_errors"]
    for name, value in values.data.items():
        error = errors.data.get(name)
        entry = shown_parameter(effect, name, *(NAN if v is None else v for v in (value, error)))
        beside = (" ± ", errors.said(name, entry.error)) if error is not None else ""
        unit = f"\xa0{entry.unit}" if entry.unit else ""
        yield f"{name} = ", values.said(name, entry.value), beside, unit


def _evidence(data: Place) -> tuple[Block, ...]:
    tried = [one for one in data["candidates"] if one.data["applicable"]]
    refused = [one for one in data["candidates"] if not one.data["applicable"]]
    rms = [one.data[key] for one in data["candidates"] for key in ("fit_rms", "holdout_rms")]
    widest = max((value for value in rms if value is not None), default=0.0)
    winner = _winner(data, tried)

    def bars(row: Place) -> Text:
        pairs = (("fit_rms", "fit"), ("holdout_rms", "held"))
        return Bars(tuple((row.data[key], widest, kind) for key, kind in pairs))

    columns = (
        Column("explanation", lambda row: _explanation(row, row.index == winner), "name"),
        Column("probability", lambda row: _probability(row, "probability"), "n"),
        Column("", bars, "bars"),
        numbers("fit [mm]", "fit_rms", "mm"),
        numbers("left out [mm]", "holdout_rms", "mm"),
        Column("log evidence", lambda row: row.exact("evidence", 4), "n"),
    )

    def candidates(caption: str, rows: Sequence[Place]) -> Table:
        marks = tuple("won" if row.index == winner else "" for row in rows)
        return table(caption, columns, rows, kind="wide-names", marks=marks)

    found: list[Block] = []
    if tried:
        found.append(candidates("Explanations, the likeliest first", tried[:UNFOLDED]))
        more = tried[UNFOLDED:]
        if more:
            further = candidates("Further explanations", more)
            found.append(Group((further,), summary=f"{len(more)} more explanations"))
        found.append(
            explain(
                "Probability among all explanations that were tried; the evidence is relative to "
                "the unchanged model. Bars and numbers are the root mean square of the residual, ",
                Mark("of the fit", "key swatch"), " and ",
                Mark("of held-out motions", "key swatch held"),
                "; if a bar is not longer than the noise, ", data["gap"].number("noise", "mm"),
                " mm, nothing is left to explain.",
            )
        )  # fmt: skip
    if refused:
        facts = Facts(
            tuple((Mark(_named(row), "code"), row.data["reason"]) for row in refused[:ROWS])
        )
        found.append(Group((facts,), summary=f"{len(refused)} not tried, and why"))
    return tuple(found)


def _winner(data: Place, tried: Iterable[Place]) -> int | None:
    """Returns the index of the candidate model that the verdict names; None if it names none."""
    effects = data.data["effects"]
    names = {effect["name"] for effect in effects}
    apart = {effect["name"] for effect in effects if effect["by_group"]}
    for one in tried:
        if set(one.data["effects"]) == names and set(one.data["per_group"]) == apart:
            return one.index
    return None


def _named(candidate: Place) -> Text:
    """Returns the names of a candidate's effects, without line breaks inside them."""
    names, per_group = candidate.data["effects"], candidate.data["per_group"]
    ids = (
        Mark(shown_as, "id", effect_meaning(name))
        for name, shown_as in zip(names, marked(names, per_group), strict=True)
    )
    return joined(ids, " + ") or AS_IT_IS


def _explanation(candidate: Place, won: bool) -> Text:
    groups = candidate["by_group"]
    by_group = [(f"{group}: ", _parameters(groups[group])) for group in groups.data]
    small = (_parameters(candidate["parameters"]), joined(by_group, "; "))
    return _named(candidate), " ✓" * won, *(Mark(text, "small") for text in small if text)


def _parameters(effects: Place) -> Text:
    """Returns the fitted parameters of a candidate model."""
    parts: list[Text] = []
    for effect, values in effects.data.items():
        for name, value in values.items():
            entry = shown_parameter(effect, name, NAN if value is None else value)
            whose = name if len(effects.data) == 1 else f"{effect}.{name}"
            unit = f"\xa0{entry.unit}" if entry.unit else ""
            parts.append((f"{whose} = ", effects[effect].said(name, entry.value), unit))
    return joined(parts, ", ")


def _separating(report: DiscoveryReport, data: Place) -> Iterator[Block]:
    for motion, separating in zip(data["separating"], report.finding.separating, strict=True):
        first, second = (Mark(name, "code") for name in motion.data["names"])
        file = motion.data["file"]
        yield Paragraph((
            "It distinguishes ", first, " from ", second, f": {motion.data['description']}. ",
            "Their heights differ by ", Mark((motion.number("difference", "mm"), " mm"), "b"),
            " in it, and by ", motion.number("present_difference", "mm"),
            " mm in the present motions (rms). It takes ", motion.number("duration", "s", 1), " s",
            ("; the table is ", Mark(file, "code")) if file else "", ".",
        ))  # fmt: skip
        inputs = separating.inputs
        yield vector_figure("acceleration", motion.index, inputs.t, inputs.acceleration, 1.0,
                      "acceleration [m/s²]", ("x", "y", "z"))  # fmt: skip
        turning = turning_of(inputs)
        if turning is not None:
            yield vector_figure(
                "rotation", motion.index, inputs.t, turning[0], 180.0 / np.pi, *turning[1:]
            )


def _proposal(data: Place) -> tuple[Block, ...]:
    if not data.data["proposal"]:
        return ()
    proposal = data["proposal"]
    columns = (
        Column("term", lambda row: row.data["term"], "name"),
        Column("coefficient", lambda row: row.exact("coefficient", 4), "n"),
        Column("unit", lambda row: row.data["unit"]),
    )
    return (
        Paragraph(
            "No effect of the list explains the gap. A sparse regression over generic terms "
            "proposes the following terms. They are a hint, not a finding:"
        ),
        Code(proposal.data["equation"]),
        table("Proposed terms", columns, proposal["terms"], kind="slim", seen=False),
        Paragraph((
            "It explains ", proposal.number("explained", "% of"),
            " % of the remaining removable gap in the fitted motions.",
        )),
    )  # fmt: skip


def _frames(report: DiscoveryReport) -> tuple[Block, ...]:
    return (Group(tuple(map(Picture, report.frames)), "frames"),) if report.frames else ()


def _model(finding: Finding, data: Place) -> Iterator[Block]:
    base = data.data["base"]
    if finding.changed:
        new = data.data["model"]["name"]
        yield Paragraph(f"{base['name']} before, {new} after; bold lines are new.")
    else:
        yield Paragraph(f"{base['name']}, unchanged.")
    for group, model in (data.data["group_models"] or {"": data.data["model"]}).items():
        if group:
            yield Heading(f"Motions of {group}")
        yield changed_lines(base["text"], model["text"])


def _next(report: DiscoveryReport) -> Iterator[Block]:
    for command in report.commands:
        yield Paragraph(command.purpose)
        yield Code(command.line)
