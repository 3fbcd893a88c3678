"""A validation report as a document, and as a sealed page or PDF file."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

from slosh_fleet.validation.content import Peak, Recording, ValidationReport, Verdict
from slosh_fleet.validation.seal import content_digest, content_of, envelope, seal_line, sealed
from slosh_report.document import (
    Block,
    Code,
    Column,
    Document,
    Facts,
    Figure,
    Lines,
    Notice,
    Section,
    Table,
    table,
)
from slosh_report.page.units import DASH, shown
from slosh_report.run_report import Fact, RunReport
from slosh_report.run_report.charts import heights_chart
from slosh_report.texts import Mark, Number, Text

VERDICTS: Final = {
    Verdict.PASS: "✓ pass",
    Verdict.FAIL: "✗ fail",
    Verdict.UNDECIDED: "? undecided",
}
KINDS: Final = {"✓": "passed", "✗": "failed", "?": "open"}
_HEAVY: Final = 8
"""Gaps that a recording's row names; of more it gives the number."""


def validation_page(report: ValidationReport, runs: Sequence[RunReport]) -> bytes:
    """Renders a validation report as a sealed HTML page; equal reports give equal bytes.

    Args:
        report: what is signed; every text in it is escaped.
        runs: reports of the recordings' replays, in the order of `report.recordings`.
    """
    from slosh_report.page.html import html_page  # with the templates

    content = content_of(report)
    carried = f'<script type="application/json" id="content">{envelope(content)}</script>'
    page = html_page(validation_document(report, runs, content_digest(content)), carried)
    return sealed(f"{page}<!-- {seal_line()} -->\n".encode("utf-8", "replace"))


def validation_pdf(report: ValidationReport, runs: Sequence[RunReport]) -> bytes:
    """Writes a validation report as a sealed PDF file; equal reports give equal bytes.

    Args:
        report, runs: as for the page.

    Raises:
        SloshReportError: fpdf2 is not installed.
    """
    from slosh_report.pdf import pdf_file

    content = content_of(report)
    digest = content_digest(content)
    name = " · ".join(filter(None, (report.document, report.title)))
    footer = (name, f"SHA-256 of the content {digest}")
    attached = {"content.json": envelope(content)}
    file = pdf_file(validation_document(report, runs, digest), footer, attached)
    head, mark, tail = file.rpartition(b"startxref")
    return sealed(head + b"%" + seal_line().encode() + b"\n" + mark + tail)


def validation_document(
    report: ValidationReport, runs: Sequence[RunReport], digest: str
) -> Document:
    """Returns a validation report as a document.

    Args:
        report, runs: as for the page.
        digest: SHA-256 of the signed content, in hexadecimal digits.
    """
    verdict = VERDICTS[report.verdict]
    head = (
        Notice(KINDS[verdict[0]], verdict, (summary(report),)),
        Facts((
            ("date of issue", report.issued or "_" * 20),
            ("SHA-256 of the content", Mark(digest, "code")),
        )),
    )  # fmt: skip
    annex = (Code(report.model_text),) if report.model_text else ()
    sections = (
        Section("Subject", (_facts(report.subject),)),
        Section("Acceptance", (criteria_table(report),)),
        Section("Method", (_facts(report.method),)),
        Section("Data", (_recordings(report), *_gaps(report), _files(report))),
        Section("Versions", (_facts(report.versions),)),
        Section("Limits", (_limits(report), _excesses(report))),
        Section("Results", _results(report, runs)),
        Section("Deviations", (Lines(report.deviations, "No deviation was found."),)),
        Section("Open points", (Lines(report.open_points, "Everything could be judged."),)),
        Section("Signatures", (_signed(digest), _signatures(report))),
        Section("Annex: model", annex),
    )
    before = "Validation report" + f" · document {report.document}" * bool(report.document)
    return Document(report.title, head, sections, before=before, numbered=True)


def _facts(facts: Sequence[Fact]) -> Facts:
    return Facts(tuple((fact.label, fact.text) for fact in facts))


