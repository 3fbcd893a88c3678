"""Arranges a validation report in sections of texts, tables and charts."""

from __future__ import annotations

from typing import Final

from slosh_fleet.validation.content import Criterion, Peak, Recording, ValidationReport, Verdict
from slosh_report.blocks import (
    Block,
    Cell,
    Chart,
    Code,
    Column,
    Facts,
    Lines,
    Number,
    Section,
    Table,
)
from slosh_report.page.units import DASH, shown
from slosh_report.run_report.rows import Fact

VERDICTS: Final = {
    Verdict.PASS: "✓ pass",
    Verdict.FAIL: "✗ fail",
    Verdict.UNDECIDED: "? undecided",
}
_HEAVY: Final = 8
"""Gaps that a recording's row names; of more it gives the number."""


def sections(report: ValidationReport, digest: str) -> tuple[Section, ...]:
    """Returns the sections of a validation report in printing order.

    Args:
        report: what is signed.
        digest: SHA-256 of the signed content, in hexadecimal digits.
    """
    found = [
        Section("Subject", (Facts(report.subject),)),
        Section("Acceptance", (criteria_table(report),)),
        Section("Method", (Facts(report.method),)),
        Section("Data", (_recordings(report), *_gaps(report), _files(report))),
        Section("Versions", (Facts(report.versions),)),
        Section("Limits", (_limits(report), *_excesses(report))),
        Section("Results", _results(report)),
        Section("Deviations", (Lines(report.deviations, "No deviation was found."),)),
        Section("Open points", (Lines(report.open_points, "Everything could be judged."),)),
        Section("Signatures", (_signed(digest), _signatures(report))),
    ]
    if report.model_text:
        found.append(Section("Annex: model", (Code(report.model_text),)))
    return tuple(found)


def summary(report: ValidationReport) -> str:
    """Returns one sentence about the verdict of a validation report."""
    counts = [
        f"{sum(one.verdict is verdict for one in report.criteria)} {verdict.value}"
        for verdict in Verdict
    ]
    return f"{len(report.criteria)} criteria: {', '.join(counts)}."


def criteria_table(report: ValidationReport) -> Table:
    """Creates the table of the acceptance criteria with their verdicts."""
    columns = (
        Column("criterion", 30), Column("recording", 20), Column("found", 12, right=True),
        Column("U", 12, right=True), Column("limit", 12, right=True), Column("unit", 9),
        Column("verdict", 20),
    )  # fmt: skip
    rows = tuple(_criterion(one) for one in report.criteria)
    return Table("Acceptance criteria; U is the expanded uncertainty (k = 2)", columns, rows)


def _criterion(one: Criterion) -> tuple[Cell, ...]:
    unit = one.unit
    name = f"{one.name}: {one.reason}" if one.reason else one.name
    numbers = (one.value, one.uncertainty, one.limit)
    values = [Number(value, unit).text.removeprefix("+") for value in numbers]
    cells: list[Cell] = [
        Number(value, unit) if text == shown(value, unit) else text
        for value, text in zip(numbers, values, strict=True)
    ]
    return (name, one.recording or "all", *cells, unit.partition(" ")[0], VERDICTS[one.verdict])


def _recordings(report: ValidationReport) -> Table:
    columns = (
        Column("recording", 24), Column("recorded", 34), Column("duration [s]", 15, right=True),
        Column("images", 13, right=True), Column("samples", 15, right=True),
        Column("gaps", 10, right=True), Column("lost", 10, right=True),
        Column("dropped", 16, right=True), Column("flags", 32),
    )  # fmt: skip
    rows = tuple(
        (
            one.name, one.recorded, Number(one.duration, "s"), Number(one.images),
            Number(one.samples), Number(len(one.gaps)), Number(one.lost), Number(one.dropped),
            ", ".join(f"{name} ({count})" for name, count in one.flags) or "none",
        )
        for one in report.recordings
    )  # fmt: skip
    return Table("Recordings", columns, rows)


def _gaps(report: ValidationReport) -> list[Block]:
    lines = []
    for one in report.recordings:
        if one.gaps:
            spans = [f"{shown(start, 's')} to {shown(end, 's')} s" for start, end in one.gaps]
            more = f" and {len(spans) - _HEAVY} more" if len(spans) > _HEAVY else ""
            lines.append(f"{one.name}: no measurement {', '.join(spans[:_HEAVY])}{more}")
    return [Lines(tuple(lines))] if lines else []


def _files(report: ValidationReport) -> Table:
    columns = (
        Column("file", 56), Column("role", 19), Column("bytes", 19, right=True),
        Column("SHA-256", 88, code=True),
    )  # fmt: skip
    rows = tuple((one.path, one.role, Number(one.size), one.sha256) for one in report.files)
    return Table("Files", columns, rows)


def _limits(report: ValidationReport) -> Table:
    columns = (
        Column("recording", 25), Column("what", 30), Column("limit [mm]", 18, right=True),
        Column("origin", 70),
    )  # fmt: skip
    rows = tuple(
        (one.recording, one.quantity, Number(one.limit, "mm"), one.origin) for one in report.limits
    )
    return Table("Limits in force while recording", columns, rows)


def _excesses(report: ValidationReport) -> list[Block]:
    rows = tuple(
        (
            one.name, event.source, Number(event.start, "s"), Number(event.duration, "s"),
            Number(event.limit, "mm"), Number(event.peak, "mm"),
        )
        for one in report.recordings
        for event in one.events
    )  # fmt: skip
    if not rows:
        return [Lines((), "No limit was exceeded.")]
    columns = (
        Column("recording", 25), Column("what", 25), Column("start [s]", 18, right=True),
        Column("duration [s]", 20, right=True), Column("limit [mm]", 18, right=True),
        Column("peak [mm]", 18, right=True),
    )  # fmt: skip
    return [Table("Limit events", columns, rows)]


