"""Writes a document as a PDF file, with fpdf2 and the fonts of matplotlib."""

from __future__ import annotations

import importlib
import io
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np

from slosh_report.document import (
    Block,
    Chart,
    Code,
    Document,
    Facts,
    Figure,
    Group,
    Heading,
    KeyFigures,
    Lines,
    Notice,
    Paragraph,
    Picture,
    Section,
    Table,
)
from slosh_report.errors import SloshReportError
from slosh_report.page.charts import chart_svg
from slosh_report.page.template import readable
from slosh_report.texts import words

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


def pdf_file(document: Document, footer: tuple[str, str], attached: Mapping[str, str]) -> bytes:
    """Writes a document as a PDF file.

    Args:
        document: what is printed; equal documents give equal bytes.
        footer: two lines at the end of each page, the second one in a fixed-width font.
        attached: JSON texts in the file, by name.

    Raises:
        SloshReportError: fpdf2 is not installed.
    """
    pdf = _new_file(document.title, footer)
    _title(pdf, document)
    for number, section in enumerate(document.shown, start=1):
        _section(pdf, f"{number} " * document.numbered, section)
    for name, text in attached.items():
        pdf.embed_file(
            bytes=text.encode(), basename=name, compress=False, mime_type="application/json",
            modification_date=_NO_DATE, creation_date=_NO_DATE,
        )  # fmt: skip
    return bytes(pdf.output())


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


def _new_file(title: str, footer: tuple[str, str]) -> Any:
    fpdf = _library()

    class Paper(fpdf.FPDF):  # type: ignore[name-defined]
        """PDF document with A4 pages."""

        def footer(self) -> None:
            """Writes the two lines and the page number at the bottom of a page."""
            self.set_y(-BOTTOM + 5.0)
            self.set_draw_color(*RULE)
            self.line(MARGIN, self.get_y() - 1.5, MARGIN + WIDTH, self.get_y() - 1.5)
            self.set_font(SANS, "", 6.5)
            self.set_text_color(*SOFT)
            self.cell(WIDTH - 25.0, 3.5, _fitting(self, footer[0], WIDTH - 27.0))
            self.cell(25.0, 3.5, f"page {self.page_no()} of {{nb}}", align="R")
            self.ln()
            self.set_font(MONO, "", 6.0)
            self.cell(WIDTH, 3.5, footer[1])

    pdf = Paper(format="A4")
    pdf.set_margins(MARGIN, TOP, MARGIN)
    pdf.set_auto_page_break(True, BOTTOM)
    pdf.set_title(readable(title))
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


def _title(pdf: Any, document: Document) -> None:
    _text(pdf, document.before, 9.0)
    pdf.set_font(SANS, "B", 17.0)
    pdf.set_text_color(*INK)
    pdf.multi_cell(WIDTH, 8.0, readable(document.title), new_x="LMARGIN", new_y="NEXT")
    pdf.ln(2.0)
    for block in document.head:
        _block(pdf, block)


def _section(pdf: Any, number: str, section: Section) -> None:
    pdf.ln(5.0)
    if pdf.will_page_break(30.0):
        pdf.add_page()
    pdf.set_font(SANS, "B", 12.0)
    pdf.set_text_color(*INK)
    title = words(section.title)
    pdf.start_section(title)
    pdf.cell(WIDTH, 7.0, number + title, new_x="LMARGIN", new_y="NEXT")
    for block in section.blocks:
        _block(pdf, block)
        pdf.ln(2.5)


def _block(pdf: Any, block: Block) -> None:
    drawn: Mapping[type, Callable[[Any, Any], None]] = {
        Facts: _facts,
        Lines: _lines,
        Code: _code,
        Table: _table,
        Notice: _notice,
        Figure: _figure,
        Paragraph: lambda pdf, one: _text(pdf, words(one.text), 8.5, INK),
        Heading: lambda pdf, one: _text(pdf, words(one.text), 10.0, INK),
        KeyFigures: _key_figures,
        Picture: _picture,
        Group: _group,
    }
    drawn[type(block)](pdf, block)


def _group(pdf: Any, group: Group) -> None:
    _text(pdf, group.summary, 8.5)
    for block in group.blocks:
        _block(pdf, block)


def _key_figures(pdf: Any, found: KeyFigures) -> None:
    rows = ((one.label, (one.value, f" {one.unit} ", one.note)) for one in found.figures)
    _facts(pdf, Facts(tuple(rows)))


def _picture(pdf: Any, picture: Picture) -> None:
    caption = " ".join(filter(None, (picture.letter, picture.frame.caption)))
    _text(pdf, caption, 8.0)
    pdf.image(io.BytesIO(picture.frame.image), w=WIDTH / 3.0)