def _number(
    head: str, of: Callable[[Any], float | None], unit: str = "", width: float = 18.0
) -> Column:
    return Column(head, lambda row: Number(of(row), unit), "n", width=width)


def _text(head: str, of: Callable[[Any], Text], width: float, kind: str = "") -> Column:
    return Column(head, of, kind, width=width)


def _table(caption: str, columns: Sequence[Column], rows: Iterable[Any], **more: Any) -> Table:
    """Makes a table that is printed whole."""
    return table(caption, columns, rows, most=sys.maxsize, **more)


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
        _text(
            "criterion", lambda one: f"{one.name}: {one.reason}" if one.reason else one.name, 30
        ),
        _text("recording", lambda one: one.recording or "all", 20),
        Column("found", lambda one: _judged(one.value, one.unit), "n", width=12),
        Column("U", lambda one: _judged(one.uncertainty, one.unit), "n", width=12),
        Column("limit", lambda one: _judged(one.limit, one.unit), "n", width=12),
        _text("unit", lambda one: one.unit.partition(" ")[0], 9),
        _text("verdict", lambda one: VERDICTS[one.verdict], 20, "verdict"),
    )
    caption = "Acceptance criteria; U is the expanded uncertainty (k = 2)"
    return _table(caption, columns, report.criteria)


def _judged(value: float, unit: str) -> Number:
    """Returns a number that is judged, which has no plus."""
    return Number(value, unit, said=Number(value, unit).text.removeprefix("+"))


def _recordings(report: ValidationReport) -> Table:
    def flags(one: Recording) -> str:
        return ", ".join(f"{name} ({count})" for name, count in one.flags) or "none"

    columns = (
        _text("recording", lambda one: one.name, 24),
        _text("recorded", lambda one: one.recorded, 34),
        _number("duration [s]", lambda one: one.duration, "s", 15),
        _number("images", lambda one: one.images, width=13),
        _number("samples", lambda one: one.samples, width=15),
        _number("gaps", lambda one: len(one.gaps), width=10),
        _number("lost", lambda one: one.lost, width=10),
        _number("dropped", lambda one: one.dropped, width=16),
        _text("flags", flags, 32),
    )
    return _table("Recordings", columns, report.recordings)


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
        _text("file", lambda one: one.path, 56),
        _text("role", lambda one: one.role, 19),
        _number("bytes", lambda one: one.size, width=19),
        _text("SHA-256", lambda one: one.sha256, 88, "code"),
    )
    return _table("Files", columns, report.files)


def _limits(report: ValidationReport) -> Table:
    columns = (
        _text("recording", lambda one: one.recording, 25),
        _text("what", lambda one: one.quantity, 30),
        _number("limit [mm]", lambda one: one.limit, "mm"),
        _text("origin", lambda one: one.origin, 70),
    )
    return _table("Limits in force while recording", columns, report.limits)


def _excesses(report: ValidationReport) -> Block:
    columns = (
        _text("recording", lambda row: row[0].name, 25),
        _text("what", lambda row: row[1].source, 25),
        _number("start [s]", lambda row: row[1].start, "s"),
        _number("duration [s]", lambda row: row[1].duration, "s", 20),
        _number("limit [mm]", lambda row: row[1].limit, "mm"),
        _number("peak [mm]", lambda row: row[1].peak, "mm"),
    )
    rows = [(one, event) for one in report.recordings for event in one.events]
    return _table("Limit events", columns, rows) if rows else Lines((), "No limit was exceeded.")


def _results(report: ValidationReport, runs: Sequence[RunReport]) -> tuple[Block, ...]:
    blocks: list[Block] = [_heights(report), _agreement(report)]
    if any(one.motions for one in report.recordings):
        blocks.append(_motions(report))
    if report.repeatability:
        blocks.append(_repeatability(report))
    for number, (one, run) in enumerate(zip(report.recordings, runs, strict=True)):
        text = f"{one.name}: heights; orange: limit in force exceeded, grey: no measurement"
        blocks.append(Figure((heights_chart(run, f"run-{number}", Mark(text, "b")),)))
    return tuple(blocks)


