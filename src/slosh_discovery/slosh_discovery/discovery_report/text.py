"""The result of a discovery as the short text of the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from slosh_discovery.discover.finding import (
    Finding,
    FittedParameters,
    FoundEffect,
    Verdict,
    WhereRow,
)
from slosh_discovery.discovery_report.data import DiscoveryReport
from slosh_discovery.discovery_report.words import (
    NAN,
    explanation,
    largest_share,
    marked,
    millimetres,
    part_name,
    shown_confidence,
    shown_parameter,
    verdict_sentence,
)
from slosh_report.document import Block, Lines, Table, plain_table
from slosh_report.page.units import DASH, shown

MOMENTS = 3
"""Worst moments that are told."""
RUNNERS_UP = 3
"""Explanations beside the likeliest that are told."""
FOLLOWS = 0.3
"""A residual follows an input with which it is correlated by at least this."""
INDENT = "  "

Row = tuple[str, ...]


def brief(report: DiscoveryReport) -> tuple[Block, ...]:
    """Returns verdict, effects, errors and the next commands, as the terminal tells them."""
    finding = report.finding
    commands = tuple(
        line for command in report.commands for line in (f"# {command.purpose}", command.line)
    )
    return (
        Lines((verdict_sentence(finding),)),
        plain_table(_effects(finding), "<<<"),
        _evidence(finding),
        _gap(finding),
        _where(finding),
        Lines(tuple(_proposal(finding))),
        Lines(tuple(_separating(report))),
        Lines(report.remarks),
        Lines(commands),
    )


def _effects(finding: Finding) -> Iterator[Row]:
    for effect in finding.effects:
        values = _parameters(effect) or [""]
        yield effect.name, values[0], f"confidence {shown_confidence(effect.confidence)}"
        yield from (("", value, "") for value in values[1:])
        if effect.alternatives:
            yield "", f"or {' or '.join(effect.alternatives)}", ""


def _parameters(effect: FoundEffect) -> list[str]:
    """Returns a physical effect's parameters, or those of each named group of motions."""
    alone = FittedParameters(effect.parameters, effect.standard_errors)
    sets = {f"{group}: ": one for group, one in effect.by_group.items()} or {"": alone}
    return [
        whose + shown_parameter(effect.name, name, value, one.standard_errors.get(name, NAN)).text
        for whose, one in sets.items()
        for name, value in one.parameters.items()
    ]


def _evidence(finding: Finding) -> Table:
    """Returns the most probable candidate models, if there are several."""
    tried = [candidate for candidate in finding.candidates if not candidate.reason]
    rows = [
        (
            explanation(marked(candidate.effects, candidate.per_group)),
            shown_confidence(candidate.probability),
            millimetres(candidate.fit_rms),
            millimetres(candidate.holdout_rms),
        )
        for candidate in tried[: 1 + RUNNERS_UP]
    ]
    heads = ("explanation", "probability", "rms fit", "held out")
    return plain_table(rows if len(tried) > 1 else (), "<>>>", heads)


def _gap(finding: Finding) -> Table:
    gap, changed = finding.gap, finding.changed

    def row(name: str, before: float, after: float, closed: float) -> Row:
        share = f"{shown(closed, '% of')} %" if changed and math.isfinite(closed) else DASH
        return name, millimetres(before), millimetres(after) if changed else DASH, share

    rows = [row("fit", gap.fit_before, gap.fit_after, gap.fit_closed)]
    if math.isfinite(gap.holdout_before):
        rows.append(row("held out", gap.holdout_before, gap.holdout_after, gap.holdout_closed))
    rows.append(("noise", millimetres(gap.noise), "", ""))
    return plain_table(rows, "<>>>", ("gap", "before", "after", "closed"))


def _where(finding: Finding) -> Table:
    """Returns the worst parts of the data and the worst times."""
    rows: list[Row] = []
    for part in worst_parts(finding.where):
        values = [part.before, part.after]
        if part.by == "input":
            cells = [shown(value, "", 2) for value in values]
            share = "correlation with the residual"
        else:
            cells = list(map(millimetres, values))
            share = f"{shown(part.share, '% of')} % of the squared residual"
        rows.append((part_name(part.by), part.label, *cells, share))
    for moment in finding.worst[:MOMENTS]:
        place = f"{moment.t:.2f} s of {moment.motion}"
        off = [abs(moment.measured - value) for value in (moment.before, moment.after)]
        rows.append(("moment", place, *map(millimetres, off), "off"))
    heads = ("worst by", "", "before", "after", "")
    return plain_table(() if finding.verdict is Verdict.NONE else rows, "<<>><", heads)


def worst_parts(rows: Sequence[WhereRow]) -> Iterator[WhereRow]:
    """Yields, for each criterion (time, phase, …), the row with the largest part of the error."""
    for by in dict.fromkeys(row.by for row in rows):
        group = [row for row in rows if row.by == by]
        index = largest_share(row.before if by == "input" else row.share for row in group)
        if index is not None and (by != "input" or group[index].before >= FOLLOWS):
            yield group[index]


def _proposal(finding: Finding) -> Iterable[str]:
    if finding.proposal is not None:
        yield f"proposal, not a finding: {finding.proposal.equation}"
        explained = shown(finding.proposal.explained, "% of")
        yield f"{INDENT}it explains {explained} % of the remaining gap"


def _separating(report: DiscoveryReport) -> Iterable[str]:
    for index, motion in enumerate(report.finding.separating):
        where = "".join(report.separating_files[index : index + 1]) or "a motion"
        yield (
            f"{where} distinguishes {motion.names[0]} from {motion.names[1]}: {motion.description}"
        )
        yield (
            f"{INDENT}their heights differ by {millimetres(motion.difference)} in it,"
            f" by {millimetres(motion.present_difference)} in the present motions"
        )
