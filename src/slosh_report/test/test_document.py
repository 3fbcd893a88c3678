"""Tests a document of every kind of block: page, text and data tell the same."""

import html
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_report.document import (
    Chart,
    Code,
    Column,
    Document,
    Facts,
    Figure,
    Group,
    Heading,
    KeyFigure,
    KeyFigures,
    Line,
    Lines,
    Notice,
    Paragraph,
    Picture,
    Section,
    changed_lines,
    numbers,
    table,
)
from slosh_report.json_values import plain
from slosh_report.page.charts import chart_svg
from slosh_report.page.frame import Frame
from slosh_report.page.html import html_page, inline
from slosh_report.page.template import readable
from slosh_report.text import blocks_text, document_text, json_text
from slosh_report.texts import Bars, Mark, Number, Place, joined, words
from slosh_testing.reports import CONTROL, Page, at, evil, grey_png

TEXTS = st.text(max_size=20)
VALUES = st.dictionaries(TEXTS, st.floats() | st.none(), min_size=1, max_size=4)


@given(st.lists(VALUES, min_size=1, max_size=4))
def test_each_number_of_a_page_is_that_of_the_data(rows):
    """Whatever the keys hold: slashes, tildes, quotes, markup."""
    data = Place(plain({"a/b~": rows}))
    texts = tuple(row.exact(key) for row in data["a/b~"] for key in row.data)
    page = html_page(Document("t", sections=(Section("s", (Lines(texts),)),), data=data.data))
    found = re.findall(r'<data value="([^"]*)" data-path="([^"]*)">', page)
    assert len(found) == len(texts)
    for value, path in found:
        there = at(json.loads(json_text(data.data)), html.unescape(path))
        # JSON knows one kind of unknown; a page cannot hold each character of a key.
        if "\ufffd" not in path:
            assert json.loads(html.unescape(value)) == there


@given(TEXTS)
def test_a_text_is_a_text_in_each_place(text):
    parts = Mark((text, Mark(text, "b", text)), "a", text, f"#{text}")
    page = Page()
    page.feed(str(inline((parts, Number(1.0, said=text or "0"), joined([text, text], ", ")))))
    shown = (
        str(readable(text)) * 2
        + str(readable(text) or "0")
        + f"{readable(text)}, {readable(text)}"
    )
    assert page.text == shown


def everything(text):
    """Returns a document with each kind of block, whose texts are the given one."""
    t = np.linspace(0.0, 1.0, 50)
    columns = (
        Column(text, lambda row: text, "name"),
        numbers("x [mm]", "x", "mm", group="g"),
        numbers("y [mm]", "x", "mm", group="g"),
        Column("ok", lambda row: "✓ yes", "verdict", only="page"),
        Column("bars", lambda row: Bars(((1.0, 2.0, "held"),)), "bars"),
        Column("short", lambda row: "s", only="text"),
    )
    data = Place({"rows": [{"x": 0.001 * n} for n in range(120)]})
    chart = Chart("c", text, text, (Line(text, "linear", t, t),), keys=(text,))
    blocks = (
        table(text, columns, data["rows"]), Facts(((text, text),)), Lines((text,)), Code(text),
        Figure((chart,)), Group((Paragraph(text),), summary=text), Group((Paragraph(text),), "x"),
        changed_lines("a", f"a\n{text}"),
    )  # fmt: skip
    return Document(
        text, (Paragraph(text, "subtitle"),), (Section(text, blocks, "a"), Section("none", ())),
        data.data, blocks[:4], contents=True,
    )  # fmt: skip


def test_hostile_texts_stay_texts_on_the_page_and_in_the_terminal():
    page, shown = Page(), everything(evil("x"))
    page.feed(html_page(shown))
    assert not page.hacked
    assert not set(page.text) & CONTROL
    assert not set(document_text(shown)) & CONTROL


def test_a_long_table_tells_what_is_left_out_and_columns_know_their_place():
    page = html_page(everything("title"))
    assert "The first 100 of 120; the JSON file next to this page" in page
    assert page.count("✓ yes") == 100
    assert 'colspan="2" class="head">g<' in page
    assert ">short<" not in page
    assert '<h2 id="a">title</h2>' in page
    assert "none</h2>" not in page
    lines = document_text(everything("title")).splitlines()
    assert lines[0].split() == ["title", "x", "[mm]", "y", "[mm]", "bars", "short"]
    assert lines[2].split() == ["title", "1.00", "1.00", "s"]
    assert len(lines) == 121 + 6  # of a text all rows; three blocks and what parts them


def test_each_kind_of_block_is_printed_on_paper():
    pytest.importorskip("fpdf", reason="fpdf2 is not installed (requirements/pdf.txt)")
    from slosh_report.pdf import pdf_file

    shown = everything("title")
    t = np.linspace(0.0, 1.0, 50)
    above = Chart("d", "", "seen", (Line("z", "thin", t, t),), top=500.0)
    more = (
        Heading("below"), Paragraph("text"), KeyFigures((KeyFigure("x", Number(0.5, "s"), "s"),)),
        Picture(Frame(grey_png(), "seen", "image/png"), "A"), Figure((above,)),
        Notice("passed", "✓ Named", ("why",)),
    )  # fmt: skip
    shown = replace(shown, sections=(*shown.sections, Section("more", more)), numbered=True)
    file = pdf_file(shown, ("title", "digest"), {"a.json": "{}"})
    assert file.startswith(b"%PDF-")
    assert file == pdf_file(shown, ("title", "digest"), {"a.json": "{}"})


def test_a_long_line_of_a_text_is_whole_and_one_line():
    (line,) = blocks_text((Lines(("a\nb" + 3000 * "c",)),)).splitlines()
    assert line == "a\\nb" + 3000 * "c"


def test_an_empty_table_says_nothing_in_a_text():
    columns = (Column("a", lambda row: "x"),)
    assert blocks_text((table("", columns, ()), Lines(("told",)))) == "told"


def test_unknown_numbers_are_null_and_dashes():
    nan = float("nan")
    assert str(inline(Number(nan, "mm"))) == '<data value="null">–</data>'
    assert json_text({"x": nan}) == '{\n  "x": null\n}\n'
    assert words((Number(-0.001, "mm"), " mm")) == "−1.00 mm"


@pytest.mark.parametrize("samples", [100, 20_000])
def test_a_dashed_line_has_dashes_however_long_it_is(samples):
    t = np.linspace(0.0, 10.0, samples)
    line = Line("", "linear", t, np.sin(t))
    svg = chart_svg(Chart("c", "", "seen", (line,)), (9.6, 3.3), "c")
    (drawn,) = re.findall(r"<path [^>]*style=\"([^\"]*var\(--linear\)[^\"]*)\"", svg)
    assert "stroke-dasharray" in drawn
