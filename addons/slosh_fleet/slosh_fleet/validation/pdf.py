"""Writes a validation report as a PDF file, with fpdf2 and the fonts of matplotlib."""

from __future__ import annotations

import importlib
import io
import re
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from typing import Any, Final

from slosh_fleet.validation.content import ValidationReport
from slosh_fleet.validation.seal import content_digest, content_of, envelope, seal_line, sealed
from slosh_fleet.validation.sections import VERDICTS, sections, summary
from slosh_report.blocks import (
    Block,
    Chart,
    Code,
    Facts,
    Lines,
    Section,
    Table,
    cell_text,
)
from slosh_report.errors import SloshReportError
from slosh_report.page.template import readable
from slosh_report.run_report.charts import heights_chart
from slosh_report.run_report.data import RunReport

HOW_TO_GET: Final = (
    "a PDF needs fpdf2 (pip install -r requirements/pdf.txt); an .html page does not"
)
MARGIN, TOP, BOTTOM = 14.0, 16.0, 20.0  # mm
WIDTH: Final = 210.0 - 2 * MARGIN
CHART: Final = (7.2, 2.5)
"""Size of a chart [in]."""
INK, SOFT, RULE, HEAD = (0, 0, 0), (80, 80, 80), (190, 190, 190), (240, 240, 240)
VERDICT_COLOURS: Final = {"✓": (28, 107, 60), "✗": (163, 18, 58), "?": (106, 65, 0)}
SANS, MONO = "DejaVu", "DejaVuMono"
_FONTS: Final = (
    (SANS, "", "DejaVuSans.ttf"), (SANS, "B", "DejaVuSans-Bold.ttf"),
    (MONO, "", "DejaVuSansMono.ttf"),
)  # fmt: skip
_VARIABLE: Final = re.compile(r"--([a-z-]+):\s*(#[0-9a-f]{6})")
_NO_DATE: Final = datetime(2000, 1, 1, tzinfo=UTC)
"""In the file's properties: equal reports have equal bytes; the date of issue is in the text."""


def validation_pdf(report: ValidationReport, runs: Sequence[RunReport]) -> bytes:
    """Writes a validation report as a sealed PDF file; equal reports give equal bytes.

    Args:
        report: what is signed.
        runs: reports of the recordings' replays, in the order of `report.recordings`.

    Raises:
        SloshReportError: fpdf2 is not installed.
    """
    content = content_of(report)
    digest = content_digest(content)
    pdf = _new_file(report, digest)
    _title(pdf, report, digest)
    for number, section in enumerate(sections(report, digest), start=1):
        _section(pdf, number, section, runs)
    pdf.embed_file(
        bytes=envelope(content).encode(), basename="content.json", compress=False,
        mime_type="application/json", modification_date=_NO_DATE, creation_date=_NO_DATE,
    )  # fmt: skip
    head, mark, tail = bytes(pdf.output()).rpartition(b"startxref")
    return sealed(head + b"%" + seal_line().encode() + b"\n" + mark + tail)


def check_library() -> None:
    """Raises an error if the library that writes PDF files is missing.

    Raises:
        SloshReportError: fpdf2 is not installed.
    """
    _library()


def _library() -> Any:
    try:
        return importlib.import_module("fpdf")
    except ImportError:
        raise SloshReportError(HOW_TO_GET) from None


def _new_file(report: ValidationReport, digest: str) -> Any:
    fpdf = _library()

    class Document(fpdf.FPDF):  # type: ignore[name-defined]
        """PDF document with A4 pages; its footer has title, digest and page number."""

        def footer(self) -> None:
            """Writes title, digest and page number at the bottom of a page."""
            self.set_y(-BOTTOM + 5.0)
            self.set_draw_color(*RULE)
            self.line(MARGIN, self.get_y() - 1.5, MARGIN + WIDTH, self.get_y() - 1.5)
            self.set_font(SANS, "", 6.5)
            self.set_text_color(*SOFT)
            name = " · ".join(filter(None, (report.document, report.title)))
            self.cell(WIDTH - 25.0, 3.5, _fitting(self, name, WIDTH - 27.0))
            self.cell(25.0, 3.5, f"page {self.page_no()} of {{nb}}", align="R")
            self.ln()
            self.set_font(MONO, "", 6.0)
            self.cell(WIDTH, 3.5, f"SHA-256 of the content {digest}")

    pdf = Document(format="A4")
    pdf.set_margins(MARGIN, TOP, MARGIN)
    pdf.set_auto_page_break(True, BOTTOM)
    pdf.set_title(readable(report.title))
    pdf.set_creator("slosh report")
    pdf.set_creation_date(_NO_DATE)
    folder = _font_folder()
    for family, style, name in _FONTS:
        pdf.add_font(family, style, folder / name)
    pdf.add_page()
    return pdf


