"""Formats the result of a discovery as a short text for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from slosh_base.files.plain_text import plain_line
from slosh_discovery.discover.finding import (
    Finding,
    FittedParameters,
    FoundEffect,
    Verdict,
    WhereRow,
)
from slosh_discovery.discovery_report.data import Command, DiscoveryReport
from slosh_discovery.discovery_report.words import (
    NAN,
    explanation,
    largest_share,
    marked,
    part_name,
    shown_confidence,
    shown_parameter,
    verdict_sentence,
)
from slosh_report.page.units import DASH, shown
from slosh_report.text_table import aligned

MOMENTS = 3
"""Worst moments that are told."""
RUNNERS_UP = 3
"""Explanations beside the likeliest that are told."""
FOLLOWS = 0.3
"""A residual follows an input with which it is correlated by at least this."""
INDENT = "  "

Row = tuple[str, ...]


def discovery_text(report: DiscoveryReport) -> str:
    """Formats verdict, effects, errors and the next commands for the terminal."""
    finding = report.finding
    blocks = [
        [verdict_sentence(finding)],
        _effects(finding),
        _evidence(finding),
        _gap(finding),
        _where(finding),
        _proposal(finding),
        _separating(report),
        [plain_line(remark) for remark in report.remarks],
        [line for command in report.commands for line in _command(command)],
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block)


def _command(command: Command) -> tuple[str, str]:
    """Formats a command with its purpose; control characters are escaped."""
    line = command.line
    return f"# {command.purpose}", line if line.isprintable() else plain_line(line)


def _effects(finding: Finding) -> list[str]:
    rows: list[Row] = []
    for effect in finding.effects:
        values = _parameters(effect) or [""]
        rows.append((effect.name, values[0], f"confidence {shown_confidence(effect.confidence)}"))
        rows += [("", value, "") for value in values[1:]]
        if effect.alternatives:
            rows.append(("", f"or {' or '.join(effect.alternatives)}", ""))
    return aligned(rows, "<<<")


def _parameters(effect: FoundEffect) -> list[str]:
    return [
        whose + shown_parameter(effect.name, name, value, one.standard_errors.get(name, NAN)).text
        for whose, one in _sets(effect)
        for name, value in one.parameters.items()
    ]


def _sets(effect: FoundEffect) -> list[tuple[str, FittedParameters]]:
    """Returns a physical effect's parameters, or those of each named group of motions."""
    if effect.by_group:
        return [(f"{group}: ", one) for group, one in effect.by_group.items()]
    return [("", FittedParameters(effect.parameters, effect.standard_errors))]


def _evidence(finding: Finding) -> list[str]:
    """Returns lines on the most probable candidate models if the verdict is uncertain."""
    tried = [candidate for candidate in finding.candidates if not candidate.reason]
    if len(tried) < 2:
        return []
    rows: list[Row] = [("explanation", "probability", "rms fit", "held out")]
    rows += [
        (
            explanation(marked(candidate.effects, candidate.per_group)),
            shown_confidence(candidate.probability),
            _millimetres(candidate.fit_rms),
            _millimetres(candidate.holdout_rms),
        )
        for candidate in tried[: 1 + RUNNERS_UP]
    ]
    return aligned(rows, "<>>>")


def _gap(finding: Finding) -> list[str]:
    gap = finding.gap
    changed = finding.changed
    rows: list[Row] = [("gap", "before", "after", "closed")]
    rows.append(
        ("fit", *_both(gap.fit_before, gap.fit_after, changed=changed),
         _percent(gap.fit_closed, changed=changed))
    )  # fmt: skip
    if math.isfinite(gap.holdout_before):
        rows.append(
            ("held out", *_both(gap.holdout_before, gap.holdout_after, changed=changed),
             _percent(gap.holdout_closed, changed=changed))
        )  # fmt: skip
    rows.append(("noise", _millimetres(gap.noise), "", ""))
    return aligned(rows, "<>>>")


def _both(before: float, after: float, *, changed: bool) -> tuple[str, str]:
    return _millimetres(before), _millimetres(after) if changed else DASH


def _percent(share: float, *, changed: bool) -> str:
    return f"{shown(share, '% of')} %" if changed and math.isfinite(share) else DASH


def _millimetres(value: float) -> str:
    return f"{shown(value, 'mm')} mm" if math.isfinite(value) else DASH


def _where(finding: Finding) -> list[str]:
    """Returns lines on the worst parts of the data and the worst times."""
    if finding.verdict is Verdict.NONE:
        return []
    rows: list[Row] = []
    for row in worst_parts(finding.where):
        if row.by == "input":
            values = [shown(value, "", 2) for value in (row.before, row.after)]
            share = "correlation with the residual"
        else:
            values = [_millimetres(value) for value in (row.before, row.after)]
            share = f"{shown(row.share, '% of')} % of the squared residual"
        rows.append((part_name(row.by), row.label, *values, share))
    for moment in finding.worst[:MOMENTS]:
        place = f"{moment.t:.2f} s of {moment.motion}"
        off = [
            _millimetres(abs(moment.measured - value)) for value in (moment.before, moment.after)
        ]
        rows.append(("moment", place, *off, "off"))
    if not rows:
        return []
    return aligned([("worst by", "", "before", "after", ""), *rows], "<<>><")


def worst_parts(rows: Sequence[WhereRow]) -> Iterator[WhereRow]:
    """Yields, for each criterion (time, phase, …), the row with the largest part of the error."""
    for by in dict.fromkeys(row.by for row in rows):
        group = [row for row in rows if row.by == by]
        index = largest_share(row.before if by == "input" else row.share for row in group)
        if index is not None and (by != "input" or group[index].before >= FOLLOWS):
            yield group[index]


def _proposal(finding: Finding) -> list[str]:
    proposal = finding.proposal
    if proposal is None:
        return []
    return [
        f"proposal, not a finding: {proposal.equation}",
        f"{INDENT}it explains {shown(proposal.explained, '% of')} % of the remaining gap",
    ]


def _separating(report: DiscoveryReport) -> list[str]:
    finding = report.finding
    if finding.verdict is not Verdict.AMBIGUOUS and not finding.separating:
        return []
    lines = []
    for index, motion in enumerate(finding.separating):
        where = "".join(report.separating_files[index : index + 1]) or "a motion"
        lines += [
            f"{where} distinguishes {motion.names[0]} from {motion.names[1]}: "
            f"{motion.description}",
            f"{INDENT}their heights differ by {_millimetres(motion.difference)} in it,"
            f" by {_millimetres(motion.present_difference)} in the present motions",
        ]
    return lines