def _results(report: ValidationReport) -> tuple[Block, ...]:
    blocks: list[Block] = [_heights(report), _agreement(report)]
    if any(one.motions for one in report.recordings):
        blocks.append(_motions(report))
    if report.repeatability:
        blocks.append(_repeatability(report))
    blocks += [
        Chart(
            number, f"{one.name}: heights; orange: limit in force exceeded, grey: no measurement"
        )
        for number, one in enumerate(report.recordings)
    ]
    return tuple(blocks)


def _heights(report: ValidationReport) -> Table:
    columns = (
        Column("recording", 25), Column("measured [mm]", 22, right=True),
        Column("U [mm]", 16, right=True), Column("estimated [mm]", 23, right=True),
        Column("limit [mm]", 18, right=True), Column("limit use [%]", 20, right=True),
        Column("reproduced", 28, right=True),
    )  # fmt: skip
    rows = tuple(
        (
            one.name, peak_cell(one.peak), Number(one.peak.uncertainty, "mm"),
            Number(one.estimated_peak, "mm"), Number(limit, "mm"),
            Number(one.peak.height / limit, "% of"),
            f"{one.reproduced} of {one.estimates}" if one.estimates else DASH,
        )
        for one in report.recordings
        for limit in (judged_limit(report, one),)
    )  # fmt: skip
    caption = (
        "Highest heights above the still level; reproduced: recorded estimates that came out again"
    )
    return Table(caption, columns, rows)


def judged_limit(report: ValidationReport, recording: Recording) -> float:
    """Returns the limit by which a recording's height was judged [m], or NaN if none."""
    limits = [
        one.limit
        for one in report.criteria
        if one.recording == recording.name and one.name == HEIGHT
    ]
    return limits[0] if limits else float("nan")


HEIGHT: Final = "highest measured height"
"""Name of the criterion that limits the liquid's height."""


def peak_cell(peak: Peak) -> Number:
    """Returns the table cell of a greatest height, marked with ≥ if it is a lower bound."""
    return Number(peak.height, "mm", prefix="≥ " if peak.is_bound else "")


def _agreement(report: ValidationReport) -> Table:
    columns = (
        Column("recording", 28), Column("model", 45), Column("MAE [mm]", 20, right=True),
        Column("ε [%]", 18, right=True), Column("RMS [mm]", 20, right=True),
        Column("images", 18, right=True),
    )  # fmt: skip
    rows = tuple(
        (
            one.name, row.name, Number(row.sigma, "mm"), Number(row.epsilon, "%"),
            Number(row.rms, "mm"), Number(row.count),
        )
        for one in report.recordings
        for row in one.models
    )  # fmt: skip
    return Table("Agreement of measured and estimated heights (MAE is σ of DL22)", columns, rows)


def _motions(report: ValidationReport) -> Table:
    columns = (
        Column("recording", 28), Column("motion", 15, right=True),
        Column("start [s]", 18, right=True), Column("end [s]", 18, right=True),
        Column("measured [mm]", 24, right=True), Column("U [mm]", 18, right=True),
        Column("MAE [mm]", 18, right=True), Column("ε [%]", 16, right=True),
    )  # fmt: skip
    rows = tuple(
        (
            one.name, motion.name, Number(motion.start, "s"), Number(motion.end, "s"),
            peak_cell(peak), Number(peak.uncertainty, "mm"),
            Number(motion.models[-1].sigma, "mm"), Number(motion.models[-1].epsilon, "%"),
        )
        for one in report.recordings
        for motion, peak in zip(one.motions, one.motion_peaks, strict=True)
    )  # fmt: skip
    last = next(one.motions for one in report.recordings if one.motions)[0].models[-1].name
    return Table(f"Motions; MAE and ε of {last}", columns, rows)


def _repeatability(report: ValidationReport) -> Table:
    columns = (
        Column("motion", 16, right=True), Column("recordings", 22, right=True),
        Column("mean [mm]", 22, right=True), Column("deviation [mm]", 18, right=True),
        Column("lowest [mm]", 24, right=True), Column("highest [mm]", 24, right=True),
        Column("spread [mm]", 24, right=True), Column("U [mm]", 18, right=True),
    )  # fmt: skip
    rows = tuple(
        (
            str(one.motion), Number(one.count), Number(one.mean, "mm"),
            Number(one.deviation, "mm"), Number(one.lowest, "mm"), Number(one.highest, "mm"),
            Number(one.spread, "mm"), Number(one.uncertainty, "mm"),
        )
        for one in report.repeatability
    )  # fmt: skip
    return Table("Repeatability of the highest measured height of each motion", columns, rows)


def _signed(digest: str) -> Facts:
    return Facts(
        (
            Fact("SHA-256 of the content", digest),
            Fact(
                "check",
                "slosh report --verify FILE --digest DIGEST finds any later change of this "
                "report and of the files that it names. The digest proves what was signed only "
                "where it is kept apart from the file: write it beside the signature, or sign "
                "the printed page that shows it.",
            ),
        )
    )


def _signatures(report: ValidationReport) -> Table:
    columns = (
        Column("role", 32), Column("name", 50), Column("date", 30), Column("signature", 70)
    )  # fmt: skip
    rows = tuple((one.role, one.name, "", "") for one in report.signatures)
    return Table("Signatures", columns, rows, tall=True)