def _font_folder() -> Path:
    import matplotlib as mpl

    return Path(mpl.get_data_path()) / "fonts" / "ttf"


def _fitting(pdf: Any, text: str, width: float) -> str:
    """Shortens a text to a given width on paper [mm]."""
    text = readable(text)
    while text and pdf.get_string_width(text) > width:
        text = text[:-2] + "…"
    return text


def _title(pdf: Any, report: ValidationReport, digest: str) -> None:
    _text(pdf, "Validation report" + f" · document {report.document}" * bool(report.document), 9.0)
    pdf.set_font(SANS, "B", 17.0)
    pdf.set_text_color(*INK)
    pdf.multi_cell(WIDTH, 8.0, readable(report.title), new_x="LMARGIN", new_y="NEXT")
    pdf.ln(2.0)
    verdict = VERDICTS[report.verdict]
    pdf.set_font(SANS, "B", 12.0)
    pdf.set_text_color(*VERDICT_COLOURS[verdict[0]])
    pdf.multi_cell(WIDTH, 6.0, verdict, new_x="LMARGIN", new_y="NEXT")
    _text(pdf, summary(report), 9.0)
    pdf.ln(2.0)
    _facts(pdf, [("date of issue", report.issued or "_" * 20), ("SHA-256 of the content", digest)])


def _section(pdf: Any, number: int, section: Section, runs: Sequence[RunReport]) -> None:
    pdf.ln(5.0)
    if pdf.will_page_break(30.0):
        pdf.add_page()
    pdf.set_font(SANS, "B", 12.0)
    pdf.set_text_color(*INK)
    pdf.start_section(section.title)
    pdf.cell(WIDTH, 7.0, f"{number} {section.title}", new_x="LMARGIN", new_y="NEXT")
    for block in section.blocks:
        _block(pdf, block, runs)
        pdf.ln(2.5)


def _block(pdf: Any, block: Block, runs: Sequence[RunReport]) -> None:
    if isinstance(block, Chart):
        _chart(pdf, block, runs[block.recording])
        return
    drawn: Mapping[type, Callable[[Any, Any], None]] = {
        Facts: lambda pdf, facts: _facts(pdf, [(row.label, row.text) for row in facts.rows]),
        Lines: _lines,
        Code: _code,
        Table: _table,
    }
    drawn[type(block)](pdf, block)


def _text(pdf: Any, text: str, size: float, colour: tuple[int, int, int] = SOFT) -> None:
    pdf.set_font(SANS, "", size)
    pdf.set_text_color(*colour)
    pdf.multi_cell(WIDTH, 0.5 * size, readable(text), align="L", new_x="LMARGIN", new_y="NEXT")


def _lines(pdf: Any, lines: Lines) -> None:
    for line in lines.lines or (lines.none,):
        _text(pdf, f"– {line}" if lines.lines else line, 8.5, INK)
        pdf.ln(0.8)


def _code(pdf: Any, code: Code) -> None:
    pdf.set_font(MONO, "", 7.5)
    pdf.set_text_color(*INK)
    for line in code.text.splitlines():
        pdf.multi_cell(WIDTH, 3.6, readable(line) or " ", align="L", new_x="LMARGIN", new_y="NEXT")