def _heights(report: ValidationReport) -> Table:
    def limit(one: Recording) -> float:
        return judged_limit(report, one)

    def reproduced(one: Recording) -> str:
        return f"{one.reproduced} of {one.estimates}" if one.estimates else DASH

    columns = (
        _text("recording", lambda one: one.name, 25),
        _text("measured [mm]", lambda one: peak_cell(one.peak), 22, "n"),
        _number("U [mm]", lambda one: one.peak.uncertainty, "mm", 16),
        _number("estimated [mm]", lambda one: one.estimated_peak, "mm", 23),
        _number("limit [mm]", limit, "mm"),
        _number("limit use [%]", lambda one: one.peak.height / limit(one), "% of", 20),
        _text("reproduced", reproduced, 28, "n"),
    )
    caption = (
        "Highest heights above the still level; reproduced: recorded estimates that came out again"
    )
    return _table(caption, columns, report.recordings)


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
        _text("recording", lambda row: row[0].name, 28),
        _text("model", lambda row: row[1].name, 45),
        _number("MAE [mm]", lambda row: row[1].sigma, "mm", 20),
        _number("ε [%]", lambda row: row[1].epsilon, "%"),
        _number("RMS [mm]", lambda row: row[1].rms, "mm", 20),
        _number("images", lambda row: row[1].count),
    )
    rows = [(one, model) for one in report.recordings for model in one.models]
    caption = "Agreement of measured and estimated heights (MAE is σ of DL22)"
    return _table(caption, columns, rows)


def _motions(report: ValidationReport) -> Table:
    columns = (
        _text("recording", lambda row: row[0].name, 28),
        _text("motion", lambda row: row[1].name, 15, "n"),
        _number("start [s]", lambda row: row[1].start, "s"),
        _number("end [s]", lambda row: row[1].end, "s"),
        _text("measured [mm]", lambda row: peak_cell(row[2]), 24, "n"),
        _number("U [mm]", lambda row: row[2].uncertainty, "mm"),
        _number("MAE [mm]", lambda row: row[1].models[-1].sigma, "mm"),
        _number("ε [%]", lambda row: row[1].models[-1].epsilon, "%", 16),
    )
    rows = [
        (one, motion, peak)
        for one in report.recordings
        for motion, peak in zip(one.motions, one.motion_peaks, strict=True)
    ]
    last = next(one.motions for one in report.recordings if one.motions)[0].models[-1].name
    return _table(f"Motions; MAE and ε of {last}", columns, rows)


def _repeatability(report: ValidationReport) -> Table:
    columns = (
        _text("motion", lambda one: str(one.motion), 16, "n"),
        _number("recordings", lambda one: one.count, width=22),
        _number("mean [mm]", lambda one: one.mean, "mm", 22),
        _number("deviation [mm]", lambda one: one.deviation, "mm"),
        _number("lowest [mm]", lambda one: one.lowest, "mm", 24),
        _number("highest [mm]", lambda one: one.highest, "mm", 24),
        _number("spread [mm]", lambda one: one.spread, "mm", 24),
        _number("U [mm]", lambda one: one.uncertainty, "mm"),
    )
    caption = "Repeatability of the highest measured height of each motion"
    return _table(caption, columns, report.repeatability)


def _signed(digest: str) -> Facts:
    check = (
        "slosh report --verify FILE --digest DIGEST finds any later change of this report and of "
        "the files that it names. The digest proves what was signed only where it is kept apart "
        "from the file: write it beside the signature, or sign the printed page that shows it."
    )
    return Facts((("SHA-256 of the content", digest), ("check", check)))


def _signatures(report: ValidationReport) -> Table:
    columns = (
        _text("role", lambda one: one.role, 32), _text("name", lambda one: one.name, 50),
        _text("date", lambda one: "", 30), _text("signature", lambda one: "", 70),
    )  # fmt: skip
    return _table("Signatures", columns, report.signatures, kind="tall")