def _notice(pdf: Any, notice: Notice) -> None:
    title = words(notice.title)
    pdf.set_font(SANS, "B", 12.0)
    pdf.set_text_color(*VERDICT_COLOURS.get(title[:1], INK))
    pdf.multi_cell(WIDTH, 6.0, readable(title), new_x="LMARGIN", new_y="NEXT")
    for line in notice.lines:
        _text(pdf, words(line), 9.0)
    pdf.ln(2.0)


def _text(pdf: Any, text: str, size: float, colour: tuple[int, int, int] = SOFT) -> None:
    pdf.set_font(SANS, "", size)
    pdf.set_text_color(*colour)
    pdf.multi_cell(WIDTH, 0.5 * size, readable(text), align="L", new_x="LMARGIN", new_y="NEXT")


def _lines(pdf: Any, lines: Lines) -> None:
    for line in lines.lines or (lines.none,):
        text = words(line)
        _text(pdf, f"– {text}" if lines.lines else text, 8.5, INK)
        pdf.ln(0.8)


def _code(pdf: Any, code: Code) -> None:
    pdf.set_font(MONO, "", 7.5)
    pdf.set_text_color(*INK)
    for line in words(code.text).splitlines():
        pdf.multi_cell(WIDTH, 3.6, readable(line) or " ", align="L", new_x="LMARGIN", new_y="NEXT")


def _facts(pdf: Any, facts: Facts) -> None:
    pdf.set_draw_color(*RULE)
    pdf.set_font(SANS, "", 8.5)
    options = _library()
    with pdf.table(
        width=WIDTH, col_widths=(42, 140), text_align="L", line_height=4.2, padding=(0.6, 1.0),
        first_row_as_headings=False, borders_layout="NONE", align="L", v_align="T",
    ) as table:  # fmt: skip
        for label, text in facts.rows:
            row = table.row()
            row.cell(readable(words(label)), style=options.FontFace(color=SOFT))
            row.cell(readable(words(text)), style=options.FontFace(color=INK))


def _table(pdf: Any, content: Table) -> None:
    if pdf.will_page_break(22.0):
        pdf.add_page()
    content = content.shown("page")
    _text(pdf, words(content.caption), 8.0)
    pdf.ln(0.5)
    pdf.set_draw_color(*RULE)
    pdf.set_font(SANS, "", 7.5)
    face = _library().FontFace
    sides = tuple("RIGHT" if column.kind == "n" else "LEFT" for column in content.columns)
    with pdf.table(
        width=WIDTH, col_widths=tuple(column.width for column in content.columns),
        text_align=sides, line_height=3.9, borders_layout="HORIZONTAL_LINES", align="L",
        padding=(5.0, 1.0, 1.0) if content.kind == "tall" else (0.9, 1.0),
        headings_style=face(emphasis="BOLD", color=SOFT, fill_color=HEAD), v_align="T",
    ) as table:  # fmt: skip
        head = table.row()
        for column in content.columns:
            head.cell(words(column.head), padding=(0.9, 1.0))
        for cells in content.rows:
            row = table.row()
            for cell, column in zip(cells, content.columns, strict=True):
                text = readable(words(cell))
                colour = VERDICT_COLOURS.get(text[:1])
                if colour is not None and len(text) > 1:
                    row.cell(text, style=face(emphasis="BOLD", color=colour))
                elif column.kind == "code":
                    row.cell(text, style=face(family=MONO, size_pt=6.0, color=INK))
                else:
                    row.cell(text, style=face(color=INK))
    pdf.line(pdf.l_margin - 1.0, pdf.get_y(), pdf.l_margin + WIDTH - 1.0, pdf.get_y())


def _figure(pdf: Any, figure: Figure) -> None:
    for chart in figure.charts:
        _chart(pdf, chart)


def _chart(pdf: Any, chart: Chart) -> None:
    height = WIDTH * CHART[1] / CHART[0]
    if pdf.will_page_break(height + 8.0):
        pdf.add_page()
    _text(pdf, words(chart.caption), 8.0)
    _legend(pdf, chart)
    svg = chart_svg(_below_top(chart), CHART, chart.name)
    pdf.set_font(SANS, "", 8.0)
    pdf.image(io.BytesIO(_drawn(svg).encode()), x=MARGIN, w=WIDTH, h=height)


def _below_top(chart: Chart) -> Chart:
    """Returns a chart whose lines do not leave it: on paper nothing cuts them off."""
    if chart.top is None:
        return chart
    most = chart.top / chart.scale
    lines = (replace(line, values=np.minimum(line.values, most)) for line in chart.lines)
    return replace(chart, lines=tuple(lines))


def _legend(pdf: Any, chart: Chart) -> None:
    colours = _colours()
    pdf.set_font(SANS, "B", 7.5)
    for line in chart.lines:
        colour = colours.get(line.kind, colours["ink"])
        name = words(line.name) + " (dashed)" * (line.kind == "linear")
        pdf.set_text_color(*bytes.fromhex(colour[1:]))
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