def _facts(pdf: Any, rows: Sequence[tuple[str, str]]) -> None:
    pdf.set_draw_color(*RULE)
    pdf.set_font(SANS, "", 8.5)
    options = _library()
    with pdf.table(
        width=WIDTH, col_widths=(42, 140), text_align="L", line_height=4.2, padding=(0.6, 1.0),
        first_row_as_headings=False, borders_layout="NONE", align="L", v_align="T",
    ) as table:  # fmt: skip
        for label, text in rows:
            row = table.row()
            row.cell(readable(label), style=options.FontFace(color=SOFT))
            row.cell(readable(text), style=options.FontFace(color=INK))


def _table(pdf: Any, content: Table) -> None:
    if pdf.will_page_break(22.0):
        pdf.add_page()
    _text(pdf, content.caption, 8.0)
    pdf.ln(0.5)
    pdf.set_draw_color(*RULE)
    pdf.set_font(SANS, "", 7.5)
    face = _library().FontFace
    sides = tuple("RIGHT" if column.right else "LEFT" for column in content.columns)
    with pdf.table(
        width=WIDTH, col_widths=tuple(column.width for column in content.columns),
        text_align=sides, line_height=3.9, borders_layout="HORIZONTAL_LINES", align="L",
        padding=(5.0, 1.0, 1.0) if content.tall else (0.9, 1.0),
        headings_style=face(emphasis="BOLD", color=SOFT, fill_color=HEAD), v_align="T",
    ) as table:  # fmt: skip
        head = table.row()
        for column in content.columns:
            head.cell(column.head, padding=(0.9, 1.0))
        for cells in content.rows:
            row = table.row()
            for cell, column in zip(cells, content.columns, strict=True):
                text = readable(cell_text(cell))
                colour = VERDICT_COLOURS.get(text[:1])
                if colour is not None and len(text) > 1:
                    row.cell(text, style=face(emphasis="BOLD", color=colour))
                elif column.code:
                    row.cell(text, style=face(family=MONO, size_pt=6.0, color=INK))
                else:
                    row.cell(text, style=face(color=INK))
    pdf.line(pdf.l_margin - 1.0, pdf.get_y(), pdf.l_margin + WIDTH - 1.0, pdf.get_y())


def _chart(pdf: Any, chart: Chart, run: RunReport) -> None:
    height = WIDTH * CHART[1] / CHART[0]
    if pdf.will_page_break(height + 8.0):
        pdf.add_page()
    _text(pdf, chart.caption, 8.0)
    _legend(pdf, run)
    svg = heights_chart(run, CHART, f"run-{chart.recording}")
    pdf.set_font(SANS, "", 8.0)
    pdf.image(io.BytesIO(_drawn(svg).encode()), x=MARGIN, w=WIDTH, h=height)


def _legend(pdf: Any, run: RunReport) -> None:
    colours = _colours()
    pdf.set_font(SANS, "B", 7.5)
    names = (
        ("measured", "measured"), ("linear", f"{run.linear_name} (dashed)"),
        ("nonlinear", run.nonlinear_name),
    )  # fmt: skip
    for colour, name in names:
        pdf.set_text_color(*bytes.fromhex(colours[colour][1:]))
        pdf.cell(pdf.get_string_width(name) + 5.0, 4.0, name)
    pdf.ln(4.5)


def _drawn(svg: str) -> str:
    """Adapts a chart of the HTML page to paper: resolves colours, size and font.

    Nothing that is drawn leaves the axes, which the clipping paths would cut off.
    """
    colours = _colours()
    svg = re.sub(r"var\(--([a-z-]+)\)", lambda found: colours[found[1]], svg)
    svg = re.sub(r' clip-path="[^"]*"', "", svg)
    svg = svg.replace('<text style="', f'<text style="font-family: {SANS}; ')
    width, height = (72.0 * side for side in CHART)
    return svg.replace("<svg ", f'<svg width="{width}pt" height="{height}pt" ', 1)


def _colours() -> dict[str, str]:
    """Returns the printed colours of the page's style by the names of their CSS variables."""
    sheet = resources.files("slosh_report.page").joinpath("report.css").read_text("utf-8")
    return dict(_VARIABLE.findall(sheet.partition("@media print")[2]))
